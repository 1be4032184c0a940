"""What happens at one instant: actions of events, in their order, and what they are answered by."""

from typing import Any

import numpy as np
import pytest
import yaml

import lagcli
from lagcli.errors import UsageError
from lagcli.export.fmu import fmu
from lagcli.live.content import live_content
from lagcli.model.loader import load_text
from tests.support.contact_cases import ContactRun, run_contact
from tests.support.switching_models import BLOCK

BALL: dict[str, Any] = {
    "coordinates": {"x": "m", "y": "m"},
    "parameters": {"m": "1 kg", "g": "10 m/s^2", "e": 0.5, "l": "1 m"},
    "T": "m/2*(x'^2 + y'^2)",
    "V": "m*g*y",
    "constraints": {"floor": {"expr": "y >= 0", "restitution": "e"}},
    "initial": {"x": 0, "y": "1.25 m", "x'": 0, "y'": 0},
    "simulation": {"times": [0, 1]},
}


def ball(events: dict[str, Any], **changes: Any) -> ContactRun:
    """Run a ball that falls from 1.25 m, and hits the floor at t = 0.5 s with 5 m/s."""
    model = {**BALL, "events": events}
    for key, value in changes.items():
        model[key] = {**model[key], **value}
    return run_contact(load_text(yaml.safe_dump(model, sort_keys=False)))


def test_a_start_at_rest_on_the_floor() -> None:
    found = run_contact(load_text(BLOCK), t_end=0.05, times=(0, 0.05))
    assert list(found.outcome.modes) == [1, 2]  # closed, and slips forwards
    assert not found.outcome.events


def test_a_kick_as_the_contact_is_hit() -> None:
    found = ball({"kick": {"when": "floor impacts", "set": {"x'": "x' + 2"}, "times": 1}})
    impact, kick = found.outcome.events[:2]
    assert (impact.occurrence, kick.occurrence) == ("impact", "event")
    assert impact.time == kick.time == pytest.approx(0.5)
    np.testing.assert_allclose(kick.after, [2.0, 2.5])
    assert kick.work == pytest.approx(0.5 * 2.0**2)
    assert found.at(1.0, "x'") == 2.0
    assert len(found.entries("event")) == 1


def test_a_parameter_is_set() -> None:
    found = ball({"dead": {"when": "t >= 0.25", "set": {"e": 0}}})
    assert found.outcome.events[0].time == 0.25
    assert [x.occurrence for x in found.outcome.events] == ["event", "impact", "closes"]
    assert found.at(1.0, "y") == pytest.approx(0, abs=1e-15)


def test_values_are_those_of_before() -> None:
    found = ball({"swap": {"when": "t >= 0.25", "set": {"x": "y", "y": "x + 1"}}})
    (swap,) = found.entries("event")
    y = 1.25 - 5 * 0.25**2
    np.testing.assert_allclose(swap.q, [y, 1.0])


def test_an_impulse_is_answered_by_constraints() -> None:
    """A pendulum at rest: along the rod, nothing happens."""
    for direction, expected in (("x", [3.0, 0.0]), ("y", [0.0, 0.0])):
        found = ball(
            {"hit": {"when": "t >= 0.5", "impulse": {direction: "3*m"}}},
            constraints={"floor": "y >= -10*l", "rod": "x^2 + y^2 = l^2"},
            initial={"y": "-l"},
        )
        (hit,) = found.entries("event")
        np.testing.assert_allclose(hit.after, expected, atol=1e-14)
        assert hit.work == pytest.approx(0.5 * expected[0] ** 2)


def test_an_impulse_onto_the_floor_rebounds() -> None:
    found = ball({"hit": {"when": "t >= 0.5", "impulse": {"y": "-3*m"}}}, initial={"y": 0})
    hit, impact = found.outcome.events[:2]
    assert (hit.occurrence, impact.occurrence) == ("event", "impact")
    np.testing.assert_allclose(impact.after, [0, 1.5])
    assert impact.loss == pytest.approx(0.5 * (9 - 2.25))


def test_a_rod_is_released_and_engaged() -> None:
    """A pendulum that is let go at its lowest point, and caught where it meets the circle."""
    found = ball(
        {
            "go": {"when": "t >= 0.1", "release": "rod"},
            "catch": {"when": "x^2 + y^2 >= l^2 + 0.01*m^0", "engage": "rod"},
        },
        constraints={"floor": "y >= -10*l", "rod": "x^2 + y^2 = l^2"},
        initial={"y": "-l", "x'": 0},
    )
    assert found.outcome.status == "failed"
    assert found.outcome.message.startswith("`rod` cannot be engaged at t = ")
    assert "phi = 0.01" in found.outcome.message


def test_engaging_stops_what_the_constraint_forbids() -> None:
    """A clutch without a limit: a plastic impulse, and the energy that it takes."""
    found = ball(
        {"lock": {"when": "t >= 0.25", "engage": "lock"}},
        constraints={"lock": {"expr": "x' = y'", "active": False}},
        initial={"x'": 1.5},
    )
    event = found.entries("event")[0]
    np.testing.assert_allclose(event.after, [-0.5, -0.5])
    assert event.work == pytest.approx(0.5 * (2 * 0.25 - 1.5**2 - 2.5**2))


def test_an_event_may_not_violate_a_contact() -> None:
    found = ball({"sink": {"when": "t >= 0.25", "set": {"y": -1}}})
    assert "an event violates `floor` by 1 m at t = 0.25 s" in found.outcome.message


def test_events_that_do_not_end() -> None:
    found = ball(
        {
            "up": {"when": "x >= 1", "set": {"x": 0}},
            "down": {"when": "x <= 0.5", "set": {"x": 2}},
        },
        initial={"x'": 2, "x": 0.75},
    )
    assert found.outcome.status == "failed"
    assert found.outcome.message == "events do not end at t = 0.125 s: `up`, `down`"


FREE: dict[str, Any] = {
    "coordinates": ["x"],
    "T": "x'^2/2",
    "initial": {"x": 0, "x'": 1},
    "simulation": {"t_end": 12, "samples": 13},
}


def at(time: float, **values: str | float) -> dict[str, Any]:
    """Return an event at one time that sets values."""
    return {
        "every": 100,
        "offset": time,
        "set": {k.replace("_dot", "'"): v for k, v in values.items()},
    }


def happened(events: dict[str, Any], **changes: Any) -> list[tuple[float, str]]:
    """Return the log of a free body, rounded."""
    found = lagcli.simulate(
        load_text(yaml.safe_dump({**FREE, **changes, "events": events}, sort_keys=False))
    )
    assert found.status == "completed"
    assert found.events is not None
    return [
        (round(float(t), 6), name)
        for t, name in zip(found.events.time, found.events.names, strict=True)
    ]


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("sign", [">=", "<=", "="])
def test_a_body_that_its_event_stops_at_the_bound_may_leave_it(
    side: int, way: int, sign: str
) -> None:
    if sign != "=":
        sign = ">=" if side > 0 else "<="
    stop = {"when": f"x {sign} {5 * side}", "set": {"x": 5 * side, "x'": 0}}
    found = happened({"stop": stop, "go": at(7.0, x_dot=way)}, initial={"x": 0, "x'": side})
    assert found == [(5.0, "stop"), (7.0, "go")]


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("force", ["1", "t", "t^3"])
def test_a_body_that_starts_at_rest_at_the_bound_leaves_it_without_an_event(
    way: int, force: str
) -> None:
    changes = {"initial": {"x": 5, "x'": 0}, "Q": {"x": f"{way}*{force}"}}
    assert happened({"there": {"when": "x = 5"}, "fast": {"when": "x' = 0"}}, **changes) == []


@pytest.mark.parametrize("way", [1, -1])
def test_a_body_that_left_a_bound_may_return_to_it(way: int) -> None:
    events = {"there": {"when": "x = 5"}, "go": at(2.0, x_dot=way), "back": at(4.0, x_dot=-way)}
    changes = {"initial": {"x": 5, "x'": 0}}
    assert happened(events, **changes) == [(2.0, "go"), (4.0, "back"), (6.0, "there")]


@pytest.mark.parametrize("kind", ["linear", "step"])
@pytest.mark.parametrize("way", [1, -1])
def test_a_body_that_rests_at_a_bound_may_be_pushed_off_it(kind: str, way: int) -> None:
    u = {"times": [0, 7, 8], "values": [0, 0, way], "interpolation": kind, "extend": "hold"}
    stop = {"when": "x = 5", "set": {"x": 5, "x'": 0}}
    assert happened({"stop": stop}, inputs={"u": u}, Q={"x": "u"}) == [(5.0, "stop")]


@pytest.mark.parametrize(("force", "expected"), [(0.5, True), (0.0, False), (-0.5, False)])
@pytest.mark.parametrize("sign", [">=", "="])
def test_an_action_onto_the_bound_of_another_event(force: float, expected: bool, sign: str) -> None:
    events = {"put": at(1.0, x=7.0, x_dot=0), "there": {"when": f"x {sign} 7"}}
    found = happened(events, Q={"x": force}, simulation={"t_end": 2})
    assert found == [(1.0, "put")] + [(1.0, "there")] * expected


def test_a_body_that_an_action_left_on_a_bound_passes_it_later() -> None:
    for way in (1, -1):
        events = {
            "put": at(1.0, x=7.0, x_dot=0),
            "there": {"when": "x >= 7"},
            "go": at(2.0, x_dot=way),
        }
        found = happened(events, simulation={"t_end": 3})
        assert found == [(1.0, "put"), (2.0, "go")] + [(2.0, "there")] * (way > 0)


@pytest.mark.parametrize("sign", [">=", "<=", "="])
@pytest.mark.parametrize("way", [1, -1])
def test_a_body_that_stops_on_the_bound_but_for_rounding(sign: str, way: int) -> None:
    """It moves from 2 at 2.37 s to 4e-16 below 0 at 4.37 s, rests there for 1 s, and is pushed."""
    events = {
        "begin": at(2.37, x=2.0, x_dot=-1),
        "stop": at(4.37, x_dot=0),
        "push": at(5.37, x_dot=way),
        "there": {"when": f"x {sign} 0"},
    }
    found = happened(events, initial={"x": 1, "x'": 0}, simulation={"t_end": 6})
    there = [(4.37, "there")] if sign != ">=" else []
    assert found == [(2.37, "begin"), (4.37, "stop"), *there, (5.37, "push")]


@pytest.mark.parametrize(
    ("guide", "push", "impulse"),
    [("  guide: y = 0.8*l", "{x: 3}", [-0.5, 4.0]), ("", "{x: 3, y: 4}", [-0.5])],
)
def test_an_impulse_that_the_constraints_bear(guide: str, push: str, impulse: list[float]) -> None:
    """Bᵀ Λ = −p at (3, 4), where nothing moves; rows of B: (2 x, 2 y), and (0, 1) of the guide."""
    run = lagcli.simulate(
        load_text(f"""
coordinates: [x, y]
parameters: {{m: 2, l: 5}}
T: m/2*(x'^2 + y'^2)
V: 0
constraints:
  rod: x^2 + y^2 = l^2
{guide}
events: {{kick: {{when: t >= 1, impulse: {push}}}}}
initial: {{x: 3, y: 4, x': 0, y': 0}}
simulation: {{t_end: 2}}
""")
    )
    assert run.events is not None
    np.testing.assert_allclose(run.events.impulse, [impulse], rtol=1e-14)
    assert not run.events.after.any()
    assert run.events.work == pytest.approx([0.0], abs=1e-14)


NONLINEAR = """
coordinates: [x, y, z]
parameters: {c: 5}
T: (x'^2 + y'^2 + z'^2)/2
constraints:
  speed: x'^2 + y'^2 = c^2
  CONSTRAINT
initial: {x: 0, y: 1, z: 0, x': 4, y': -3, z': 0}
"""


WALL = "wall: {expr: y >= 0, restitution: 1}"


@pytest.mark.parametrize(
    ("constraint", "event", "place"),
    [
        (WALL, "{when: t >= 0.1, impulse: {x: 0.5}}", "`hit` at t = 0.1 s"),
        (WALL, "{when: t >= 2, stop: true}", "`wall` at t = 0.333333333 s"),
        ("stay: {expr: z' = x', active: false}", "{when: t >= 0.1, engage: stay}", "at t = 0.1 s"),
    ],
)
def test_an_impulse_on_a_constraint_nonlinear_in_velocities_ends_the_run(
    constraint: str, event: str, place: str
) -> None:
    """The linear law of impulses would leave x'² + y'² = c², and change the energy."""
    text = NONLINEAR.replace("CONSTRAINT", constraint)
    run = lagcli.simulate(load_text(f"{text}events: {{hit: {event}}}\n"), t_end=1)
    assert run.status == "failed"
    assert "reaction of `speed` to the impulse at" in run.message
    assert place in run.message


@pytest.mark.parametrize(
    ("constraint", "event", "source"),
    [
        (WALL, "{when: t >= 2, stop: true}", "contact `wall`"),
        ("", "{when: t >= 0.1, impulse: {x: 0.5}}", "event `hit`"),
        ("stay: {expr: z' = x', active: false}", "{when: t >= 0.1, engage: stay}", "event `hit`"),
    ],
)
def test_pages_and_fmus_refuse_such_impulses(constraint: str, event: str, source: str) -> None:
    text = NONLINEAR.replace("CONSTRAINT", constraint)
    model = load_text(f"{text}events: {{hit: {event}}}\nsimulation: {{t_end: 0.05}}\n")
    for export in (fmu, live_content):
        with pytest.raises(UsageError, match=f"{source}, beside `speed`"):
            export(model)
    straight = text.replace("x'^2 + y'^2 = c^2", "3*x' + 4*y' = 0")
    assert fmu(load_text(f"{straight}events: {{hit: {event}}}\n"))


@pytest.mark.parametrize("action", ["impulse: {z: 0.5}", "set: {x': 3}"])
def test_actions_that_such_a_constraint_allows(action: str) -> None:
    """An impulse that does not reach it, and velocities that satisfy it: the speed stays 5."""
    text = NONLINEAR.replace("CONSTRAINT", WALL)
    model = load_text(f"{text}events: {{hit: {{when: t >= 0.1, {action}}}}}\n")
    run = lagcli.simulate(model, t_end=0.3 if "z" in action else 0.2)
    assert run.status == "completed"
    np.testing.assert_allclose(np.hypot(*run.v[:, :2].T), 5, rtol=1e-12)
    np.testing.assert_allclose(run.energy_balance, 0, atol=1e-12)
    assert run.v[-1, 2] == (0.5 if "z" in action else 0)
