"""Derivatives of the times of instants, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.contract import IntegrationRequest
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate.phases import Phases
from lagcli.engine.lowering import lower
from lagcli.engine.sensitivity.changes import Change, DirectionalSystem, PerturbedState
from lagcli.engine.sensitivity.triggers import instant_time
from lagcli.engine.state import State
from lagcli.settings.settings import DEFAULTS

HEADER = """
coordinates: [x, y]
parameters: {m: 2, F: 6, s: 0.5, mu: 0.4, g: 10}
T: m*(x'^2 + y'^2)/2
V: m*g*y
"""


@pytest.mark.parametrize(
    ("rest", "time", "slopes"),
    [
        # x = F t²/(2 m) reaches s
        (
            "Q: {x: F}\nevents: {e: {when: x >= s, record: x}}\n"
            "initial: {x: 0, y: 0, x': 0, y': 0}",
            (2 * 2 * 0.5 / 6) ** 0.5,
            {"F": -0.5 / 6, "s": 0.5 / 0.5, "m": 0.5 / 2},
        ),
        # a = F t/m reaches s
        (
            "Q: {x: F*t}\nevents: {e: {when: \"x'' >= s\", stop: true}}\n"
            "initial: {x: 0, y: 0, x': 0, y': 0}",
            0.5 * 2 / 6,
            {"F": -1 / 6, "s": 1 / 0.5, "m": 1 / 2},
        ),
        # the floor bears m g − F t
        (
            "Q: {y: F*t}\nconstraints: {floor: y >= 0}\ninitial: {x: 0, y: 0, x': 0, y': 0}",
            2 * 10 / 6,
            {"F": -1 / 6, "g": 1 / 10, "m": 1 / 2},
        ),
        # sticks until F t = μ m g
        (
            "Q: {x: F*t}\nconstraints: {floor: {expr: y >= 0, friction: mu, slip: x'}}\n"
            "initial: {x: 0, y: 0, x': 0, y': 0}",
            0.4 * 2 * 10 / 6,
            {"F": -1 / 6, "g": 1 / 10, "m": 1 / 2, "mu": 1 / 0.4},
        ),
    ],
)
def test_times_in_closed_form(rest: str, time: float, slopes: dict[str, float]) -> None:
    found = lagcli.simulate(
        lagcli.load_text(HEADER + rest), t_end=4, samples=3, sensitivity=tuple(slopes)
    )
    assert found.events is not None
    assert found.events.time[0] == pytest.approx(time, rel=1e-9)
    expected = [time * x for x in slopes.values()]
    np.testing.assert_allclose(found.events.dtime[0], expected, rtol=1e-7)


def test_two_functions_that_always_vanish_together_are_no_conflict() -> None:
    found = lagcli.simulate(
        lagcli.load_text(
            HEADER + "constraints: {floor: {expr: y >= 0, restitution: 0.5}}\n"
            "events: {hit: {when: y <= 0, set: {x': 2*x'}}}\n"
            "initial: {x: 0, y: 1, x': 1, y': 0}"
        ),
        t_end=0.6,
        samples=2,
        sensitivity=("y", "g"),
    )
    assert found.warnings == ()
    assert found.events is not None
    fall = (2 / 10) ** 0.5
    np.testing.assert_allclose(found.events.dtime, [[fall / 2, -fall / 20]] * 2, rtol=1e-8)


@pytest.mark.parametrize(("rate", "reason"), [(-2.0, ""), (0.0, "`floor` is only touched")])
def test_a_gap_that_does_not_close_has_no_time(rate: float, reason: str) -> None:
    text = HEADER + "constraints: {floor: y >= 0}\ninitial: {x: 0, y: 1, x': 0, y': 0}"
    system = lower(lagcli.derive(lagcli.load_text(text)))
    p, q, v = (2.0, 6.0, 0.5, 0.4, 10.0), np.array([0.0, 1.0]), np.array([3.0, rate])
    settings = DEFAULTS.replace(t_end=1.0)
    request = IntegrationRequest(State(0.0, q, v, p), 0, settings, np.zeros(1), 0.0)
    run = Phases(Evaluator(system, p), request)
    change = Change(np.zeros(2), np.array([[0, 0], [1.0, 0]]), np.zeros((2, 2)), np.zeros((5, 2)))
    at = PerturbedState(DirectionalSystem(run.system, None), run.motion, 0.0, q, v, change)
    found = instant_time(at, run, [0], 1.0)
    assert found.reason.startswith(reason)
    expected = [0.5, 0.0] if rate else [np.nan, 0.0]
    np.testing.assert_array_equal(found.change, expected)


def test_forces_that_are_shared_have_no_time() -> None:
    text = """
coordinates: [x, y, phi]
parameters: {m: 2, g: 10, F: 8, mu: 0.3, a: 0.2}
T: m*(x'^2 + y'^2)/2 + phi'^2/2
V: m*g*y
Q: {x: F*t}
constraints:
  left: {expr: y - a*phi >= 0, friction: {static: 1.3*mu, kinetic: mu}, slip: x'}
  right: {expr: y + a*phi >= 0, friction: {static: 1.3*mu, kinetic: mu}, slip: x'}
initial: {x: 0, y: 0, phi: 0, x': 0, y': 0, phi': 0}
"""
    found = lagcli.simulate(lagcli.load_text(text), t_end=1.2, samples=5, sensitivity=("F", "a"))
    (note,) = found.warnings
    # 1.3 μ m g = F t
    assert "derivatives by `F`, `a` end at t = 0.975" in note
    assert "`left.slip` shares its force with others" in note
    assert found.dmultipliers is not None
    # each bears half of m g; which corner bears the friction is open
    np.testing.assert_allclose(found.dmultipliers[2, [0, 2]], 0.0, atol=1e-12)
    assert np.isnan(found.dmultipliers[2, [1, 3], 0]).all()
