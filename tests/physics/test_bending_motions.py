"""Events of states that bend within long steps: polynomials of time, whose roots are known.

The forces are polynomials of time, so that steps are as long as their errors allow; functions of
positions and of velocities then have minima inside a step that the ends of the step do not show.
"""

from __future__ import annotations

import numpy as np
import pytest
from known_events import METHODS
from numpy.polynomial import Polynomial

import lagcli

#: How far a level is beyond a minimum, relative to the range of the function.
BEYOND = (1e-2, 1e-5, 1e-8)


def written(p: Polynomial) -> str:
    """Return a polynomial of t as an expression, by Horner's rule."""
    first, *others = p.coef[::-1].tolist()
    text = repr(first)
    for c in others:
        text = f"({text}*t + {c!r})"
    return text


def roots_of(p: Polynomial, end: float) -> list[float]:
    """Return where a polynomial without multiple roots is zero between 0 and a time."""
    found = p.roots()
    return sorted(float(x.real) for x in found[np.abs(found.imag) < 1e-13] if 0 < x.real < end)


def falls(p: Polynomial, roots: list[float]) -> list[float]:
    return [x for x in roots if p.deriv()(x) < 0]


def bends(rng: np.random.Generator, degree: int, end: float) -> tuple[Polynomial, list[float]]:
    """Return a polynomial on [0, end] and its values at minima inside."""
    while True:
        turns = rng.uniform(0.05, 0.95, degree - 1) * end
        p = Polynomial.fromroots(turns).integ()
        p = p * (rng.choice([-1, 1]) / np.ptp(p(np.linspace(0, end, 500))))
        # roots next to each other belong to one flat minimum
        if np.diff(np.sort(turns)).min(initial=end) > 0.1 * end:
            return p, [float(p(x)) for x in turns if p.deriv(2)(x) > 0]


MODEL = """\
coordinates: [x]
T: x'^2/2
Q: {{x: "{force}"}}
initial: {{x: {x!r}, x': {v!r}}}
events:
  below: {{when: "{what} <= {level!r}"}}
  through: {{when: "{what} = {level!r}"}}
"""


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("order", [0, 1])
def test_minima_inside_steps(order: int, method: str) -> None:
    """Of a position (order 0) and of a velocity, just above a level and just below it."""
    rng = np.random.default_rng(100 * METHODS.index(method) + order)
    expected = 0
    for k in range(9):
        end = float(rng.choice([0.01, 1.0, 50.0]))
        function, minima = bends(rng, int(rng.integers(2, 5)), end)
        if not minima:
            continue
        for beyond in (BEYOND[k % 3], -BEYOND[k % 3]):
            level = float(rng.choice(minima)) + beyond
            x = function if order == 0 else function.integ()
            model = lagcli.load_text(
                MODEL.format(
                    force=written(x.deriv(2)),
                    x=float(x(0.0)),
                    v=float(x.deriv()(0.0)),
                    what="x" if order == 0 else "x'",
                    level=level,
                )
            )
            found = lagcli.simulate(model, method=method, t_end=end, samples=2, rtol=1e-11)
            assert found.status == "completed", found.message
            assert found.events is not None
            roots = roots_of(function - level, end)
            # the error of the motion over the slope
            slack = 1e-3 * end if abs(beyond) < 1e-6 else 1e-5 * end
            for name, times in (("through", roots), ("below", falls(function - level, roots))):
                instants = found.events.instants(name, "event")
                assert len(instants) == len(times), (name, function, level)
                np.testing.assert_allclose(instants, times, rtol=0, atol=slack)
            expected += len(roots)
    assert expected > 12


FLOOR = """\
coordinates: [x, y]
T: (x'^2 + y'^2)/2
Q: {{x: "{force}"}}
constraints:
  floor: {{expr: "x + {tilt!r}*y >= {level!r}", restitution: 0.5}}
initial: {{x: {x!r}, y: 0, x': {v!r}, y': 0}}
"""


@pytest.mark.parametrize("method", METHODS)
def test_the_first_impact_of_a_gap_that_bends(method: str) -> None:
    rng = np.random.default_rng(50 + METHODS.index(method))
    hits = 0
    for k in range(8):
        end = float(rng.choice([0.01, 1.0, 50.0]))
        p, minima = bends(rng, int(rng.integers(2, 5)), end)
        level = float(min([*minima, p(0.0) - 1.0])) + BEYOND[k % 2] * (-1) ** (k // 2)
        if p(0.0) - level < 0.01:
            continue
        model = lagcli.load_text(
            FLOOR.format(
                force=written(p.deriv(2)),
                x=float(p(0.0)),
                v=float(p.deriv()(0.0)),
                level=level,
                tilt=float(rng.uniform(-1, 1)),
            )
        )
        found = lagcli.simulate(model, method=method, t_end=end, samples=2, rtol=1e-11)
        assert found.events is not None
        impacts = found.events.instants("floor", "impact")
        roots = roots_of(p - level, end)
        assert (len(impacts) > 0) == bool(roots), (p, level)
        if roots:
            assert impacts[0] == pytest.approx(roots[0], abs=1e-5 * end)
            hits += 1
    assert hits
