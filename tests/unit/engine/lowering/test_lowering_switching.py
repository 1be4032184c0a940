"""What of a model file reaches the engine: rows, limits, impacts, conditions and actions."""

from __future__ import annotations

import pytest

from lagcli.engine.lowering.lower import lower
from lagcli.engine.lowering.switching import lower_switching
from lagcli.engine.switching.switching import SwitchedRow, Switching, TimeIn
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.lagrange import derive
from lagcli.model.loader import load_text

DISC = """
coordinates: {x: m, y: m, phi: rad}
parameters: {m: 2 kg, r: 0.5 m, g: 9.81 m/s^2, mu: 0.3, e: 0.6, c: 0.1, F: 4 N}
T: m/2*(x'^2 + y'^2) + m*r^2/4*phi'^2
V: m*g*y
Q: {x: -c*abs(lambda.floor), phi: -r*c*abs(lambda.guide)}
constraints:
  floor: {expr: y >= r, restitution: e, friction: {static: 2*mu, kinetic: mu}, slip: x' - r*phi'}
  roof: 2*r >= y
  guide: {expr: phi = 2*t, friction: mu, slip: x'}
  belt: {expr: x' = 1, limit: F + mu*abs(lambda.roof), active: false}
events:
  late: {when: t >= 2, engage: belt}
  push: {when: x' >= 3 and not (y > 4*r or x <= 0), set: {x': y' + x, c: 2*c}, impulse: {y: m}}
  turn: {when: x' = 0, record: [x, phi', lambda.floor.slip], times: 3}
  heavy: {when: lambda.floor > 50, stop: true, release: guide}
  hit: {when: floor impacts, record: true}
  free: {when: floor slips, record: true}
initial: {x: 0, y: r, phi: 0, x': 0, y': 0, phi': 2}
"""

#: t; q; v; a; λ of floor, floor.slip, roof, guide, guide.slip, belt; m, r, g, mu, e, c, F
ROWS = ("floor", "floor.slip", "roof", "guide", "guide.slip", "belt")
VALUES = (2, 0.5, 0.4, 0.1, 1.0, -1.5, 0.2)
P = (2, 0.5, 9.81, 0.3, 0.6, 0.1, 4)


@pytest.fixture(name="system", scope="module")
def _system() -> System:
    return lower(derive(load_text(DISC)))


@pytest.fixture(name="switching", scope="module")
def _switching(system: System) -> Switching:
    assert system.switching is not None
    return system.switching


def at_forces(multipliers: tuple[float, ...]) -> tuple[float, ...]:
    return (*VALUES, 0.0, 0.0, 0.0, *multipliers, *P)


def test_rows_that_switch(system: System, switching: Switching) -> None:
    assert system.constraints == ROWS
    assert system.holonomic == (0, 2, 3)
    assert switching.rows == (
        SwitchedRow(0, sign=1, unit="m"),
        SwitchedRow(1, limit=0, normal=0, unit="m/s"),
        SwitchedRow(2, sign=1, unit="m"),
        SwitchedRow(3),  # an event releases it
        SwitchedRow(4, limit=1, normal=3, unit="m/s"),
        SwitchedRow(5, limit=2, active=False, unit="m/s"),
    )
    assert system.held_at_start == (3,)


def test_limits_and_their_slopes(switching: Switching) -> None:
    found = ScalarTape(switching.limits)(at_forces((10, 0, 5, -20, 0, 0)))
    assert list(found[:6]) == pytest.approx([6, 6, 5.5, 3, 6, 5.5])
    slopes = dict(zip(switching.limit_pattern, found[6:9], strict=True))
    # the bilateral guide presses with λ < 0
    assert slopes == pytest.approx({(0, 0): 0.6, (1, 3): -0.3, (2, 2): 0.3})
    slopes = dict(zip(switching.limit_pattern, found[9:], strict=True))
    assert slopes == pytest.approx({(0, 0): 0.3, (1, 3): -0.3, (2, 2): 0.3})


def test_a_limit_of_a_unilateral_row_has_no_kink(switching: Switching) -> None:
    found = ScalarTape(switching.limits)(at_forces((-10, 0, 0, 0, 0, 0)))
    assert found[0] == pytest.approx(-6)


def test_impacts_use_kinetic_friction(switching: Switching) -> None:
    # restitution of floor and roof; friction of floor.slip, guide.slip, belt
    assert ScalarTape(switching.impact)((*VALUES, *P)) == pytest.approx([0.6, 0, 0.3, 0.3, 0])


def test_forces_that_depend_on_multipliers_are_apart(system: System, switching: Switching) -> None:
    assert switching.forces is not None
    assert switching.force_coordinates == (0, 2)
    assert switching.force_pattern == ((0, 0), (1, 3))
    found = ScalarTape(switching.forces)(at_forces((10, 0, 0, -20, 0, 0)))
    assert list(found) == pytest.approx([-1, -1, -0.1, 0.05])
    mass_and_forcing = ScalarTape(system.dynamics)((*VALUES, *P))
    assert list(mass_and_forcing[3:6]) == pytest.approx([0, -2 * 9.81, 0])


def test_conditions_rise_as_they_become_true(system: System, switching: Switching) -> None:
    assert system.events is not None
    assert [e.condition for e in switching.events] == [0, 1, 2, 3, None, None]
    assert [e.either for e in switching.events] == [False, False, True, False, False, False]
    assert switching.condition_times == (TimeIn.ALONE, TimeIn.NONE, TimeIn.NONE)
    t, x, y, v = 2.5, 0.5, 0.4, 3.5
    late, push, turn = ScalarTape(system.events)((t, x, y, 0.1, v, -1.5, 0.2, *P))
    assert (late, turn) == pytest.approx((0.5, 3.5))
    assert push == pytest.approx(min(v - 3, min(4 * 0.5 - y, x)))
    assert switching.force_conditions is not None
    (heavy,) = ScalarTape(switching.force_conditions)(at_forces((60, 0, 0, 0, 0, 0)))
    assert heavy == pytest.approx(10)


def test_changes_of_contacts_name_rows(switching: Switching) -> None:
    assert switching.events[4].change == (0, "impacts")
    assert switching.events[5].change == (1, "slips")


def test_actions(switching: Switching) -> None:
    late, push, turn, heavy, hit, _ = switching.events
    assert late.engage == (5,)
    # a constraint takes its friction with it
    assert heavy.release == (3, 4)
    assert heavy.stop
    assert turn.record == ("x", "phi_dot", "lambda.floor.slip")
    assert turn.times == 3
    assert hit.record is None
    assert push.targets == (("v", 0), ("p", 5))
    assert push.impulses == (1,)
    assert switching.actions is not None
    found = ScalarTape(switching.actions)(at_forces((0,) * 6))
    assert list(found[push.first :]) == pytest.approx([-1.5 + 0.5, 0.2, 2])


def test_a_model_without_contacts_has_none() -> None:
    text = "coordinates: [x]\nT: x'^2\ninitial: {x: 0, x': 1}\n"
    equations = derive(load_text(text))
    assert not equations.switches
    assert lower(equations).switching is None
    assert lower(equations).events is None


def test_a_force_that_depends_on_a_multiplier_alone_switches() -> None:
    text = (
        "coordinates: [x, y]\nT: x'^2 + y'^2\nV: y\nQ: {x: -0.1*abs(lambda.c)}\n"
        "constraints: {c: y = 0}\ninitial: {x: 0, y: 0, x': 1, y': 0}\n"
    )
    equations = derive(load_text(text))
    assert equations.switches
    assert not equations.model.switches
    assert lower_switching(equations).switching is not None


def test_forces_alone_switch_nothing() -> None:
    text = """
coordinates: [x, y]
parameters: {c: 0.2}
T: x'^2/2 + y'^2/2
V: 9.81*y
Q: {x: -c*abs(lambda.guide)*x'}
constraints: {guide: y = 0}
initial: {x: 0, y: 0, x': 1, y': 0}
"""
    switching = lower(derive(load_text(text))).switching
    assert switching is not None
    assert switching.rows == ()
    assert switching.force_coordinates == (0,)
