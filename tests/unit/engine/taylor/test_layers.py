"""Power series of long models, whose operations are on vectors."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import symengine as se
from lowered import Lowered, lowered
from test_series import coefficients

import lagcli
from lagcli.engine.tape.operations import INDEXED, LINE
from lagcli.engine.tape.series_operations import LONGEST
from lagcli.engine.taylor import layers, series
from lagcli.engine.taylor.layers import pieces, steps
from lagcli.engine.taylor.series import SeriesProgram

BODIES = 110


def compiled(text: str) -> Lowered:
    return lowered(lagcli.load_text(text))


@pytest.fixture
def programs(monkeypatch: pytest.MonkeyPatch) -> list[SeriesProgram]:
    """Return the list to which the programs go that are made."""
    made: list[SeriesProgram] = []
    expand = series.expand

    def noted(*given: Any) -> SeriesProgram:
        made.append(expand(*given))
        return made[-1]

    monkeypatch.setattr(series, "expand", noted)
    return made


def both(
    text: str, q: list[float], v: list[float], programs: list[SeriesProgram], patch: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients of a program in layers and of one in rows."""
    patch.setattr(series, "LONG", 100)
    in_layers = coefficients(compiled(text), q, v)
    patch.setattr(series, "LONG", 10**9)
    in_rows = coefficients(compiled(text), q, v)
    assert [program.layer > 1 for program in programs] == [True, False]
    return in_layers, in_rows


def assert_alike(found: np.ndarray, expected: np.ndarray) -> None:
    """Compare coefficients; sums in another order differ by rounding of what they are made of."""
    size = np.abs(expected).max(axis=0)
    assert (np.abs(found - expected) <= 1e-10 * np.maximum(size, 1e-300)).all()


def bodies(force: Callable[[int], str], kinetic: str = "x{i}'^2/2") -> str:
    names = [f"x{i}" for i in range(BODIES)]
    forces = "\n".join(f'  x{i}: "{force(i)}"' for i in range(BODIES))
    return f"""
coordinates: [{", ".join(names)}]
parameters: {{{", ".join(f"a{i}: {0.5 + 0.01 * i}" for i in range(BODIES))}}}
T: {" + ".join(kinetic.format(i=i) for i in range(BODIES))}
Q:
{forces}
initial: {{{", ".join(f"{x}: 0.3, {x}': 0.1" for x in names)}}}
"""


#: What each body feels: all kinds of operations.
FORCES = {
    "sin and cos": "sin({x})*cos({x}) - sin({x})/4",
    "sqrt": "sqrt(1 + {x}^2)",
    "power": "(1.5 + {x}^2)^0.7",
    "quotient": "1/(2 + {x}) - {x}/(3 + {x}^2)",
    "exp and tanh": "exp(-{x})*tanh({x})",
    "parameter": "{a}*{x}^2 - {a}*{a}*{x}",
}
#: Where neighbours' accelerations depend on each other.
COUPLED = "(2 + sin(x{i}))*x{i}'^2/2 + x{i}'*x{j}'*cos(x{i} - x{j})/4"


def output_subsets(force: str, a: float, q: float, v: float, count: int) -> list[float]:
    """Return the Taylor coefficients of a body by itself, from derivatives that SymEngine takes."""
    x, u = se.symbols("x u")
    acceleration = se.sympify(force.format(x="x", a=repr(a)).replace("^", "**"))
    found, expression = [q], u
    for k in range(1, count):
        found.append(float(expression.subs({x: q, u: v})) / math.factorial(k))
        expression = expression.diff(x) * u + expression.diff(u) * acceleration
    return found


@pytest.mark.parametrize("name", FORCES)
def test_bodies_by_themselves(
    name: str, programs: list[SeriesProgram], monkeypatch: pytest.MonkeyPatch
) -> None:
    force = FORCES[name]
    q = [0.2 + 0.005 * i for i in range(BODIES)]
    v = [0.3 - 0.004 * i for i in range(BODIES)]
    monkeypatch.setattr(series, "LONG", 100)
    text = bodies(lambda i: force.format(x=f"x{i}", a=f"a{i}"))
    found = coefficients(compiled(text), q, v)
    assert programs[0].layer > 1
    # what is left is the sum of the powers, and a few of the bodies that it ends with
    assert programs[0].convolutions <= BODIES + 8
    for i in range(0, BODIES, 27):
        expected = output_subsets(force, 0.5 + 0.01 * i, q[i], v[i], 8)
        np.testing.assert_allclose(found[i, :8], expected, rtol=1e-11, atol=1e-15)


def test_bodies_of_different_structure(
    programs: list[SeriesProgram], monkeypatch: pytest.MonkeyPatch
) -> None:
    # neighbours in no order, and some bodies with their own terms: operands whose places are
    # listed, and operations in no vector
    mixed = random.Random(1)
    other = list(range(BODIES))
    mixed.shuffle(other)

    def force(i: int) -> str:
        own = {0: "sin(x{i}*x{j})", 1: "a{i}*x{j}/(2 + x{i})", 2: "sqrt(2 + x{i})*cos(x{j})"}
        more = f" + exp(x{other[i]})^{i % 5}" if i % 7 == 3 else ""
        lone = f" + x{i}^1.{i}" if i % 31 == 5 else ""
        return (
            f"x{i}*x{other[i]}*cos(x{i})" + " + " + own[i % 3].format(i=i, j=other[i]) + more + lone
        )

    q = [0.2 + 0.005 * i for i in range(BODIES)]
    v = [0.3 - 0.004 * i for i in range(BODIES)]
    found, expected = both(bodies(force), q, v, programs, monkeypatch)
    assert programs[0].convolutions > 0
    assert_alike(found, expected)


def test_mass_matrix_that_varies(
    programs: list[SeriesProgram], monkeypatch: pytest.MonkeyPatch
) -> None:
    text = bodies(lambda i: f"-x{i}").replace(
        "T: ", "T: " + " + ".join(COUPLED.format(i=i, j=i + 1) for i in range(BODIES - 1)) + " + "
    )
    q = [0.2 + 0.005 * i for i in range(BODIES)]
    v = [0.3 - 0.004 * i for i in range(BODIES)]
    found, expected = both(text, q, v, programs, monkeypatch)
    assert_alike(found, expected)


def chain(n: int) -> str:
    """Return a chain of n bodies on rods of length 1."""
    names = [f"{x}{i}" for i in range(1, n + 1) for x in "xy"]
    rods = [f"  rod{i}: (x{i} - x{i - 1})^2 + (y{i} - y{i - 1})^2 = 1" for i in range(2, n + 1)]
    return f"""
coordinates: [{", ".join(names)}]
parameters: {{g: 9.81}}
T: {" + ".join(f"{x}'^2/2" for x in names)}
V: {" + ".join(f"g*y{i}" for i in range(1, n + 1))}
constraints:
  rod1: x1^2 + y1^2 = 1
{chr(10).join(rods)}
initial: {{{", ".join(f"x{i}: {i}, y{i}: 0, x{i}': 0, y{i}': 0" for i in range(1, n + 1))}}}
"""


def test_chain(programs: list[SeriesProgram], monkeypatch: pytest.MonkeyPatch) -> None:
    n = 60
    angle = 0.3 + 0.01 * np.arange(n)
    turn = 0.2 - 0.01 * np.arange(n)
    rods = np.array([np.cos(angle), -np.sin(angle)])
    rates = np.array([-np.sin(angle), -np.cos(angle)]) * turn
    q, v = (np.cumsum(x, axis=1).T.reshape(-1).tolist() for x in (rods, rates))
    found, expected = both(chain(n), q, v, programs, monkeypatch)
    assert_alike(found, expected)
    # families lie side by side without copies; what is in no vector is the first rod's
    assert programs[0].layer < 16 * n
    assert programs[0].convolutions <= 6
    # and the rods keep their lengths
    rods = np.diff(found[: 2 * n].reshape(n, 2, -1), axis=0, prepend=0.0)
    order = rods.shape[2]
    for rod in rods:
        phi = sum(np.convolve(x, x)[:order] for x in rod)
        size = sum(np.convolve(np.abs(x), np.abs(x))[:order] for x in rod)
        assert (np.abs(phi[1:]) <= 1e-11 * size.max()).all()


def test_many_temporaries(programs: list[SeriesProgram], monkeypatch: pytest.MonkeyPatch) -> None:
    """Springs between all bodies: more sums are in use at once than a layer has series.

    Powers of t and constants are used beside them.
    """
    n = 40
    draw = random.Random(1)
    pairs = [(i, j) for i in range(n) for j in range(i)]
    springs = [f"{draw.uniform(0.5, 2.0):.3f}*(x{i} - x{j})^2/{2 * n}" for i, j in pairs]
    text = f"""
coordinates: [{", ".join(f"x{i}" for i in range(n))}]
T: {" + ".join(f"{1 + i / 100}*x{i}'^2/2" for i in range(n))}
V: {" + ".join(springs)}
Q: {{{", ".join(f"x{i}: sin({1 + i / 50}*t) - sin(x{i})" for i in range(n))}}}
initial: {{{", ".join(f"x{i}: 0, x{i}': 0" for i in range(n))}}}
"""
    q, v = ([draw.uniform(-1.0, 1.0) for _ in range(n)] for _ in range(2))
    found, expected = both(text, q, v, programs, monkeypatch)
    assert_alike(found, expected)


@pytest.mark.parametrize("size", [8, 256, 257, 259, 512, 1000, 1025, 5000])
def test_pieces_are_not_too_short(size: int) -> None:
    found = pieces(list(range(size)))
    assert [x for piece in found for x in piece] == list(range(size))
    assert all(min(size, LONGEST // 2) <= len(x) <= LONGEST for x in found)


@pytest.mark.parametrize(
    ("places", "expected"),
    [
        ([7, 9, 11], (7, 2)),
        ([7, 7, 7], (7, 0)),
        ([9, 8], (9, -1)),
        ([4], (4, 1)),
        ([1, 2, 4], (0, INDEXED, 1, 2, 4)),
    ],
)
def test_places_are_written_by_first_and_step_or_one_by_one(
    places: list[int], expected: tuple[int, ...]
) -> None:
    assert tuple(steps(places)) == expected


@pytest.mark.parametrize("seed", range(10))
def test_places_in_use_never_overlap(seed: int) -> None:
    draw = random.Random(seed)
    memory = layers._Temporaries()
    held: list[tuple[int, int]] = []
    used: set[int] = set()
    first = memory.end
    for _ in range(200):
        if held and draw.random() < 0.5:
            at, size = held.pop(draw.randrange(len(held)))
            places = list(range(at, at + size))
            draw.shuffle(places)
            for place in places:  # a vector is free when all its places are
                memory.release(place)
            used.difference_update(places)
        else:
            size = draw.choice((1, 1, 2, 8, 9, 30))
            at = memory.take(size)
            assert size == 1 or at % LINE == 0
            assert used.isdisjoint(range(at, at + size))
            assert first <= at <= at + size <= memory.end
            used.update(range(at, at + size))
            held.append((at, size))


def test_places_are_used_again() -> None:
    memory = layers._Temporaries()
    one, two, single = memory.take(12), memory.take(16), memory.take(1)
    for i in range(12):
        assert memory.take(9) not in (one, two)
        memory.release(one + i)
    memory.release(single)
    assert (memory.take(10), memory.take(1)) == (one, single)
