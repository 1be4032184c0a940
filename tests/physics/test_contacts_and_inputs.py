"""Contacts, friction and events together with inputs from tables: closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.settings.settings import SettingsOverrides
from lagcli.trajectory.event_log import EventLog
from lagcli.trajectory.trajectory import Trajectory

PULLED = """
coordinates: {x: m}
parameters: {m: 1 kg, g: 10 m/s^2, mu: 0.5, F_h: 8 N, c: 0.1 s/kg}
T: m/2*x'^2
Q: {x: pull}
inputs:
  pull: {times: [0, 1, 2], values: [0 N, 10 N, 0 N], interpolation: linear, extend: hold}
constraints:
  ground: {expr: x' = 0, limit: mu*m*g}
events:
  high: {when: pull >= F_h, set: {x': x' + c*pull}, times: 1}
initial: {x: 0, x': 0}
simulation: {t_end: 4, samples: 41}
"""

RISING = """
coordinates: {y: m}
parameters: {m: 2 kg, g: 10 m/s^2, e: 0.5}
T: m/2*y'^2
V: m*g*y
inputs:
  table: {times: [0, 1, 2, 3], values: [0 m, 0.5 m, 1 m, 1.5 m], interpolation: cubic}
constraints:
  floor: {expr: y >= table, restitution: e}
initial: {y: 1, y': 0}
simulation: {t_end: 2.9, samples: 30}
"""


def run(text: str) -> tuple[Trajectory, EventLog]:
    settings = SettingsOverrides(rtol=1e-11)
    found = lagcli.simulate(lagcli.load_text(text), settings)
    assert found.status == "completed"
    assert found.events is not None
    assert np.abs(found.energy_balance).max() < 1e-9 * np.abs(found.energy_total).max()
    return found, found.events


def test_a_block_that_is_pulled_slips_and_sticks_again() -> None:
    """It slips at 10 t = μ m g, with v' = 10 t − 5 up to the knot and 15 − 10 t beyond it."""
    text = PULLED[: PULLED.index("events:")] + PULLED[PULLED.index("initial:") :]
    found, log = run(text)
    assert log.kinds == ("slips", "sticks")
    # v(2) = 1.25 m/s, and friction alone is left from there on
    np.testing.assert_allclose(log.time, [0.5, 2.25], rtol=1e-9)
    t = found.time
    rising, falling = (t > 0.5) & (t <= 1), (t > 1) & (t <= 2)
    np.testing.assert_allclose(found.v[rising, 0], 5 * (t[rising] - 0.5) ** 2, atol=1e-9)
    v = 1.25 + 15 * (t[falling] - 1) - 5 * (t[falling] ** 2 - 1)
    np.testing.assert_allclose(found.v[falling, 0], v, atol=1e-9)
    np.testing.assert_allclose(found.multipliers[t < 0.5, 0], -10 * t[t < 0.5], atol=1e-9)


def test_events_see_inputs_in_conditions_and_actions() -> None:
    """At 8 N, t = 0.8 s, the velocity gains 0.8 m/s."""
    _, log = run(PULLED)
    (high,) = (i for i, name in enumerate(log.names) if name == "high")
    assert log.time[high] == pytest.approx(0.8, abs=1e-9)
    before, after = log.before[high, 0], log.after[high, 0]
    assert before == pytest.approx(5 * 0.3**2, abs=1e-9)
    assert after - before == pytest.approx(0.8, abs=1e-9)
    # v(2) = 2.05 m/s, which friction alone takes
    assert log.time[-1] == pytest.approx(2 + 2.05 / 5, abs=1e-9)
    assert log.kinds[-1] == "sticks"


def test_limits_may_be_inputs() -> None:
    """A force of 4 N meets a limit of pull: it slips up to 0.4 s, and from 1.6 s on."""
    text = PULLED[: PULLED.index("events:")] + PULLED[PULLED.index("initial:") :]
    text = text.replace("Q: {x: pull}", "Q: {x: F_h/2}").replace("mu*m*g", "pull")
    found, log = run(text.replace("t_end: 4", "t_end: 2"))
    # v' = 4 − 10 t: from 0 up and back to 0 at t = 0.8, where the limit of 8 N holds it
    assert log.kinds == ("sticks", "slips")
    np.testing.assert_allclose(log.time, [0.8, 1.6], rtol=1e-9)
    assert found.q[-1, 0] == pytest.approx(4 * 0.8**2 / 2 - 10 * 0.8**3 / 6 + 10 * 0.4**3 / 6)


def test_a_ball_on_a_floor_that_rises() -> None:
    """1 − 5 t² = t/2 at t = 0.4; relative to the floor, it bounces as on one at rest."""
    found, log = run(RISING)
    impacts = log.time[[kind == "impact" for kind in log.kinds]]
    flights = 2 * 4.5 * 0.5 ** np.arange(1, 4) / 10
    np.testing.assert_allclose(impacts[:4], 0.4 + np.append(0, np.cumsum(flights)), rtol=1e-9)
    first = log.kinds.index("impact")
    assert log.before[first, 0] == pytest.approx(-4)
    assert log.after[first, 0] == pytest.approx(0.5 + 2.25)
    # it rests on the floor and rises with it
    assert found.q[-1, 0] == pytest.approx(0.5 * found.time[-1])
    assert found.v[-1, 0] == pytest.approx(0.5)
    assert found.multipliers[-1, 0] == pytest.approx(20)
