"""The cases of tests/benchmark/contact: contact, impacts, friction and events.

References are closed forms to 20 digits, or two independent programs to the digits given. Event
times agree to 1e-9 and better with rtol = 1e-12; the end of an infinite sequence of impacts, which
is extrapolated from a contact that closes within 1e-9, to 1e-9 as well.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from lagcli.engine.switching.switching import RowMode
from lagcli.model.loader import load_text
from tests.support.contact_cases import ContactRun, contact_model, read_case, run_contact

#: s, and of the size of everything else.
TIME, VALUE = 1e-9, 1e-9


@cache
def reference(name: str) -> dict[str, float]:
    values: dict[str, float] = read_case(name)["reference"]
    return values


def run(name: str, **changes: Any) -> ContactRun:
    found = run_contact(contact_model(name, **changes))
    assert found.outcome.status in ("completed", "stopped-by-event"), found.outcome.message
    return found


def sampled(*times: float) -> dict[str, Any]:
    return {"simulation": {"times": [0, *times]}}


def near(value: float, name: str, quantity: str, tolerance: float = VALUE) -> None:
    """Hold a value to one of the reference, relative to its size."""
    expected = reference(name)[quantity]
    assert value == pytest.approx(expected, rel=tolerance, abs=tolerance), quantity


def check_balance(found: ContactRun, scale: float) -> None:
    """Hold the energy to the work, through all events, to 1e-9 of the energy's scale."""
    from lagcli.simulations.derived import DerivedColumns

    p = tuple(found.model.parameter_values.values())
    balance = DerivedColumns(found.system, p)(found.block).energy_balance
    assert np.abs(balance).max() <= 1e-9 * scale


def test_bouncing_ball() -> None:
    found = run("bouncing_ball", **sampled(1, 2, 3, 4, 5))
    impacts = found.entries("impact", "floor")
    for k in (1, 2, 10):
        near(impacts[k - 1].time, "bouncing_ball", f"t of impact {k}")
    near(
        found.entries("rest", "floor")[0].time,
        "bouncing_ball",
        "t_rest (end of the infinite sequence)",
    )
    near(found.impulse(impacts[0], "floor"), "bouncing_ball", "impulse.floor of impact 1")
    near(-impacts[0].loss, "bouncing_ball", "energy loss of impact 1")
    # what is left as the ball comes to rest is the energy of a height of 1e-9
    near(-sum(x.loss for x in impacts), "bouncing_ball", "energy loss, all impacts", 3e-9)
    near(found.at(1.0, "y"), "bouncing_ball", "y at t = 1")
    near(found.at(5.0, "y"), "bouncing_ball", "y at t = 5")
    near(found.at(5.0, "lambda.floor"), "bouncing_ball", "lambda.floor at rest")
    check_balance(found, 19.62)


def test_a_sample_at_an_impact_is_the_one_after_it() -> None:
    first = np.sqrt(2 / 9.81)
    found = run("bouncing_ball", simulation={"times": [0, 0.4, 1]})
    assert found.at(0.4, "y'") < 0
    impact = found.entries("impact")[0]
    assert impact.time == pytest.approx(first, abs=1e-12)
    assert found.value(impact, "y'", before=True) == pytest.approx(-9.81 * first)
    assert found.value(impact, "y'") == pytest.approx(0.8 * 9.81 * first)


def test_rope_pendulum() -> None:
    name = "rope_pendulum"
    found = run(name, **sampled(4))
    (opens,), (impact,) = found.entries("opens", "rope"), found.entries("impact", "rope")
    near(opens.time, name, "t of opening.rope")
    near(found.value(opens, "x"), name, "x there")
    near(found.value(opens, "y"), name, "y there")
    near(impact.time, name, "t of impact.rope")
    near(found.value(impact, "x"), name, "x at impact")
    near(found.impulse(impact, "rope"), name, "impulse.rope of x^2 + y^2 <= l^2 (never positive)")
    near(-impact.loss, name, "energy loss")
    near(found.value(impact, "x'"), name, "x' after")
    near(found.value(impact, "y'"), name, "y' after")
    near(found.at(4.0, "x"), name, "x at t = 4")
    near(found.at(4.0, "y"), name, "y at t = 4")
    check_balance(found, 0.5 * 4 * 9.81)


def test_sliding_ladder() -> None:
    name = "sliding_ladder"
    found = run(name, **sampled(0.5, 3))
    near(found.at(0.0, "lambda.wall"), name, "lambda.wall at t = 0")
    near(found.at(0.0, "lambda.floor"), name, "lambda.floor at t = 0")
    (opens,), (flat,) = found.entries("opens", "wall"), found.entries("event", "flat")
    near(opens.time, name, "t of opening.wall")
    near(np.sin(found.value(opens, "theta")), name, "sin(theta) there")
    near(found.value(opens, "theta'"), name, "theta' there")
    near(found.value(opens, "x'"), name, "x' afterwards")
    near(flat.time, name, "t when flat")
    near(found.value(flat, "theta'"), name, "theta' when flat")
    assert found.outcome.status == "stopped-by-event"
    assert "`flat`" in found.outcome.message


def test_block_on_shaken_incline() -> None:
    name = "block_on_shaken_incline"
    found = run(name, **sampled(0.05, 0.6))
    kinds = {"sticks": found.entries("sticks"), "slips": found.entries("slips")}
    entries = sorted([*kinds["sticks"], *kinds["slips"]], key=lambda x: x.time)
    for k, entry in enumerate(entries[:6], start=1):
        occurrence = "sticks" if k % 2 else "slips"
        assert entry.occurrence == occurrence
        near(entry.time, name, f"event {k}: t (it {occurrence})")
        near(found.value(entry, "s"), name, f"event {k}: s")
    near(found.at(0.05, "lambda.slope"), name, "lambda.slope")
    check_balance(found, 0.5 * 0.3**2)


def test_bowling_ball() -> None:
    name = "bowling_ball"
    found = run(name, **sampled(1, 3))
    (sticks,) = found.entries("sticks", "lane.slip")
    near(sticks.time, name, "t of rolling")
    near(found.value(sticks, "x'"), name, "x' then")
    near(found.value(sticks, "x"), name, "x then")
    near(found.at(3.0, "x"), name, "x at t = 3")
    near(found.at(1.0, "lambda.lane.slip"), name, "lambda.lane_slip while sliding")
    near(float(found.block.work[-1]), name, "energy lost to friction")
    check_balance(found, 0.5 * 6 * 64)


def test_box_on_two_corners() -> None:
    name = "box_on_two_corners"
    found = run(name, **sampled(1))
    left, right = found.at(1.0, "lambda.left"), found.at(1.0, "lambda.right")
    near(left, name, "lambda.left at rest")
    near(right, name, "lambda.right at rest")
    slips = [found.at(1.0, f"lambda.{x}.slip") for x in ("left", "right")]
    near(sum(slips), name, "lambda.left_slip + lambda.right_slip at rest")
    assert abs(slips[0]) <= 0.4 * left
    assert abs(slips[1]) <= 0.4 * right
    assert {x.occurrence for x in found.outcome.events} == {"redundant"}


def test_redundant_friction_is_shared_within_the_cones() -> None:
    """Half of the friction each is more than mu lambda.left bears on a steeper slope."""
    found = run("box_on_two_corners", alpha="20 deg", **sampled(1))
    slope, b, h, mu, weight = np.radians(20), 0.2, 0.3, 0.4, 98.1
    left = weight * np.cos(slope) / 2 * (1 - h / b * np.tan(slope))
    assert found.at(1.0, "lambda.left") == pytest.approx(left, rel=1e-9)
    assert found.at(1.0, "lambda.left.slip") == pytest.approx(-mu * left, rel=1e-9)
    along = -weight * np.sin(slope) + mu * left
    assert found.at(1.0, "lambda.right.slip") == pytest.approx(along, rel=1e-9)


def test_box_that_slides() -> None:
    name = "box_on_two_corners"
    found = run(name, alpha="25 deg", **sampled(0.1))
    acceleration = float(found.block.a[0, 0])
    near(acceleration, name, "alpha = 25 deg: x''")
    near(found.at(0.0, "lambda.left"), name, "alpha = 25 deg: lambda.left")
    near(found.at(0.0, "lambda.right"), name, "alpha = 25 deg: lambda.right")


def test_box_that_tips() -> None:
    name = "box_on_two_corners"
    found = run(name, alpha="36 deg", mu=0.9, **sampled(0.1))
    near(
        float(found.block.a[0, 2]),
        name,
        "alpha = 36 deg, mu = 0.9: phi'' at t = 0 (tips about the right corner)",
    )


@pytest.mark.parametrize(("alpha", "slides"), [(21.8, False), (21.81, True)])
def test_least_angle_of_sliding(alpha: float, slides: bool) -> None:
    """atan 0.4 = 21.8014°."""
    found = run("box_on_two_corners", alpha=f"{alpha} deg", **sampled(0.1))
    assert (RowMode.HOLDS not in found.outcome.modes[1::2]) == slides
    assert (abs(found.block.v[-1, 0]) > 1e-6) == slides


def test_coulomb_oscillator() -> None:
    name = "coulomb_oscillator"
    found = run(name, **sampled(0.5, 1, 3))
    turns, (sticks,) = found.entries("slips"), found.entries("sticks")
    near(turns[0].time, name, "t of turning 1")
    near(found.value(turns[0], "x"), name, "x there")
    near(turns[1].time, name, "t of turning 2")
    near(found.value(turns[1], "x"), name, "x there (2)")
    near(sticks.time, name, "t of sticking")
    near(found.at(3.0, "x"), name, "x at rest")
    near(found.at(3.0, "lambda.friction"), name, "lambda.friction at rest")
    near(found.at(0.5, "x"), name, "x at t = 0.5")
    near(found.at(1.0, "x"), name, "x at t = 1")
    near(float(found.block.work[-1]), name, "energy lost to friction")
    check_balance(found, 55)


def test_clutch() -> None:
    name = "clutch"
    found = run(name, **sampled(1, 2, 4))
    (close,), (sticks,) = found.entries("event", "close"), found.entries("sticks", "clutch")
    assert close.time == 0.5  # exactly
    near(found.value(close, "a'"), name, "a' when it closes")
    near(sticks.time, name, "t of locking")
    near(found.value(sticks, "a'"), name, "speed when it locks")
    near(found.at(2.0, "b'"), name, "speed at t = 2")
    near(found.at(2.0, "lambda.clutch"), name, "lambda.clutch at t = 2")
    near(found.at(4.0, "a'"), name, "a' at t = 4")
    near(found.at(4.0, "b'"), name, "b' at t = 4")
    assert [x.occurrence for x in found.outcome.events] == [
        *("event", "engages", "sticks", "event", "releases")
    ]
    check_balance(found, 0.5 * 0.5 * 120**2)


def test_crank_with_friction_in_its_guide() -> None:
    name = "crank_guide_friction"
    found = run(name, **sampled(0.5, 1, 2))
    turns = [x.time for x in found.entries("slips", "guide.slip")]
    near(turns[0], name, "t of dead centre 1", 1e-10)
    near(turns[4], name, "t of dead centre 5", 1e-9)
    for t in (0.5, 1.0, 2.0):
        near(found.at(t, "phi"), name, f"phi at t = {t}", 1e-9)
        near(found.at(t, "phi'"), name, f"phi' at t = {t}", 2e-9)
        near(found.at(t, "lambda.guide"), name, f"lambda.guide at t = {t}", 2e-9)
    check_balance(found, 10)


def test_painleve_s_rod() -> None:
    name = "painleve_rod"
    found = run(name, **sampled(0.1, 2))
    entries = [x for x in found.outcome.events if x.occurrence in ("sticks", "slips", "event")]
    for k, entry in enumerate(entries, start=1):
        kind = {"sticks": "stick", "slips": "slip", "event": "flat"}[entry.occurrence]
        near(entry.time, name, f"event {k} ({kind}): t", 1e-9)
        near(found.value(entry, "x"), name, f"event {k}: x" if k < 5 else "event 5: x", 2e-9)
        near(found.value(entry, "theta'"), name, f"event {k}: theta'", 2e-9)
    assert len(entries) == 5


def test_klein_s_guides() -> None:
    name = "painleve_klein"
    found = run(name, **sampled(0.2))
    near(float(found.block.a[0, 0]), name, "x1'' at the start")
    near(found.at(0.0, "lambda.rough"), name, "lambda.rough at the start")
    near(found.at(0.2, "x1'"), name, "x1' at t = 0.2")


def test_kane_and_levinson_s_pendulum() -> None:
    name = "kane_levinson"
    found = run(name, **sampled(0.01))
    (impact,) = found.entries("impact", "floor")
    assert impact.time == 0.0
    near(found.value(impact, "q1'"), name, "poisson: q1' after")
    near(found.value(impact, "q2'"), name, "poisson: q2' after")
    near(found.impulse(impact, "floor"), name, "poisson: impulse.floor")
    near(found.impulse(impact, "floor.slip"), name, "poisson: impulse.floor_slip")
    a, b = np.radians(20), np.radians(30)
    mass = np.array([[4 / 3, np.cos(a - b) / 2], [np.cos(a - b) / 2, 1 / 3]])
    ratio = (impact.after @ mass @ impact.after) / (impact.before @ mass @ impact.before)
    near(float(ratio), name, "poisson: kinetic energy after / before")
    assert impact.loss == pytest.approx(0.5 * (1 - ratio) * impact.before @ mass @ impact.before)


@pytest.mark.parametrize("balls", [3, 4, 5])
@pytest.mark.parametrize(
    ("law", "label"),
    [("newton", "simultaneous"), ("poisson", "poisson"), ("sequential", "sequential")],
)
def test_newton_s_cradle(balls: int, law: str, label: str) -> None:
    found = run("newtons_cradle", N=balls, simulation={"times": [0, 0.6], "impacts": law})
    after = found.block.v[-1]
    for i in range(balls):
        near(float(after[i]), "newtons_cradle", f"N = {balls}, {label}: x[{i + 1}]' after")
    assert abs(sum(x.loss for x in found.outcome.events)) < 1e-12


def test_rocking_block() -> None:
    name = "rocking_block"
    found = run(name, simulation={"times": [0, 3]})
    impacts = found.entries("impact")
    first = impacts[0]
    near(first.time, name, "t of impact 1 (right)")
    near(found.value(first, "phi'", before=True), name, "phi' before impact 1")
    near(found.value(first, "phi'"), name, "phi' after impact 1")
    near(found.impulse(first, "right"), name, "impulse.right of impact 1")
    near(found.impulse(first, "right.slip"), name, "impulse.right_slip of impact 1")
    near(-first.loss, name, "energy loss of impact 1")
    near(impacts[1].time, name, "t of impact 2 (left)")
    near(impacts[9].time, name, "t of impact 10")
    near(found.entries("rest")[0].time, name, "t_rest")
    near(-sum(x.loss for x in impacts), name, "energy loss, all impacts", 3e-9)
    check_balance(found, 9.81 * 0.31)


def test_backlash() -> None:
    name = "backlash"
    # the second sequence ends where the gap closes ever more slowly
    found = run(name, simulation={"times": [0, 1.6], "closed": 1e-12})
    impacts = found.entries("impact")
    for k in (1, 2, 5):
        near(impacts[k - 1].time, name, f"t of impact {k} (front)")
        near(found.impulse(impacts[k - 1], "front"), name, f"impulse of impact {k}")
    rests, opens = found.entries("rest"), found.entries("opens")
    for k in (1, 2):
        near(rests[k - 1].time, name, f"t_rest {k}")
        near(opens[k - 1].time, name, f"t of opening {k}", 2e-9)
        near(found.value(opens[k - 1], "a"), name, f"a at opening {k}", 2e-9)
    (after,) = [x for x in impacts if x.time > opens[1].time][:1]
    near(after.time, name, "t of the first impact after opening 2")
    near(found.impulse(after, "front"), name, "its impulse")
    check_balance(found, 1)


def test_woodpecker() -> None:
    name = "woodpecker"
    found = run(name, simulation={"times": [0, 0.23]})
    names = found.system.constraints
    events = [
        (x, names[x.which].removesuffix(".slip"))
        for x in found.outcome.events
        if x.occurrence in ("sticks", "slips", "opens", "impact")
    ]
    times = {quantity: value for quantity, value in reference(name).items() if ": t" in quantity}
    for (entry, row), (quantity, value) in zip(events, times.items(), strict=False):
        occurrence = "impact" if "impact" in quantity else entry.occurrence
        assert entry.occurrence == occurrence
        assert row in quantity
        assert entry.time == pytest.approx(value, rel=2e-9), quantity
    beak = found.entries("impact", "beak")[0]
    near(found.value(beak, "phiS'"), name, "event 5: phiS' after", 2e-9)
    near(found.value(beak, "y'"), name, "event 5: y' after", 2e-9)
    near(found.impulse(beak, "beak"), name, "event 5: impulse.beak", 1e-10)
    check_balance(found, 1e-3)


def test_appell_and_hamel_s_problem() -> None:
    name = "appell_hamel"
    found = run(name, **sampled(1))
    for quantity in ("x", "y", "z", "z'", "x'"):
        near(found.at(1.0, quantity), name, f"{quantity} at t = 1")
    for t in (0.0, 1.0):
        near(found.at(t, "lambda.appell"), name, f"lambda.appell at t = {t:g}")
    near(float(found.block.a[0, 2]), name, "z''")


def test_motion_of_constant_speed() -> None:
    name = "constant_speed"
    found = run(name, **sampled(1))
    for quantity in ("x", "y", "x'", "y'"):
        near(found.at(1.0, quantity), name, f"{quantity} at t = 1")
    for t in (0.0, 1.0):
        near(found.at(t, "lambda.speed"), name, f"lambda.speed at t = {t:g}")
    near(float(found.block.work[-1]), name, "work of the constraint until t = 1")


PUSHED = """
coordinates: {x: m, y: m, phi: rad}
parameters: {m: 10 kg, g: 10 m/s^2, b: 0.2 m, h: 0.1 m, mu: 0.4}
definitions:
  x_L: x - b*cos(phi) + h*sin(phi)
  y_L: y - b*sin(phi) - h*cos(phi)
  x_R: x + b*cos(phi) + h*sin(phi)
  y_R: y + b*sin(phi) - h*cos(phi)
T: m/2*(x'^2 + y'^2) + m*(b^2 + h^2)/6*phi'^2
V: m*g*y
Q: {x: 20*t}
constraints:
  left: {expr: y_L >= 0, friction: mu, slip: x_L'}
  right: {expr: y_R >= 0, friction: mu, slip: x_R'}
initial: {x: 0, y: h, phi: 0, x': 0, y': 0, phi': 0}
simulation: {times: [0, 2.2]}
"""


def test_a_box_that_is_pushed_slides() -> None:
    """Its friction is redundant; it sticks while some distribution of it does: 20 t < mu m g."""
    found = run_contact(load_text(PUSHED))
    changes = [x for x in found.outcome.events if x.occurrence != "redundant"]
    assert [x.occurrence for x in changes] == ["slips", "slips"]
    for entry in changes:
        assert entry.time == pytest.approx(2.0, abs=1e-12)
    assert found.at(2.2, "x'") == pytest.approx(0.04, rel=1e-9)  # ∫ 2 (t − 2) dt


def test_a_box_that_is_pushed_tips() -> None:
    """A higher one, where 20 t h = b m g; it turns about its right corner, which sticks."""
    found = run_contact(load_text(PUSHED, set={"h": 0.7}))
    (opens,) = (x for x in found.outcome.events if x.occurrence != "redundant")
    assert (opens.occurrence, opens.which) == ("opens", 0)
    assert opens.time == pytest.approx(0.2 * 100 / (20 * 0.7), abs=1e-12)
    assert found.at(2.2, "phi") < -0.01


TABLE_OF_FOUR_LEGS = """
coordinates: {z: m, a: rad, c: rad}
parameters: {m: 10 kg, g: 10 m/s^2, b: 0.5 m, W: 20 N*m/s}
T: m/2*z'^2 + m*b^2/6*(a'^2 + c'^2)
V: m*g*z
Q: {a: W*t, c: 2*W*t}
constraints:
  one: z + b*a + b*c >= 0
  two: z + b*a - b*c >= 0
  three: z - b*a - b*c >= 0
  four: z - b*a + b*c >= 0
initial: {z: 0, a: 0, c: 0, z': 0, a': 0, c': 0}
simulation: {times: [0, 1, 1.3]}
"""


def test_a_table_of_four_legs_tips() -> None:
    """Where the load reaches an edge, 2 W t = b m g; by least norm a leg would let go before."""
    found = run_contact(load_text(TABLE_OF_FOUR_LEGS))
    changes = [x for x in found.outcome.events if x.occurrence != "redundant"]
    names = [found.system.constraints[x.which] for x in changes]
    assert [x.occurrence for x in changes] == ["opens", "opens"]
    assert names == ["one", "four"]
    for entry in changes:
        assert entry.time == pytest.approx(1.25, abs=1e-12)
    legs = [found.at(1.0, f"lambda.{leg}") for leg in ("one", "two", "three", "four")]
    np.testing.assert_allclose(legs, [0, 30, 60, 10], atol=1e-9)
    check_balance(found, 1)


SLIDING_TABLE = """
coordinates: {x: m, z: m, a: rad, c: rad}
parameters: {m: 10 kg, g: 10 m/s^2, b: 0.5 m, h: 0.2 m, mu: 0.3, W: 20 N*m/s}
T: m/2*(x'^2 + z'^2) + m*b^2/6*(a'^2 + c'^2)
V: m*g*z
Q: {a: W*t, c: 2*W*t}
constraints:
  one: {expr: z + b*a + b*c >= 0, friction: mu, slip: x' - h*c'}
  two: {expr: z + b*a - b*c >= 0, friction: mu, slip: x' - h*c'}
  three: {expr: z - b*a - b*c >= 0, friction: mu, slip: x' - h*c'}
  four: {expr: z - b*a + b*c >= 0, friction: mu, slip: x' - h*c'}
initial: {x: 0, z: 0, a: 0, c: 0, x': 5, z': 0, a': 0, c': 0}
simulation: {times: [0, 1, 1.2]}
"""


def test_a_table_of_four_legs_tips_as_it_slides() -> None:
    """Friction turns it, too: 2 W t + h mu m g = b m g."""
    found = run_contact(load_text(SLIDING_TABLE))
    changes = [x for x in found.outcome.events if x.occurrence != "redundant"]
    names = [found.system.constraints[x.which] for x in changes]
    assert [x.occurrence for x in changes] == ["opens", "opens"]
    assert names == ["one", "four"]
    for entry in changes:
        assert entry.time == pytest.approx(1.1, abs=1e-12)
    legs = [found.at(1.0, f"lambda.{leg}") for leg in ("one", "two", "three", "four")]
    np.testing.assert_allclose(legs, [0, 30, 66, 4], atol=1e-9)
    friction = [found.at(1.0, f"lambda.{leg}.slip") for leg in ("one", "two", "three", "four")]
    np.testing.assert_allclose(friction, -0.3 * np.array(legs), atol=1e-9)


@pytest.mark.parametrize("count", [30, pytest.param(1000, marks=pytest.mark.slow)])
def test_many_bounces(count: int) -> None:
    """t_{k+1} − t_k = 2 e^k v/g, with e = 1 − 1/count."""
    e, g = 1 - 1 / count, 9.81
    v = np.sqrt(2 * g)
    times = v / g + np.concatenate([[0], np.cumsum(2 * e ** np.arange(1, count) * v / g)])
    end = float(times[-1]) + 0.01
    simulation = {"times": [0, end], "t_end": end}
    found = run("bouncing_ball", e=e, simulation=simulation)
    impacts = [x.time for x in found.entries("impact")]
    # each impact adds the rounding of its time
    np.testing.assert_allclose(impacts, times, rtol=1e-11)
    check_balance(found, 2 * g)


TABLE = """
coordinates: {y: m}
parameters: {m: 1 kg, g: 9.81 m/s^2, A: 0.05 m, w: 20 rad/s}
T: m/2*y'^2
V: m*g*y
constraints:
  table: {expr: y - A*sin(w*t) >= 0, restitution: 0.3}
initial: {y: 0, y': 1}
simulation: {t_end: 3, samples: 31}
"""


def test_a_ball_on_a_shaken_table() -> None:
    """It is thrown where A w² sin(w t) = g, and what the table supplies and takes is its energy."""
    found = run_contact(load_text(TABLE))
    assert found.outcome.status == "completed", found.outcome.message
    opens = found.entries("opens")[0]
    assert opens.time == pytest.approx(np.arcsin(9.81 / 20) / 20, abs=1e-11)
    impact = found.entries("impact")[0]
    table = 0.05 * 20 * np.cos(20 * impact.time)
    before, after = (found.value(impact, "y'", before=x) for x in (True, False))
    assert after - table == pytest.approx(-0.3 * (before - table), rel=1e-9)
    gained = 0.5 * (after**2 - before**2)
    assert impact.supplied - impact.loss == pytest.approx(gained, rel=1e-9)
    assert found.entries("rest")
    check_balance(found, 1)


SNAP = """
coordinates: {x: m, y: m}
parameters: {m: 1 kg, g: 9.81 m/s^2, l: 1 m, F: 20}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints:
  rod: x^2 + y^2 = l^2
events:
  snap: {when: -2*l*lambda.rod >= F, release: rod}
initial: {x: l, y: 0, x': 0, y': 0}
simulation: {times: [0, 1]}
"""


def test_a_rod_that_snaps() -> None:
    """The tension is 3 m g sin, so it is F where y = -F/(3 m g); then a parabola."""
    found = run_contact(load_text(SNAP))
    (snap,) = found.entries("event", "snap")
    depth = 20 / (3 * 9.81)
    assert found.value(snap, "y") == pytest.approx(-depth, rel=1e-10)
    left = 1 - snap.time
    x = found.value(snap, "x") + left * found.value(snap, "x'")
    assert found.at(1.0, "x") == pytest.approx(x, rel=1e-10)
    assert found.at(1.0, "lambda.rod") == 0
    check_balance(found, 9.81)
