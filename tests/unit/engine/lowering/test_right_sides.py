"""Right sides of constraints by differentiation of the tape."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import mpmath
import numpy as np
import pytest
from random_cases import seeds
from shipped import PATHS, REPRESENTATIVES

import lagcli
from lagcli.engine.lowering import right_sides
from lagcli.engine.lowering.lower import lower
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.lagrange import derive
from lagcli.model.model import Model

FOUND = Path(__file__).parents[3] / "found"
NAMES = ("x", "y", "z")
#: Models with constraints; large families with few members.
MEMBERS = {"net_rods": {"N": "3"}, "ring100": {"N": "8"}}
FAST = {*REPRESENTATIVES, *MEMBERS, "bennett", "stewart", "whipple_bicycle", "door_two_hinges"}
CONSTRAINED = [
    path
    for path in (*PATHS.values(), *sorted(FOUND.glob("*.yaml")))
    if re.search("constraints:|quaternion", path.read_text(encoding="utf-8"))
]
#: The same as parameters; those that others stand for are slow.
CASES = [
    pytest.param(path, id=path.stem, marks=[] if path.stem in FAST else [pytest.mark.slow])
    for path in CONSTRAINED
]
Function = Callable[[Mapping[str, mpmath.mpf]], mpmath.mpf]
#: Operations as a model file writes them, and as mpmath has them.
OPERATIONS: tuple[tuple[str, Callable[[mpmath.mpf, mpmath.mpf], mpmath.mpf]], ...] = (
    ("({a} + {b})", lambda a, b: a + b),
    ("({a} - 0.6*{b})", lambda a, b: a - mpmath.mpf(0.6) * b),
    ("({a})*({b})", lambda a, b: a * b),
    ("({a})/(2 + ({b})^2)", lambda a, b: a / (2 + b**2)),
    ("sqrt(1.5 + ({a})^2 + ({b})^2)", lambda a, b: mpmath.sqrt(1.5 + a**2 + b**2)),
    ("sin({a})", lambda a, b: mpmath.sin(a)),
    ("cos({a} - {b})", lambda a, b: mpmath.cos(a - b)),
    ("exp(-({a})^2)", lambda a, b: mpmath.exp(-(a**2))),
    ("log(2 + ({a})^2)", lambda a, b: mpmath.log(2 + a**2)),
    ("({a})^3", lambda a, b: a**3),
    ("(1.3 + ({a})^2)^({b})", lambda a, b: (mpmath.mpf(1.3) + a**2) ** b),
    ("atan({a})", lambda a, b: mpmath.atan(a)),
    ("atan2({a}, 2 + ({b})^2)", lambda a, b: mpmath.atan2(a, 2 + b**2)),
    ("tanh({a})", lambda a, b: mpmath.tanh(a)),
)


def system_of(model: Model, monkeypatch: pytest.MonkeyPatch, longer: float) -> System:
    """Return the System with the γ that are so many times as long as φ by differentiation."""
    monkeypatch.setattr(right_sides, "_LONGER", longer)
    return lower(derive(model))


def right_side(system: System, state: list[float], p: list[float]) -> list[float]:
    """Return γ at t, q, v."""
    return ScalarTape(system.dynamics)([*state, *p])[system.dynamics_layout.rhs]


def random_function(draw: random.Random, depth: int) -> tuple[str, Function]:
    """Return a smooth expression in x, y, z, t, a whose roots and logarithms are defined, and its
    value by mpmath."""
    if depth == 0:
        name = draw.choice((*NAMES, *NAMES, "t", "a", "0.7"))
        return name, lambda at: at[name] if name in at else mpmath.mpf(0.7)
    (a, f), (b, g) = (random_function(draw, depth - 1) for _ in range(2))
    text, operation = draw.choice(OPERATIONS)
    return text.format(a=a, b=b), lambda at: operation(f(at), g(at))


def of_constraint(expression: str) -> Model:
    """Return the model of a point on a surface."""
    return lagcli.load_text(
        f"""
coordinates: [x, y, z]
parameters: {{a: 0.4}}
T: (x'^2 + y'^2 + z'^2)/2
V: 0
constraints: {{c: "{expression} = 0.3"}}
initial: {{x: {{guess: 0.5}}, y: 0.5, z: 0.5, x': {{guess: 0}}, y': 0, z': 0}}
"""
    )


def second_rate(function: Function, state: list[float], a: float) -> float:
    """Return φ̈ of x y + a function without accelerations, by differences of 50 digits."""
    t, q, v = state[0], state[1:4], state[4:]

    def path(s: mpmath.mpf) -> mpmath.mpf:
        at = {name: x + s * rate for name, x, rate in zip(NAMES, q, v, strict=True)}
        return at["x"] * at["y"] + function({**at, "t": t + s, "a": mpmath.mpf(a)})

    with mpmath.workdps(50):
        return float(mpmath.diff(path, 0, 2))


@pytest.mark.parametrize("seed", seeds(30, 120))
def test_random_constraints_against_differences_of_many_digits(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw = random.Random(seed)
    expression, function = random_function(draw, 3)
    model = of_constraint(f"x*y + {expression}")
    states = [[draw.uniform(-1, 1) for _ in range(7)] for _ in range(3)]
    for longer in (0.0, 1e9):
        system = system_of(model, monkeypatch, longer)
        for state in states:
            expected = -second_rate(function, state, 0.4)
            assert right_side(system, state, [0.4]) == [
                pytest.approx(expected, rel=1e-10, abs=1e-11)
            ]


@pytest.mark.parametrize("path", CASES)
def test_every_model_has_the_right_sides_that_are_written(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = lagcli.load(path, set=MEMBERS.get(path.stem))
    found, written = (system_of(model, monkeypatch, longer) for longer in (0.0, 1e9))
    assert found.constraints
    p = list(model.parameter_values.values())
    draw = np.random.default_rng(7)
    for _ in range(5):
        state = [draw.uniform(0, 1), *draw.uniform(-1, 1, 2 * len(found.coordinates))]
        expected = np.array(right_side(written, state, p))
        size = np.abs(expected[np.isfinite(expected)]).max(initial=1.0)
        np.testing.assert_allclose(
            right_side(found, state, p), expected, rtol=1e-10, atol=1e-11 * size
        )


def jacobians_at(system: System, inputs: list[float]) -> list[np.ndarray]:
    """Return the derivatives of Γ with respect to q and v as matrices, and to t."""
    assert system.variation is not None
    found = system.variation()
    values = ScalarTape(found.tape)(inputs)
    nq, nc = system.counts.nq, system.counts.nc
    first, blocks = len(found.force_position) + len(found.force_velocity), []
    for pattern in (found.rhs_position, found.rhs_velocity):
        block = np.zeros((nc, nq))
        for place, value in zip(pattern, values[first:], strict=False):
            block[place] = value
        blocks.append(block)
        first += len(pattern)
    return [*blocks, np.array(values[len(values) - 1 - nc : -1])]


@pytest.mark.parametrize("path", CASES)
def test_every_model_has_the_gradients_that_are_written(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = lagcli.load(path, set=MEMBERS.get(path.stem))
    p = list(model.parameter_values.values())
    results = []
    for longer in (0.0, 1e9):
        system = system_of(model, monkeypatch, longer)
        state = np.random.default_rng(7).uniform(
            -1, 1, 1 + 3 * system.counts.nq + len(system.constraints)
        )
        results.append(jacobians_at(system, [*state, *p]))
    for found, written in zip(*results, strict=True):
        size = np.abs(written[np.isfinite(written)]).max(initial=1.0)
        np.testing.assert_allclose(found, written, rtol=1e-9, atol=1e-11 * size)


@pytest.mark.parametrize("seed", range(40))
def test_gradients_of_random_constraints_against_differences(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw = random.Random(1000 + seed)
    expression, _ = random_function(draw, 3)
    system = system_of(of_constraint(f"x*y + {expression}"), monkeypatch, 0.0)
    state = np.array([draw.uniform(-1, 1) for _ in range(7)])
    a = [draw.uniform(-1, 1) for _ in range(3)]
    by_position, by_velocity, by_time = jacobians_at(system, [*state, *a, 0.7, 0.4])
    h = 1e-5

    def gamma(state: np.ndarray) -> float:
        values = ScalarTape(system.dynamics)([*state, 0.4])
        row = dict.fromkeys(range(3), 0.0)
        layout = system.dynamics_layout
        for (_, j), b in zip(system.jacobian_pattern, values[layout.jacobian], strict=True):
            row[j] = b
        return values[layout.rhs][0] - sum(b * a[j] for j, b in row.items())

    slopes = [(gamma(state + h * e) - gamma(state - h * e)) / (2 * h) for e in np.eye(7)]
    found = [by_time[0], *by_position[0], *by_velocity[0]]
    np.testing.assert_allclose(found, slopes, rtol=1e-6, atol=1e-6 * np.abs(slopes).max())


def test_only_what_is_long_is_differentiated() -> None:
    def operations(path: Path) -> int:
        return len(lower(derive(lagcli.load(path))).dynamics.code)

    assert operations(FOUND / "stewart.yaml") < 1100  # 6934 as they are written
    assert operations(FOUND / "bricard_a04.yaml") < 1600  # 2637
    assert operations(PATHS["chain"]) == 314  # the same


def test_kinks_stay_with_their_branches() -> None:
    model = lagcli.load_text(
        """
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 0
constraints: {c: "sqrt(1 + x^2)*sqrt(1 + y^2)*abs(x + y)*exp(x*y) + x = 3"}
initial: {x: {guess: 1}, y: 1, x': {guess: 0}, y': 0}
"""
    )
    assert not right_sides.long_constraints(derive(model))
