"""Derivatives through random impacts, kinks, sliding and events against differences of runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.trajectory.trajectory import Trajectory

#: Models with {placeholders}, and what they are differentiated by.
KINDS: dict[str, tuple[str, tuple[str, ...]]] = {
    "spinning ball": (
        """
coordinates: [x, y, p]
T: m/2*(x'^2 + y'^2) + m*r^2/5*p'^2
V: m*g*y
Q: {x: -c*x'}
constraints: {f: {expr: y >= 0, restitution: e, friction: mu, slip: x' + r*p'}}
initial: {x: 0, y: h, p: 0, x': u, y': 0, p': w}
""",
        ("e", "mu", "h", "w"),
    ),
    "pendulum at a wall": (
        """
coordinates: [x, y]
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints: {rod: x^2 + y^2 = (h + 0.5)^2, wall: {expr: x >= -d, restitution: e}}
initial: {x: {guess: 0.6}, y: -0.4, x': {guess: 0}, y': 1 + a}
""",
        ("e", "d", "h", "g"),
    ),
    "block on a belt": (
        """
coordinates: [x]
T: m/2*x'^2
V: k*x^2/2
Q: {x: "if(x > d, -F, c)"}
constraints: {b: {expr: x' = 0.3, limit: {static: 1.4*F, kinetic: F}}}
initial: {x: 0, x': u}
""",
        ("F", "k", "u", "m"),
    ),
    "kicks": (
        """
coordinates: [x, y]
T: m/2*(x'^2 + y'^2) + a*m*x'*y'
V: m*g*y + k*max(x - d, 0)^2/2
Q: {x: "-c*abs(x')*x'", y: F*sin(w*t)}
constraints: {f: {expr: y + 0.2*sin(3*x) >= 0, restitution: e}}
events:
  kick: {when: x >= d + 0.1, impulse: {x: -F*m/3, y: m}, times: 2}
  set: {when: t >= a, set: {x': c*x' + 0.5, k: 1.5*k}}
initial: {x: 0, y: h, x': 1 + a, y': 0}
""",
        ("e", "F", "k", "a"),
    ),
    "sliding": (
        """
coordinates: [x, y]
T: m/2*x'^2 + y'^2/2
V: k*(x - y)^2/2
Q: {x: "-F*(2*step(x' + c*x) - 1)", y: "if(y < 0, F, -d*y')"}
initial: {x: h, x': u, y: -a, y': 0}
""",
        ("F", "k", "c", "d"),
    ),
}
RANGES = {
    **{"m": (0.5, 3), "e": (0.1, 0.9), "mu": (0.05, 0.7), "h": (0.3, 1), "u": (-2, 2)},
    **{"w": (-5, 5), "c": (0.1, 1), "F": (1, 6), "k": (20, 80), "d": (0.05, 0.3), "a": (0.1, 0.5)},
}


def happenings(run: Trajectory) -> tuple[Any, ...]:
    return () if run.events is None else (run.events.kinds, run.events.names)


#: Random models, in one of which the differences must not change the number of impacts.
DRAWS = 3


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", KINDS)
def test_central_differences_of_random_runs(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    assert any(_compare_with_differences(kind, rng) for _ in range(DRAWS))


def _compare_with_differences(kind: str, rng: np.random.Generator) -> bool:
    """Compare a random run with differences, unless these change the number of impacts."""
    text, names = KINDS[kind]
    values = {name: float(rng.uniform(*bounds)) for name, bounds in RANGES.items()}
    given = ", ".join(f"{name}: {value!r}" for name, value in values.items())
    text = f"parameters: {{{given}, g: 9.81, r: 0.3}}{text}"
    options: dict[str, Any] = {"rtol": 1e-12, "t_end": float(rng.uniform(0.5, 1.5)), "samples": 5}
    found = lagcli.simulate(lagcli.load_text(text), sensitivity=names, **options)
    assert found.status == "completed", found.message
    assert found.dq is not None
    assert found.dv is not None
    for j, name in enumerate(names):
        value, expected = {**values, "g": 9.81}[name], np.zeros(())
        h = 1e-4 * abs(value)
        for step, weight in {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}.items():
            for side in (1, -1):
                changed = lagcli.load_text(text, set={name: f"{value + side * step * h!r}"})
                run = lagcli.simulate(changed, **options)
                if happenings(run) != happenings(found):
                    return False
                expected = expected + side * weight / h * np.hstack([run.q, run.v])
        own = np.hstack([found.dq[:, :, j], found.dv[:, :, j]])
        if any("infinitely many impacts" in warning for warning in found.warnings):
            own = np.where(np.isnan(own), expected, own)
        scale = max(float(np.abs(expected).max()), 1e-3)
        np.testing.assert_allclose(own, expected, atol=1e-5 * scale, err_msg=name)
    return True
