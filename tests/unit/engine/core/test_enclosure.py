"""Enclosures of watched functions along a step: against polynomials of time.

The forces are polynomials of time, of which all methods integrate the motion exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb, factorial
from typing import NamedTuple

import numpy as np
import pytest
from core_parts import enclosed
from numpy.polynomial import Polynomial
from scipy.interpolate import BPoly

import lagcli
from lagcli.arrays import Array
from lagcli.engine.core.switching import SwitchingIntegrator

METHODS = ("DOP853", "Taylor", "Radau", "Rodas5P")
#: The part of the width by which enclosures between the ends of a step are wider: enclosure.c.
WIDER = 0.1
MODEL = """\
coordinates: [x, y, z]
T: (x'^2 + y'^2 + z'^2)/2
Q: {{x: "{x}", y: "if(x < 50, {y}, 0)", z: 0.5}}
{rows}
initial: {{x: 1, x': {v!r}, y: 0.5, y': 1, z: 0, z': 100}}
events:
  a: {{when: x >= 100}}
  b: {{when: "x' <= -100"}}
  c: {{when: "2*x - 3*y' + 0.5*t <= -200"}}
  d: {{when: "x*y' <= -300"}}
  e: {{when: "t^2 - t >= 50"}}
  f: {{when: y >= 100}}
  g: {{when: "y' <= -100"}}
simulation: {{t_end: 2, samples: 2}}
"""
ROWS = """\
constraints:
  floor: {expr: x + 0.3*y >= -1e3, restitution: 0}
  slides: {expr: "z' = 0.1*x'", limit: 0.5}
"""


@pytest.fixture
def cores(monkeypatch: pytest.MonkeyPatch) -> list[SwitchingIntegrator]:
    """The cores of the runs, as they are made."""
    made: list[SwitchingIntegrator] = []
    original = SwitchingIntegrator.__init__

    def kept(self: SwitchingIntegrator, *arguments: object, **named: object) -> None:
        original(self, *arguments, **named)  # type: ignore[arg-type]
        made.append(self)

    monkeypatch.setattr(SwitchingIntegrator, "__init__", kept)
    return made


def control_points(p: Polynomial, low: float, length: float, degree: int) -> Array:
    """Return the coefficients of Bernstein's polynomials on a step."""
    c = p(Polynomial([low, length])).coef
    weights = ((comb(i, m) / comb(degree, m) for m in range(i + 1)) for i in range(degree + 1))
    return np.array([sum(w * x for w, x in zip(row, c, strict=False)) for row in weights])


def widened(*points: Array) -> Array:
    every = np.concatenate(points)
    margin = WIDER * np.ptp(every)
    return np.array([every.min() - margin, every.max() + margin])


def written(p: Polynomial) -> str:
    return " + ".join(f"({c!r})*t^{k}" for k, c in enumerate(p.coef.tolist()))


def motions(rng: np.random.Generator, rows: bool, degree: int) -> tuple[str, list[Polynomial]]:
    """Return a model with a force of a degree, and x, y and z as functions of time."""
    x, y = Polynomial(rng.uniform(-3, 3, degree + 1)), Polynomial(rng.uniform(-3, 3, 2))
    v, turns = float(rng.uniform(-2, 2)), float(rng.uniform(1.6, 2.0))
    if rng.random() < 0.5:  # x or x' has an extremum, often in the last step
        v = -float(x.integ()(turns))
    else:
        x = x - x(turns)
    text = MODEL.format(x=written(x), y=written(y), v=v, rows=ROWS if rows else "")
    # friction slows z' = 100 by 0.5 and takes x along
    drag, push = (0.05, 0.0) if rows else (0.0, 0.5)
    return text, [
        (x + drag).integ(2, k=[v, 1.0]),
        y.integ(2, k=[1.0, 0.5]),
        Polynomial([push]).integ(2, k=[100.0, 0.0]),
    ]


class Watched(NamedTuple):
    """A watched function of time, and the terms that intervals add, if it is a sum of such."""

    function: Polynomial
    terms: tuple[Polynomial, ...] = ()


def functions(x: Polynomial, y: Polynomial, z: Polynomial, rows: bool) -> list[Watched | None]:
    """Return the watched functions in their order; None: not enclosed."""
    t = Polynomial([0.0, 1.0])
    u, v, w = (p.deriv() for p in (x, y, z))
    of_rows = [Watched(x + 0.3 * y + 1e3, (x, 0.3 * y)), Watched(w - 0.1 * u, (w, 0.1 * u)), None]
    return [
        *(of_rows if rows else []),
        Watched(50 - x, (x,)),
        Watched(100 - x, (x,)),
        Watched(u + 100, (u,)),
        Watched(2 * x - 3 * v + 0.5 * t + 200, (2 * x, 3 * v, 0.5 * t)),
        Watched(x * v + 300),
        Watched(50 + t - t**2, (t, t**2)),
        Watched(100 - y, (y,)),
        Watched(v + 100, (v,)),
    ]


def over(p: Polynomial, low: float, length: float) -> Array:
    """Return the bounds of a coordinate and of its velocity over a step, (2, 2)."""
    v = p.deriv()
    of_v = (control_points(v, low, length, k) for k in (3, 4))
    return np.array([widened(control_points(p, low, length, 5)), widened(*of_v)])


def size(terms: Sequence[Polynomial], m: int, t: Array) -> float:
    """Return the sum of the ranges of Taylor coefficients."""
    return sum(float(np.ptp((p.deriv(m) if m else p)(t))) for p in terms) / factorial(m)


@pytest.mark.parametrize("method", METHODS)
def test_enclosures(method: str, cores: list[SwitchingIntegrator]) -> None:
    """They contain the function, and are no wider than a sum of intervals."""
    rng = np.random.default_rng(METHODS.index(method))
    explicit = method in ("DOP853", "Taylor")
    for rows in (False, True)[: 1 + (method == "DOP853")] * (9 if method == "DOP853" else 3):
        text, (x, y, z) = motions(rng, rows, 2 if explicit else 1)
        run = lagcli.simulate(lagcli.load_text(text), method=method, rtol=1e-10)
        assert run.q[-1] == pytest.approx([p(2.0) for p in (x, y, z)], abs=1e-9)
        core, watched = cores[-1]._run, functions(x, y, z, rows)
        for k, of in enumerate(watched):
            if of is None:
                continue
            width = float(rng.choice([1.0, 1e-2, 1e-4]))
            a = float(rng.choice([0.0, 1.0 - width, rng.uniform(0.0, 1.0 - width)]))
            found = enclosed(core, k, a, a + width, 4)
            low, length = found.start, found.length
            t = low + length * np.linspace(0, 1, 200)
            assert found.over[0] <= of.function(t).min() + 1e-9
            assert found.over[1] >= of.function(t).max() - 1e-9
            t = low + length * np.linspace(a, a + width, 200)
            for m, bounds in enumerate(found.jet):
                values = (of.function.deriv(m) if m else of.function)(t) / factorial(m)
                # rounding of the step's states over its length to this power
                slack = 1e-8 / length**m
                assert bounds[0] <= values.min() + slack
                assert bounds[1] >= values.max() - slack
                if width < 1.0 and of.terms:
                    assert np.ptp(bounds) <= 1.1 * size(of.terms, m, t) + slack
        if method == "DOP853":
            of_x, of_y = over(x, low, length), over(y, low, length)
            for k, expected in (
                (-7, 100 - of_x[0][::-1]),
                (-6, 100 + of_x[1]),
                (-2, 100 - of_y[0][::-1]),
                (-1, 100 + of_y[1]),
            ):
                bounds = enclosed(core, len(watched) + k, 0.0, 1.0, 0).over
                np.testing.assert_allclose(bounds, expected, rtol=0, atol=1e-8)


def test_enclosures_of_velocities_of_degree_4(cores: list[SwitchingIntegrator]) -> None:
    """Radau's dense output has this degree."""
    rng = np.random.default_rng(8)
    for _ in range(9):
        force = Polynomial(rng.uniform(-3, 3, 4))
        text = f"""\
coordinates: [x]
T: x'^2/2
Q: {{x: "{written(force)}"}}
initial: {{x: 1, x': 2}}
events: {{a: {{when: "x' >= 100"}}}}
simulation: {{t_end: 2, samples: 2}}
"""
        lagcli.simulate(lagcli.load_text(text), method="Radau", rtol=1e-6)
        a, b = np.sort(rng.uniform(0, 1, 2)).tolist()
        found = enclosed(cores[-1]._run, 0, a, b, 4)
        t = found.start + found.length * np.linspace(a, b, 200)
        for m, bounds in enumerate(found.jet):
            values = (100 - force.integ(k=[2.0])).deriv(m)(t) / factorial(m)
            slack = 1e-9 / found.length**m
            assert bounds[0] - slack <= values.min() <= values.max() <= bounds[1] + slack
            if m == 4:
                assert bounds == pytest.approx(values[[0, 0]], abs=slack)


def test_over_a_step_states_are_between_interpolants_of_its_ends(
    cores: list[SwitchingIntegrator],
) -> None:
    """Hermite's polynomials of x = c (t - turn)^7 and of its velocity, which neither of them is."""
    rng = np.random.default_rng(2)
    beyond = np.zeros(2)
    for k in range(12):
        size, turn = rng.uniform([0.5, 1.68], [2.0, 1.85]).tolist()
        x = (-1) ** k * size * Polynomial([-turn, 1.0]) ** 7
        v, a = x.deriv(), x.deriv(2)
        model = lagcli.load_text(
            f"coordinates: [x]\nT: x'^2/2\nQ: {{x: {written(a)}}}\n"
            f"initial: {{x: {float(x(0.0))}, x': {float(v(0.0))}}}\n"
            "events: {a: {when: x >= 1000}, b: {when: x' <= -1000}}\n"
        )
        lagcli.simulate(model, method="DOP853", rtol=1e-2, t_end=2, samples=2)
        found = enclosed(cores[-1]._run, 0, 0.0, 1.0, 0)
        ends = np.array([found.start, found.start + found.length])
        of_x = BPoly.from_derivatives(ends, np.stack([x(ends), v(ends), a(ends)], axis=1))
        of_v = BPoly.from_derivatives(ends, np.stack([v(ends), a(ends)], axis=1))
        cubic, slopes = of_v.c.ravel(), of_x.derivative().c.ravel()
        bounds = enclosed(cores[-1]._run, 1, 0.0, 1.0, 0).over
        for found_bounds, expected in (
            (1000 - found.over[::-1], widened(of_x.c.ravel())),
            (bounds - 1000, widened(slopes, cubic)),
        ):
            np.testing.assert_allclose(found_bounds, expected, rtol=0, atol=1e-6 * size)
        beyond += [slopes.min() < cubic.min() - 1e-4, slopes.max() > cubic.max() + 1e-4]
    assert beyond.min() > 0
