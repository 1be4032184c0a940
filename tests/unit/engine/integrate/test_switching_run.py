"""Contacts, friction and events: against closed forms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from integration_requests import changed

import lagcli
from lagcli.engine.contract import Block, Outcome, Stop
from lagcli.engine.event_entries import EventEntry, Occurrence
from lagcli.engine.integrate.switching_run import Actions, RecordedInstants, SwitchingIntegration
from lagcli.engine.switching.switching import EventRule, RowMode
from lagcli.engine.system import System
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations import simulation
from tests.support.switching_models import KANE

MODELS = Path(__file__).parents[4] / "models"
G = 9.81
METHODS = ("DOP853", "Taylor", "Rodas5P", "Radau")


class Run(NamedTuple):
    """How a run ended, what happened, and its samples."""

    system: System
    outcome: Outcome
    samples: Block

    def times(self, *what: str) -> list[float]:
        """Return the times of occurrences."""
        return [e.time for e in self.outcome.events if e.occurrence in what]

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return q and v of the sample at a time."""
        i = int(np.flatnonzero(self.samples.time == t)[0])
        return self.samples.q[i], self.samples.v[i]

    def energy_balance(self, p: Sequence[float]) -> float:
        """Return the largest difference of T + V − W from its start, over the largest of T."""
        from lagcli.engine.tape.interpreter import ScalarTape

        tape, b = ScalarTape(self.system.report), self.samples
        found = np.array(
            [
                tape((t, *q, *v, *a, *x, *p))[:2]
                for t, q, v, a, x in zip(b.time, b.q, b.v, b.a, b.multipliers, strict=True)
            ]
        )
        balance = found.sum(axis=1) - b.work
        return float(np.abs(balance - balance[0]).max() / np.abs(found).max())


def run(text: str, times: Sequence[float], *, balanced: bool = True, **changes: Any) -> Run:
    """Integrate a model, by default to 1e-12; changes are settings.

    The energy must balance, unless its parameters change.
    """
    settings = {"rtol": 1e-12, "t_end": float(times[-1]), **changes}
    prepared = simulation.prepare(lagcli.load_text(text), SettingsOverrides(**settings))
    request = changed(prepared.request, times=np.array(times, dtype=float), block_rows=7)
    blocks: list[Block] = []
    outcome = SwitchingIntegration(prepared.system, request, blocks.append, None).run()
    columns = zip(*blocks, strict=True)
    found = Run(prepared.system, outcome, Block(*map(np.concatenate, columns)))
    if outcome.status == "completed" and balanced:
        assert found.energy_balance(request.state.p) < 1e-9
    return found


BALL = """
coordinates: {y: m}
parameters: {m: 2 kg, g: 9.81 m/s^2, e: 0.8, h: 1 m}
T: m/2*y'^2
V: m*g*y
constraints:
  floor: {expr: y >= 0, restitution: e}
initial: {y: h, y': 0}
"""
IMPACTS = math.sqrt(2 / G) * (1 + 2 * np.cumsum([0, *(0.8**k for k in range(1, 10))]))


@pytest.mark.parametrize("method", METHODS)
def test_a_bouncing_ball_comes_to_rest(method: str) -> None:
    rtol = 1e-12 if method in ("DOP853", "Taylor") else 1e-9
    found = run(BALL, [0, 1, 4.5, 5], method=method, rtol=rtol)
    impacts = [e for e in found.outcome.events if e.occurrence == "impact"]
    np.testing.assert_allclose([e.time for e in impacts[:10]], IMPACTS, rtol=0, atol=1e-10)
    np.testing.assert_allclose(impacts[0].impulse, [2 * 1.8 * math.sqrt(2 * G)], rtol=1e-10)
    assert impacts[0].loss == pytest.approx(2 * G * (1 - 0.64), rel=1e-10)
    assert sum(e.loss for e in found.outcome.events) == pytest.approx(2 * G, rel=1e-10)
    # the geometric series of the flights has a limit
    assert found.times("rest") == pytest.approx([9 * math.sqrt(2 / G)], abs=1e-9)
    assert found.at(5)[0] == pytest.approx([0], abs=1e-15)
    np.testing.assert_allclose(found.samples.multipliers[-2:, 0], 2 * G, rtol=1e-14)
    assert found.at(1)[0] == pytest.approx([0.46800445252603631], abs=1e-11)
    assert found.outcome.modes == (RowMode.OPEN,)
    assert found.outcome.events[-1].modes.tolist() == [RowMode.HOLDS]


def test_ten_thousand_bounces() -> None:
    bouncing = BALL.replace("e: 0.8", "e: 1")
    period = 2 * math.sqrt(2 / G)
    found = run(bouncing, [0, 10_000 * period], rtol=1e-9, max_steps=10**6)
    times = found.times("impact")
    assert len(times) == 10_000
    np.testing.assert_allclose(times, (np.arange(10_000) + 0.5) * period, rtol=1e-9)
    # the steps do not begin small after each bounce
    assert found.outcome.steps < 20_100


def test_a_run_that_is_long_beside_its_bounces() -> None:
    """Steps do not go far beyond an impact, where the gap is large and its rounding, too."""
    period = 2 * math.sqrt(2 / G)
    found = run(BALL.replace("e: 0.8", "e: 1"), [0, 30_000 * period], rtol=1e-9, max_steps=10**6)
    times = found.times("impact")
    assert len(times) == 30_000
    np.testing.assert_allclose(times[:100], (np.arange(100) + 0.5) * period, atol=1e-12)


def test_dry_friction_turns_and_sticks() -> None:
    found = run(
        """
coordinates: {x: m}
parameters: {m: 1 kg, k: 100 N/m, F: 10 N, x0: 1.05 m}
T: m/2*x'^2
V: k/2*x^2
constraints:
  friction: {expr: x' = 0, limit: F}
initial: {x: x0, x': 0}
""",
        [0, 0.5, 1, 3],
    )
    turns = found.outcome.events
    assert [e.occurrence for e in turns] == ["slips"] * 4 + ["sticks"]
    np.testing.assert_allclose([e.time for e in turns], math.pi / 10 * np.arange(1, 6), atol=1e-11)
    np.testing.assert_allclose(
        [e.q[0] for e in turns], [-0.85, 0.65, -0.45, 0.25, -0.05], atol=1e-10
    )
    assert found.samples.multipliers[-1] == pytest.approx([-5], abs=1e-8)
    assert found.samples.work[-1] == pytest.approx(-55, abs=1e-8)


def test_a_ball_rolls_after_sliding() -> None:
    found = run(
        """
coordinates: {x: m, y: m, phi: rad}
parameters: {m: 6 kg, r: 0.1 m, g: 9.81 m/s^2, mu: 0.12, v0: 8 m/s, w0: -20 rad/s}
T: m/2*(x'^2 + y'^2) + m*r^2/5*phi'^2
V: m*g*y
constraints:
  lane: {expr: y >= r, friction: mu, slip: x' - r*phi'}
initial: {x: 0, y: r, phi: 0, x': v0, y': 0, phi': w0}
""",
        [0, 1, 3],
    )
    assert found.times("sticks") == pytest.approx([2.427066647250133], abs=1e-12)
    assert found.at(3)[0][0] == pytest.approx(18.89580949607162, abs=1e-11)
    np.testing.assert_allclose(found.samples.multipliers[1], [6 * G, -0.12 * 6 * G], rtol=1e-13)
    assert found.samples.work[-1] == pytest.approx(-85.71428571428571, abs=1e-9)


def test_a_rope_slackens_and_tightens() -> None:
    found = run(
        """
coordinates: {x: m, y: m}
parameters: {m: 1 kg, g: 9.81 m/s^2, l: 1 m}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints:
  rope: x^2 + y^2 <= l^2
initial: {x: 0, y: -l, x': sqrt(4*g*l), y': 0}
""",
        [0, 1, 2],
    )
    # at y = 2/3 the weight holds the particle on the circle
    assert found.outcome.events[0].q[1] == pytest.approx(2 / 3, abs=1e-9)
    assert [e.occurrence for e in found.outcome.events] == ["opens", "impact", "closes"]
    assert (found.samples.multipliers <= 0).all()
    assert found.outcome.events[1].impulse[0] == pytest.approx(-2.8238969788633673, abs=1e-8)


CRADLE = """
coordinates: ["x[1..5]"]
parameters: {m: 1 kg, d: 0.1 m, v: 1 m/s}
T: sum(m/2*x[i]'^2, i = 1..5)
constraints:
  hit[i = 2..5]: {expr: "x[i] - x[i-1] >= d", restitution: 1}
initial:
  "x[i = 1..5]": (i - 1)*d
  "x[1]": -0.5
  "x[1..5]'": 0
  "x[1]'": v
"""


@pytest.mark.parametrize(
    ("law", "after"),
    [
        ("sequential", [0, 0, 0, 0, 1]),
        ("poisson", [-0.6, *[0.4] * 4]),
        ("newton", [-0.6, *[0.4] * 4]),
    ],
)
def test_cradle(law: str, after: list[float]) -> None:
    found = run(CRADLE, [0, 0.6], impacts=law)
    np.testing.assert_allclose(found.at(0.6)[1], after, atol=1e-12)


def test_an_impact_at_the_start() -> None:
    impact = run(KANE, [0, 0.01]).outcome.events[0]
    assert (impact.occurrence, impact.time) == ("impact", 0)
    np.testing.assert_allclose(impact.after, [-0.2006810502727869, 0.2177516978703347], rtol=1e-13)
    np.testing.assert_allclose(impact.impulse, [0.1288789629522897, 0.0291392664987980], rtol=1e-12)


def test_an_impact_that_gains_energy_is_rejected() -> None:
    prepared = simulation.prepare(
        lagcli.load_text(KANE), SettingsOverrides(t_end=0.01, impacts="newton")
    )
    outcome = SwitchingIntegration(prepared.system, prepared.request, lambda _: None, None).run()
    assert outcome.status == "failed"
    assert outcome.message == (
        "an impact at `floor` would gain 0.04074 J (Newton's law with friction) at t = 0 s:"
        " use `impacts: poisson`"
    )


KLEIN = """
coordinates: {x1: m, y1: m, x2: m, y2: m}
parameters: {m1: 1 kg, m2: 1 kg, L: 1 m, phi: 60 deg, mu: MU, P2: 6 N, v: 1 m/s}
T: m1/2*(x1'^2 + y1'^2) + m2/2*(x2'^2 + y2'^2)
Q: {x2: P2}
constraints:
  rough: {expr: y1 = 0, friction: mu, slip: x1'}
  smooth: y2 = L*sin(phi)
  rod: (x2 - x1)^2 + (y2 - y1)^2 = L^2
initial: {x1: 0, y1: 0, x2: L*cos(phi), y2: L*sin(phi), x1': v, x2': v, y1': 0, y2': 0}
"""


def test_friction_of_a_bilateral_constraint() -> None:
    found = run(KLEIN.replace("MU", "0.8"), [0, 0.2])
    assert found.samples.a[0, 0] == pytest.approx(-3.766271094389717, rel=1e-13)
    assert found.samples.multipliers[0, 0] == pytest.approx(-16.915677735974292, rel=1e-13)


@pytest.mark.parametrize(
    ("load", "message"),
    [("6 N", "no motion is possible"), ("-6 N", "2 solutions for the friction")],
)
def test_painleve(load: str, message: str) -> None:
    model = KLEIN.replace("MU", "1.2").replace("P2: 6 N", f"P2: {load}")
    prepared = simulation.prepare(lagcli.load_text(model), SettingsOverrides(t_end=0.1))
    outcome = SwitchingIntegration(prepared.system, prepared.request, lambda _: None, None).run()
    assert outcome.status == "failed"
    assert outcome.message.startswith(f"{message} at `rough` at t = 0 s")


CLUTCH = """
coordinates: {a: rad, b: rad}
parameters: {J1: 0.5 kg*m^2, J2: 2 kg*m^2, M: 20 N*m, c: 0.3 N*m*s, Mc: 60 N*m, w1: 100 rad/s}
T: J1/2*a'^2 + J2/2*b'^2
Q: {a: M, b: -c*b'}
constraints:
  clutch: {expr: a' = b', limit: Mc, active: false}
events:
  close: {when: t >= 0.5, engage: clutch}
  open: {when: t >= 3, release: clutch}
initial: {a: 0, b: 0, a': w1, b': 0}
"""


@pytest.mark.parametrize("method", ["DOP853", "Taylor", "Radau"])
def test_a_clutch_engages_and_releases(method: str) -> None:
    rtol = 1e-12 if method != "Radau" else 1e-10
    found = run(CLUTCH, [0, 0.5, 2, 4], method=method, rtol=rtol)
    assert [(e.occurrence, e.time) for e in found.outcome.events if e.occurrence != "sticks"] == [
        ("event", 0.5),
        ("engages", 0.5),
        ("event", 3.0),
        ("releases", 3.0),
    ]
    assert found.times("sticks") == pytest.approx([1.6149773919915666], abs=1e-9)
    assert found.at(2)[1] == pytest.approx([32.42116499454211] * 2, rel=1e-9)
    assert found.at(4)[1] == pytest.approx([76.29363136802781, 31.23821801189222], rel=1e-9)
    assert found.samples.multipliers[2, 0] == pytest.approx(-17.945269899672527, rel=1e-8)


EVENTS = """
coordinates: {y: m}
parameters: {g: 9.81 m/s^2, k: 1}
T: y'^2/2
V: k*g*y
events:
  EVENT
initial: {y: 1, y': 0}
"""


def events(found: Run) -> list[EventEntry]:
    return [e for e in found.outcome.events if e.occurrence == "event"]


def test_a_condition_sets_a_velocity() -> None:
    text = EVENTS.replace("EVENT", "bounce: {when: y <= 0, set: {y': -0.5*y'}, times: 2}")
    found = run(text, [0, 1.2])
    first = math.sqrt(2 / G)
    np.testing.assert_allclose([e.time for e in events(found)], [first, 2 * first], atol=1e-12)
    assert events(found)[0].work == pytest.approx(-0.75 * G, rel=1e-11)


def test_a_condition_of_time_is_met_exactly_and_sets_a_parameter() -> None:
    found = run(
        EVENTS.replace("EVENT", "off: {when: t >= 0.3, set: {k: 0}}"), [0, 0.3, 1], balanced=False
    )
    assert [e.time for e in events(found)] == [0.3]
    y, v = 1 - G * 0.045, -G * 0.3
    assert found.at(1)[0] == pytest.approx([y + 0.7 * v], abs=1e-12)
    assert events(found)[0].work == pytest.approx(-G * y, rel=1e-12)


def test_an_impulse_and_a_stop() -> None:
    text = EVENTS.replace(
        "EVENT", "push: {when: t >= 0.1, impulse: {y: 2}}\n  flat: {when: y <= 0, stop: true}"
    )
    prepared = simulation.prepare(lagcli.load_text(text), SettingsOverrides(t_end=2, rtol=1e-12))
    outcome = SwitchingIntegration(prepared.system, prepared.request, lambda _: None, None).run()
    assert outcome.status == "stopped-by-event"
    v, y = 2 - 0.1 * G, 1 - G * 0.005
    at = 0.1 + (v + math.sqrt(v * v + 2 * G * y)) / G
    assert outcome.events[-1].time == pytest.approx(at, abs=1e-12)
    assert outcome.events[0].after - outcome.events[0].before == pytest.approx([2])


def test_all_roots_of_a_cubic() -> None:
    """x = t reaches and leaves the region where a cubic is positive within one step."""
    text = """
coordinates: {x: m}
T: x'^2/2
events:
  root: {when: (x - 0.1)*(x - 0.5)*(x - 0.8) = 0}
initial: {x: 0, x': 1}
"""
    found = run(text, [0, 1])
    np.testing.assert_allclose([e.time for e in events(found)], [0.1, 0.5, 0.8], atol=1e-13)
    rising = run(text.replace("= 0}", ">= 0}"), [0, 1])
    np.testing.assert_allclose([e.time for e in events(rising)], [0.1, 0.8], atol=1e-13)


@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-9, 1e-11, -1e-11])
def test_grazing(depth: float) -> None:
    """A parabola reaches below zero for 2 √depth, within one step."""
    text = f"""
coordinates: {{x: m}}
T: x'^2/2
events:
  graze: {{when: (x - 0.5)^2 <= {depth!r}}}
initial: {{x: 0, x': 1}}
"""
    times = [e.time for e in events(run(text, [0, 1]))]
    expected = [0.5 - math.sqrt(depth)] if depth > 0 else []
    np.testing.assert_allclose(times, expected, atol=1e-9)


def test_a_change_of_a_contact_is_an_event() -> None:
    text = BALL + "events:\n  kick: {when: floor impacts, times: 2, set: {y': 2*y'}}\n"
    found = run(text, [0, 3])
    first = math.sqrt(2 / G)
    np.testing.assert_allclose(found.times("impact"), [first, first + 3.2 * first], atol=1e-10)
    assert [float(e.after[0] / e.before[0]) for e in events(found)] == pytest.approx([2, 2])


def test_events_without_end_are_an_error() -> None:
    event = "up: {when: y <= 0.5, set: {y: 2}}\n  down: {when: y >= 1.5, set: {y: 0.25}}"
    text = EVENTS.replace("EVENT", event)
    prepared = simulation.prepare(lagcli.load_text(text), SettingsOverrides(t_end=2))
    outcome = SwitchingIntegration(prepared.system, prepared.request, lambda _: None, None).run()
    assert outcome.status == "failed"
    at = math.sqrt(1 / G)
    assert outcome.message == f"events do not end at t = {at:.9g} s: `up`, `down`"


def test_a_condition_that_an_action_ends_happens_again() -> None:
    found = run(EVENTS.replace("EVENT", "lift: {when: y <= 0.5, set: {y: 1, y': 0}}"), [0, 2])
    fall = math.sqrt(1 / G)
    times = [e.time for e in events(found)]
    np.testing.assert_allclose(times, fall * np.arange(1, len(times) + 1), atol=1e-11)
    assert len(times) == int(2 / fall)


class NotingCore:
    """Stands for the core at an instant."""

    def __init__(self, state: list[float], happened: list[int]):
        self.t, self.state, self._happened = 0.5, np.array(state), happened
        self.modes = [0]
        self.active: dict[int, bool] = {}
        self.motion = np.zeros(3), np.array([1.0]), np.array([0.0])
        self.absolute_tolerances = np.zeros(len(state))
        self.p: list[float] = []

    def happened(self) -> list[int]:
        return self._happened

    def ticked(self) -> list[int]:
        return []

    def place(self, y: Any) -> None:
        self.state = np.array(y)

    def no_gap(self, row: int) -> float:
        return 1e-9

    def activate(self, row: int, active: bool) -> None:
        self.active[row] = active

    def set_parameters(self, p: list[float]) -> None:
        self.p = list(p)


MODEL = """
coordinates: [x]
parameters: {m: 2, k: 3}
T: m/2*x'^2
V: k/2*x^2
constraints:
  pin: {expr: x = 1, active: false}
events:
  kick: {when: x >= 0.2, set: {x': 2*x', k: k + x}, times: 1}
  fix: {when: x >= 0.9, engage: pin}
  free: {when: x >= 0.95, release: pin, stop: true}
initial: {x: 0, x': 1}
"""


def actions(state: list[float], happened: list[int]) -> tuple[Actions, NotingCore]:
    prepared = simulation.prepare(lagcli.load_text(MODEL))
    core = NotingCore(state, happened)
    return Actions(prepared.system, prepared.request, core), core


def test_values_are_those_of_before() -> None:
    doing, core = actions([0.2, 3.0, 0.0], [0])
    (entry,) = doing.react([])
    assert core.p == [2, 3.2]
    # T + V with the new k
    work = 36 + 3.2 * 0.02 - (9 + 3 * 0.02)
    np.testing.assert_allclose(core.state, [0.2, 6.0, work])
    assert (entry.occurrence, entry.which, entry.time) == ("event", 0, 0.5)
    assert entry.work == pytest.approx(work)
    assert not doing.react([])  # once is all


def test_rows_are_engaged_where_they_are_met() -> None:
    doing, core = actions([1.0, 0.0, 0.0], [1])
    assert [e.occurrence for e in doing.react([])] == ["event", "engages"]
    assert core.active == {0: True}
    doing, _ = actions([1 + 1e-8, 0.0, 0.0], [1])
    with pytest.raises(Stop, match="`pin` cannot be engaged"):
        doing.react([])
    doing, _ = actions([0.7, 0.0, 0.0], [1])
    with pytest.raises(Stop, match=r"`pin` cannot be engaged at t = 0\.5 s, phi = -0\.3"):
        doing.react([])


def test_rows_are_released_and_the_run_stops() -> None:
    doing, core = actions([1.0, 0.0, 0.0], [2])
    assert [e.occurrence for e in doing.react([])] == ["event", "releases"]
    assert core.active == {0: False}
    assert doing.stopped == "`free` stopped the run at t = 0.5 s"


@pytest.mark.parametrize(
    ("key", "more", "crossed"),
    [
        ("constraints:\n", "  idle: x_1 >= -100*l\n", False),
        ("initial:\n", "events: {idle: {when: t >= 100}}\n", False),
        ("", "", True),
    ],
)
def test_what_switches_is_not_searched_for_in_a_singular_configuration(
    key: str, more: str, crossed: bool
) -> None:
    """The flat parallelogram: only a model without contacts and events continues through it."""
    text = (MODELS / "parallelogram.yaml").read_text()
    whole = more + key if key.startswith("initial") else key + more
    model = lagcli.load_text(text.replace(key, whole, 1), set_initial={"alpha_1'": "6"})
    run = lagcli.simulate(model, through_singular=True, t_end=1.0)
    if crossed:
        assert run.status == "completed"
    else:
        assert run.message.startswith("singular configuration at t = 0.")
        assert "--through-singular is for models without contacts" in run.message


LEFT, RIGHT = np.array([1.0, 2.0]), np.array([1.0, 3.0])


def entry(what: Occurrence, which: int) -> EventEntry:
    nothing = np.zeros(1)
    modes = np.zeros(1, dtype=np.intp)
    return EventEntry(1.0, what, which, nothing, nothing, nothing, nothing, 0.0, 0.0, 0.0, modes)


def test_entries_of_one_instant_have_its_limits() -> None:
    instants = RecordedInstants([EventRule("all"), EventRule("none", record=())])
    assert instants.records
    assert not instants.open
    instants.begin(LEFT, (1.0,), 4)
    assert instants.open
    assert instants.first == 4
    instants.add(4, [entry("impact", 0), entry("event", 0), entry("event", 1)])
    instants.add(7, [entry("event", 0)])
    instants.end(RIGHT, (2.0,))
    assert not instants.open
    assert [x.entry for x in instants.limits] == [5, 7]
    for found in instants.limits:
        assert found.left is LEFT
        assert found.right is RIGHT
        assert (found.left_p, found.right_p) == ((1.0,), (2.0,))


def test_an_instant_without_end_has_a_limit_from_the_left_alone() -> None:
    instants = RecordedInstants([EventRule("all")])
    instants.begin(LEFT, (), 0)
    instants.add(0, [entry("event", 0)])
    instants.end(None, ())
    assert instants.limits[0].right[0] == 1.0
    assert np.isnan(instants.limits[0].right[1])


def test_events_that_record_nothing() -> None:
    assert not RecordedInstants([EventRule("none", record=())]).records
