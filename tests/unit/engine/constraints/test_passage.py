"""Passages: through a singular configuration on the branch that the motion was on."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lowered import lowered
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import lagcli
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.constraints.passage import Crossing
from lagcli.engine.constraints.projection import Projection
from lagcli.engine.contract import Stop
from lagcli.engine.evaluator import Evaluator

G = 9.81
SYSTEM, P = lowered(
    lagcli.load_text(f"""
coordinates: [phi, psi]
T: (phi'^2 + psi'^2)/2
V: 2*{G}*sin(phi)
constraints: {{guide: sin(phi) = sin(psi)}}
initial: {{phi: 0.5, phi': 6, psi: {{guess: 0.5}}, psi': {{guess: 6}}}}
""")
)
#: phi'' = −2 g cos phi + λ cos phi and psi'' = −λ cos psi: both are one pendulum, with λ = g.
EXACT = solve_ivp(
    lambda t, y: [y[1], -G * math.cos(y[0])],
    (0.0, 0.6),
    [0.5, 6.0],
    method="DOP853",
    rtol=1e-13,
    atol=1e-13,
    dense_output=True,
).sol
SINGULAR = brentq(lambda t: EXACT(t)[0] - math.pi / 2, 0.0, 0.6, xtol=1e-15)


def motion() -> Index1:
    found = Index1(Evaluator(SYSTEM, P), 1)
    found.measure(0.0, np.full(2, 0.5), np.full(2, 6.0))
    return found


def y(t: float) -> np.ndarray:
    angle, speed = EXACT(t)
    return np.array([angle, angle, speed, speed, 0.0])


def guess(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a continuation at a constant speed."""
    angle, speed = EXACT(SINGULAR)
    return np.full(2, angle + speed * (t - SINGULAR)), np.full(2, speed)


BEFORE = [(t, y(t)) for t in SINGULAR - np.array([0.012, 0.008, 0.006, 0.004])]


def test_the_motion_continues_as_one_pendulum() -> None:
    found = motion()
    crossing = Crossing(found, Projection(found.evaluator, 1), BEFORE, SINGULAR, guess)
    assert crossing.end == pytest.approx(SINGULAR + 0.004)
    np.testing.assert_allclose(crossing.state, y(crossing.end), rtol=0, atol=1e-9)
    for t in (SINGULAR - 0.002, SINGULAR, SINGULAR + 0.003):
        q, v, a, multipliers, work = crossing(t)
        np.testing.assert_allclose([*q, *v, work], y(t), rtol=0, atol=1e-9)
        np.testing.assert_allclose(a, -G * math.cos(EXACT(t)[0]), rtol=0, atol=1e-6)
        np.testing.assert_allclose(multipliers, [G], rtol=1e-6)


def test_where_states_beyond_do_not_settle_there_is_no_continuation() -> None:
    found = motion()
    calls = [0]

    def restless(t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        calls[0] += 1
        return q + 0.01 * math.sin(calls[0]), v

    with pytest.raises(Stop, match="cannot be continued through the singular configuration"):
        Crossing(found, restless, BEFORE, SINGULAR, guess)


def test_states_without_accelerations_end_it() -> None:
    found = motion()

    def lost(t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return q * math.nan, v

    with pytest.raises(Stop, match=f"at t = {SINGULAR:.9g} s; try a smaller --rtol"):
        Crossing(found, lost, BEFORE, SINGULAR, guess)
