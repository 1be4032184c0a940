"""Derivatives through actions and impacts at one instant, against differences of runs."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.contract import IntegrationRequest
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate.phases import Phases
from lagcli.engine.lowering import lower
from lagcli.engine.sensitivity.changes import Change, DirectionalSystem
from lagcli.engine.sensitivity.instant_tangent import DifferentiatedResolution
from lagcli.engine.state import State
from lagcli.settings.settings import DEFAULTS

PENDULUM = """
coordinates: [x, y]
parameters: {{g: 10, l: 1, k: 0.7, t1: 0.4}}
T: (x'^2 + y'^2)/2
V: g*y
constraints: {{rod: x^2 + y^2 = l^2}}
events:
  change: {{when: t >= t1, {action}}}
initial: {{x: l, y: 0, x': 0, y': {{guess: 0}}}}
"""
BALL = """
coordinates: [x, y]
parameters: {m: 2, g: 10, e: 0.5}
T: m*(x'^2 + y'^2)/2
V: m*g*y
constraints: {floor: {expr: y >= 0, restitution: e}}
initial: {x: 0, y: 1, x': 3, y': 0}
"""
TWO = """
coordinates: [a, b]
parameters: {J: 2, w: 3, t1: 0.5, c: 0.2}
T: J*a'^2/2 + b'^2/2
V: 0
Q: {a: -c*a'}
constraints: {clutch: {expr: a' = b', active: false}}
events: {close: {when: a >= t1, engage: clutch}}
initial: {a: 0, b: 0, a': w, b': 0}
"""


def checked(text: str, names: tuple[str, ...], allowed: float = 1e-7) -> None:
    model = lagcli.load_text(text)
    options = {"t_end": 0.9, "samples": 4, "rtol": 1e-11}
    found = lagcli.simulate(model, sensitivity=names, **options)  # type: ignore[arg-type]
    assert found.warnings == ()
    for k, name in enumerate(names):
        value, expected = model.parameter_values[name], [0.0, 0.0]
        h = 1e-3 * value
        for step, weight in {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}.items():
            for side in (1, -1):
                other = lagcli.load_text(text, set={name: f"{value + side * step * h!r}"})
                run = lagcli.simulate(other, **options)  # type: ignore[arg-type]
                expected[0] += side * weight / h * run.q
                expected[1] += side * weight / h * run.v
        for x, y in zip((found.dq, found.dv), expected, strict=True):
            assert x is not None
            np.testing.assert_allclose(
                x[:, :, k], y, atol=allowed * np.abs(y).max(initial=1e-3), err_msg=name
            )


@pytest.mark.parametrize(
    "action",
    [
        "impulse: {x: k*x, y: t}",
        "set: {x': -k*x', y': 0}",
        "set: {x: k, g: 3*k*g}",
        "release: rod",
    ],
)
def test_actions_on_a_constraint(action: str) -> None:
    checked(PENDULUM.format(action=action), ("k", "t1", "l"))


def test_engagement_takes_velocities_together() -> None:
    checked(TWO, ("J", "w", "t1", "c"))


def test_impacts_in_sequence_and_at_once() -> None:
    text = """
coordinates: [x, y]
parameters: {m: 2, e: 0.6, u: 1.5, d: 0.5}
T: m*x'^2/2 + y'^2/2
V: 0
constraints:
  hit: {expr: y - x >= 0, restitution: e}
  wall: {expr: y <= d, restitution: e}
initial: {x: 0, y: 0.2, x': u, y': 0}
"""
    checked(text, ("m", "e", "u", "d"))
    # the second body rests at the wall: both contacts take part
    checked(text.replace("y: 0.2", "y: d"), ("e", "u"))


def test_an_impact_changes_velocities_by_its_coefficient() -> None:
    """At the floor, y'⁺ = −e y'⁻: by y'⁻, −e; by e, −y'⁻; by x', nothing."""
    system = lower(lagcli.derive(lagcli.load_text(BALL)))
    p, q, v = (2.0, 10.0, 0.5), np.array([0.0, 1.0]), np.array([3.0, -4.0])
    settings = DEFAULTS.replace(t_end=1.0)
    run = Phases(
        Evaluator(system, p),
        IntegrationRequest(State(0.0, q, v, p), 0, settings, np.zeros(1), 0.0),
    )
    by_e = np.array([[0.0] * 3, [0.0] * 3, [0.0, 1.0, 0.0]])
    dv = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    change = Change(np.zeros(3), np.zeros((2, 3)), dv, by_e)
    at_floor = np.array([0.0, 0.0, *v, 0.0])
    instant = DifferentiatedResolution(run, 0.0, at_floor, DirectionalSystem(system, None), change)
    found = instant.resolve([0], True)
    np.testing.assert_allclose(found.y[2:4], [3.0, 2.0])
    np.testing.assert_allclose(instant.change.v, [[0.0, 0.0, 1.0], [-0.5, 4.0, 0.0]], atol=1e-14)
    assert instant.jumped
    assert instant.reasons == []
