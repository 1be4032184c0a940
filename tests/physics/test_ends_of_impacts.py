"""Infinitely many impacts in finite time: where they end, what they do, and the rest after them."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from random_cases import seeds

import lagcli
from lagcli.trajectory.event_log import EventLog
from lagcli.trajectory.trajectory import Trajectory
from tests.support.switching_models import KANE

FOUND = Path(__file__).parents[1] / "found"
LAWS = ("poisson", "newton", "sequential")


def simulate(text: str, **settings: object) -> tuple[Trajectory, EventLog]:
    run = lagcli.simulate(lagcli.load_text(text), **settings)  # type: ignore[arg-type]
    assert run.events is not None
    assert run.status == "completed"
    return run, run.events


def assert_admissible(
    run: Trajectory, log: EventLog, signs: dict[str, int], mu: float, energy: float
) -> None:
    """Impulses and λ have their sign and are within the cones; no instant gains energy."""
    names = list(run.constraints)
    largest = np.abs(run.multipliers).max()
    for name, sign in signs.items():
        k = names.index(name)
        assert (sign * log.impulse[:, k] >= 0.0).all(), name
        assert (sign * run.multipliers[:, k] >= -1e-9 * largest).all(), name
        if f"{name}.slip" not in names:
            continue
        along = names.index(f"{name}.slip")
        rounding = 1e-12 * np.abs(log.impulse).max(initial=0.0)
        bound = mu * np.abs(log.impulse[:, k]) * (1 + 1e-8) + rounding
        assert (np.abs(log.impulse[:, along]) <= bound).all(), name
        bound = mu * np.abs(run.multipliers[:, k]) * (1 + 1e-6) + 1e-8 * largest
        assert (np.abs(run.multipliers[:, along]) <= bound).all(), name
    for time in np.unique(log.time):
        assert log.loss[log.time == time].sum() >= -1e-9 * energy
    assert np.abs(run.energy_balance).max() <= 1e-8 * energy


def balls(count: int) -> Iterator[tuple[str, float, float, float]]:
    """Random balls above a floor that may move: text, time of rest, e, weight on the floor."""
    for seed in range(count):
        rng = random.Random(seed)
        length, time = rng.choice([1e-6, 1e-3, 1.0, 1e3]), rng.choice([1e-12, 1e-3, 1.0, 3600.0])
        g = 9.81 * length / time**2 * 10 ** rng.uniform(-1, 1)
        h, m = length * 10 ** rng.uniform(-1, 0.5), 10 ** rng.uniform(-6, 3)
        e = rng.choice([0, 1e-3, 0.1, 0.5, 0.9, 0.99, 0.999, rng.random()])
        v = math.sqrt(g * h)
        up, along = rng.uniform(-1, 1) * v, rng.uniform(-3, 3) * v
        floor = rng.choice([(0.0, 0.0), (rng.uniform(-0.5, 0.5) * v, rng.uniform(-0.5, 0.5) * g)])
        slope = rng.choice([0.0, rng.uniform(-1, 1)])
        weight, relative = g * math.cos(slope) + floor[1], up - floor[0]
        strikes = math.sqrt(relative**2 + 2 * weight * h)
        rest = (relative + strikes) / weight + 2 * strikes * e / weight / (1 - e)
        friction = rng.choice(["", f", friction: {rng.uniform(0, 1.5)!r}, slip: x'"])
        text = f"""
coordinates: [x, y]
T: {m!r}/2*(x'^2 + y'^2)
V: {m * g * math.cos(slope)!r}*y + {m * g * math.sin(slope)!r}*x
constraints:
  floor: {{expr: "y >= {floor[0]!r}*t + {floor[1]!r}*t^2/2", restitution: {e!r}{friction}}}
initial: {{x: 0, y: {h!r}, x': {along!r}, y': {up!r}}}
simulation:
  {{t_end: {1.5 * rest!r}, samples: 31, max_steps: 200000, impacts: {rng.choice(LAWS)}}}
"""
        yield text, rest, e, m * weight


@pytest.mark.parametrize("part", range(4))
def test_balls(part: int) -> None:
    """t = t₁ + 2 v₁ e/(g (1 − e)), in any units, by all laws, on moving floors, with friction."""
    for text, rest, e, weight in list(balls(60))[part::4]:
        run, log = simulate(text)
        found = [x.time for x in log.rests()] if e else log.instants("floor", "closes")
        assert found == pytest.approx([rest], rel=1e-6 if e > 0.99 else 2e-8), text
        after = run.time > rest * (1 + 1e-6)
        assert run.multipliers[after, 0] == pytest.approx(weight, rel=1e-6), text
        assert log.modes[-1][0] == 1
        assert (log.impulse[:, 0] >= 0.0).all()


def ball_and_block(
    c: float,
    g: float,
    e: float,
    limit: str,
    start: tuple[float, float],
    end: float,
    rng: random.Random,
) -> str:
    """Return a ball that drags a block along, M = [[1, c], [c, 1]], from its height and the block's
    speed."""
    return f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2 + {c!r}*x'*y'
V: {g!r}*y
constraints:
  floor: {{expr: y >= 0, restitution: {e!r}}}
  block: {{expr: x' = 0, limit: {limit}}}
initial: {{x: 0, y: {start[0]!r}, x': {start[1]!r}, y': 0}}
simulation: {{t_end: {end!r}, samples: 14, impacts: {rng.choice(LAWS)}}}
"""


def test_friction_beside_the_contact_changes_the_fall() -> None:
    """A ball that drags a sliding block along: M = [[1, c], [c, 1]], forces −F and −g.

    While the block slides, y″ = −a = −(g − c F)/(1 − c²) in each flight; at rest λ = g − c F.
    """
    rng = random.Random(1)
    for _ in range(12):
        c, e = rng.uniform(-0.8, 0.8), rng.choice([0.2, 0.5, 0.8, rng.random() * 0.9])
        g, h, force = 10 ** rng.uniform(-1, 2), 10 ** rng.uniform(-2, 1), rng.uniform(0.05, 1.0)
        friction = force * g / max(abs(c), 0.5)
        a = (g - c * friction) / (1 - c * c)
        first = math.sqrt(2 * h / a)
        rest = first * (1 + e) / (1 - e)
        along = rng.choice([-1, 1])
        speed = along * 20 * (g + friction) * rest
        run, log = simulate(
            ball_and_block(along * c, g, e, repr(friction), (h, speed), 1.3 * rest, rng)
        )
        assert log.instants("floor", "impact")[0] == pytest.approx(first, rel=1e-9)
        assert [x.time for x in log.rests()] == pytest.approx([rest], rel=2e-8)
        assert run.multipliers[-1] == pytest.approx([g - c * friction, -along * friction])


def test_a_block_that_slides_after_each_impact_and_sticks_then() -> None:
    """M = [[1, c], [c, 1]], as above: all velocities after an impact are R times those before it.

    The impact with speed u gives the block the speed c (1 + e) u, and friction F stops it while the
    ball falls; then the ball has y″ = −g.
    """
    rng = random.Random(3)
    for _ in range(6):
        c, e, g = rng.uniform(0.2, 0.6), rng.uniform(0.3, 0.8), rng.uniform(5, 12)
        friction, h = rng.uniform(12.0, 25.0), rng.uniform(0.1, 2)
        stops = c * (1 + e) * (1 - c * c) / (friction + c * g)  # for u = 1
        y = e * stops - (g + c * friction) / (1 - c * c) * stops**2 / 2
        v = e - (g + c * friction) / (1 - c * c) * stops
        assert y > 0
        ratio = math.sqrt(v * v + 2 * g * y)
        flight = stops + (v + ratio) / g
        u = math.sqrt(2 * g * h)
        rest = u / g + u * flight / (1 - ratio)
        for sign in (-1, 1):
            limit = f"{{static: 30, kinetic: {friction!r}}}"
            text = ball_and_block(sign * c, g, e, limit, (h, 0.0), 1.3 * rest, rng)
            run, log = simulate(text)
            assert [x.time for x in log.rests()] == pytest.approx([rest], rel=2e-8)
            finer, _ = simulate(text, closed=1e-13)
            assert run.q[-1] == pytest.approx(finer.q[-1], abs=1e-7)


def test_what_slides_has_the_friction_of_the_impacts_that_are_left() -> None:
    """A ball bounces and slides: the impulses are m (g t − v₀), and u = u₀ − μ (g t − v₀)."""
    rng = random.Random(5)
    for number in range(12):
        mu, e, g = rng.uniform(0.05, 0.5), rng.choice([0.2, 0.5, 0.8]), rng.uniform(3, 15)
        u, v, m = rng.choice([-1, 1]) * rng.uniform(20, 40), rng.uniform(-2, 0.5), rng.uniform(1, 9)
        run, log = simulate(f"""
coordinates: [x, y]
T: {m!r}/2*(x'^2 + y'^2)
V: {m * g!r}*y
constraints:
  floor: {{expr: y >= 0, restitution: {e!r}, friction: {mu!r}, slip: x'}}
initial: {{x: 0, y: {0.1 * rng.random()!r}, x': {u!r}, y': {v!r}}}
simulation: {{t_end: 3, samples: 2, impacts: {LAWS[number % 3]}}}
""")
        assert len(list(log.rests())) == 1
        exact = math.copysign(abs(u) - mu * (3 * g - v), u)
        assert run.v[-1] == pytest.approx([exact, 0], rel=1e-12, abs=1e-12)


def test_a_guide_has_the_friction_of_the_impacts_that_are_left() -> None:
    """A ball on an inclined guide, z = c y, whose friction is μ times the sum of all its impulses.

    In flights y″ = −a = −g/(1 + c²) and the guide's force is m c a; in impacts with the speed w its
    impulse is m c (1 + e) w; at rest it bears nothing.
    """
    rng = random.Random(6)
    for number in range(9):
        mu, e, c = rng.uniform(0.05, 0.5), rng.choice([0.2, 0.5, 0.7]), rng.uniform(0.1, 0.8)
        h, u, m = rng.uniform(0.01, 0.2), rng.choice([-30.0, 30.0]), rng.uniform(1, 9)
        a = 9.81 / (1 + c * c)
        first = math.sqrt(2 * h / a)
        rest = first * (1 + e) / (1 - e)
        impulses = c * (a * rest + (1 + e) * a * first / (1 - e))
        run, log = simulate(f"""
coordinates: [x, y, z]
T: {m!r}/2*(x'^2 + y'^2 + z'^2)
V: {m * 9.81!r}*y
constraints:
  guide: {{expr: "z = {c!r}*y", friction: {mu!r}, slip: x'}}
  floor: {{expr: y >= 0, restitution: {e!r}}}
initial: {{x: 0, y: {h!r}, z: {c * h!r}, x': {u!r}, y': 0, z': 0}}
simulation: {{t_end: {1.5 * rest!r}, samples: 2, impacts: {LAWS[number % 3]}}}
""")
        assert [x.time for x in log.rests()] == pytest.approx([rest], rel=1e-8)
        exact = math.copysign(abs(u) - mu * impulses, u)
        assert run.v[-1] == pytest.approx([exact, 0, 0], rel=2e-10, abs=1e-10)


RODS = """
T: 0.8087/2*(x0'^2 + y0'^2) + 1.485/2*(x1'^2 + y1'^2)
V: 9.81*(0.8087*y0 + 1.485*y1)
outputs: {px0: x0, py0: y0, px1: x1, py1: y1}
simulation: {t_end: 1.319, samples: 5}
constraints:
  floor0: {expr: y0 >= 0, restitution: 0.5, friction: 0.5, slip: x0'}
  floor1: {expr: y1 >= 0, restitution: 0.5, friction: 0.5, slip: x1'}
"""
X, VX, VY0, VY1 = 0.304350584071124, 2.2165628743325216, 1.0785859581142794, 2.1879127200936574


def test_two_masses_that_stick_on_a_rod_rest_as_one_body() -> None:
    """Their frictions are redundant with the rod, and contradict each other by rounding errors."""
    points, _ = simulate(f"""
coordinates: [x0, y0, x1, y1]
{RODS}
  rod: (x1 - x0)^2 + (y1 - y0)^2 = 0.8475^2
initial:
  {{x0: 0, y0: {X}, x1: 0.8475, y1: {X}, x0': {VX}, y0': {VY0}, x1': {VX}, y1': {VY1}}}
""")
    body, _ = simulate(f"""
coordinates: [x0, y0, a]
definitions: {{x1: x0 + 0.8475*cos(a), y1: y0 + 0.8475*sin(a)}}
{RODS}
initial: {{x0: 0, y0: {X}, a: 0, x0': {VX}, y0': {VY0}, a': {(VY1 - VY0) / 0.8475!r}}}
""")
    for name in ("px0", "py0", "px1", "py1"):
        assert points.outputs[name] == pytest.approx(body.outputs[name], abs=1e-8)


@pytest.mark.parametrize("speed", [0.0, 1.0, 1e3])
def test_redundant_contacts_rest_when_one_does(speed: float) -> None:
    """Two contacts in one place share all impulses; λ is not unique from the time of rest on."""
    e, h = 0.5, 1.0
    contact = f"{{expr: y >= {speed!r}*t, restitution: {e}, friction: 0.2, slip: x'}}"
    _, log = simulate(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints:
  left: {contact}
  right: {contact}
initial: {{x: 0, y: {h}, x': 30, y': {speed!r}}}
simulation: {{t_end: 2, samples: 2}}
""")
    rest = math.sqrt(2 * h / 9.81) * (1 + e) / (1 - e)
    for kind in ("rest", "redundant"):
        for name in ("left", "right"):
            assert log.instants(name, kind) == pytest.approx([rest], rel=1e-9)


def test_forces_by_multipliers_act_in_what_is_left_of_a_sequence() -> None:
    """A rail bears the force N, and its friction pulls the ball down by μ N: y″ = −g − μ N."""
    for e, mu, law in zip((0.3, 0.6, 0.9), (0.5, -0.2, 0.1), LAWS, strict=True):
        a = 9.81 + mu * 7
        rest = math.sqrt(2 / a) * (1 + e) / (1 - e)
        _, log = simulate(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y + 7*x
Q: {{y: {-mu}*lambda.rail}}
constraints: {{rail: x = 0, floor: {{expr: y >= 0, restitution: {e}}}}}
initial: {{x: 0, y: 1, x': 0, y': 0}}
simulation: {{t_end: {1.1 * rest!r}, impacts: {law}}}
""")
        assert [x.time for x in log.rests()] == pytest.approx([rest], rel=1e-9)


@pytest.mark.parametrize("mass", [1e-12, 1.0, 1e12])
def test_velocities_tell_states_of_a_sequence_apart_whose_gaps_are_closed(mass: float) -> None:
    """Two contacts strike together; the second one then rests before the first strikes again.

    A = [[1, -1/2], [-1/2, 1]], b = (-g, -G): the impulses of the second are in the mean the force
    by which it rests, so that the first one has x″ = -g - G/2.
    """
    e, small, g, load = 0.5, 1e-3, 3.0, 20.0
    for w in (0.2, 0.4, 0.8):
        t, v, x, bounce = 0.5, 1.0, 0.0, w  # after the first impact
        start = [
            (speed, speed * t - by * t**2 / 2) for speed, by in ((v / e, g), (w / small, load))
        ]
        for _ in range(8):
            flight = 2 * bounce / load
            x += v * flight - g * flight**2 / 2
            v -= g * flight + (1 + small) * bounce / 2
            t, bounce = t + flight, small * bounce
        a = g + load / 2
        strikes = math.sqrt(v * v + 2 * a * x)
        rest = t + (v + strikes) / a + 2 * strikes * e / a / (1 - e)
        (u, above), (fast, high) = start
        _, log = simulate(f"""
coordinates: [x, y]
parameters: {{m: {4 / 3 * mass}}}
T: m*(x'^2 + x'*y' + y'^2)/2
V: m*({g + load / 2}*x + {g / 2 + load}*y)
constraints:
  first: {{expr: x >= 1000, restitution: {e}}}
  second: {{expr: y >= 1000, restitution: {small}}}
initial: {{x: {1000 + above}, y: {1000 + high}, x': {g / 2 - u}, y': {load / 2 - fast}}}
simulation: {{t_end: 2, closed: 2e-4, impacts: newton}}
""")
        assert [x.time for x in log.rests()] == pytest.approx([rest] * 2, rel=1e-11)


@pytest.mark.parametrize(
    ("c", "falls", "e", "speeds"),
    [
        (0.28, (3.9, 0.5), (0.83, 0.29), (0.8, 0.4)),
        (0.72, (0.5, 4.3), (0.25, 0.87), (1.4, 1.6)),
        (0.67, (0.6, 3.7), (0.21, 0.89), (1.0, 1.8)),
    ],
)
def test_contacts_that_strike_in_turn_rest_at_the_limit_of_their_flights(
    c: float, falls: tuple[float, float], e: tuple[float, float], speeds: tuple[float, float]
) -> None:
    """Free parabolas between impacts of one contact, until they are 1e-15 of the whole time.

    x and y are coupled by c/2 of their mass; both strike at first, then the other one is open.
    """
    fall, restitution = np.array(falls), np.array(e)
    mass = np.array([[1.0, c / 2], [c / 2, 1.0]])
    inverse, load = np.linalg.inv(mass), mass @ fall
    gap, speed, rest, flight = np.zeros(2), restitution * speeds, 0.0, math.inf
    while flight > 1e-15 * rest:
        flights = (speed + np.sqrt(speed**2 + 2 * fall * gap)) / fall
        k = int(flights.argmin())
        flight = flights[k]
        gap = gap + flight * (speed - fall * flight / 2)
        speed = speed - fall * flight
        speed = speed - inverse[k] * (1 + restitution[k]) * speed[k] / inverse[k, k]
        gap[k] = 0.0
        rest += flight
    _, log = simulate(f"""
coordinates: [x, y]
T: (x'^2 + {c}*x'*y' + y'^2)/2
V: {load[0]}*x + {load[1]}*y
constraints:
  first: {{expr: x >= 1000, restitution: {e[0]}}}
  second: {{expr: y >= 1000, restitution: {e[1]}}}
initial: {{x: 1000, y: 1000, x': {-speeds[0]}, y': {-speeds[1]}}}
simulation: {{t_end: 4, closed: 1e-3, impacts: newton}}
""")
    assert [x.time for x in log.rests()] == pytest.approx([rest] * 2, rel=1e-11)


def scaled(text: str, scale: float) -> str:
    """Return a model whose masses and forces are larger by a factor."""
    return re.sub(r"^([TV]): (.*)$", rf"\1: {scale!r}*(\2)", text, flags=re.MULTILINE)


@pytest.mark.parametrize("number", range(4))
def test_impacts_do_not_depend_on_the_unit_of_mass(number: int) -> None:
    """Larger masses and forces have the same motion, and as much larger impulses."""
    for seed in (3 * number, 3 * number + 1):
        text, *_ = (ropes, groove, stack, box)[number](seed)
        run, log = simulate(text)
        for scale in (2.0**40, 2.0**-40):
            other, changes = simulate(scaled(text, scale))
            ends, expected = (sorted(x.time for x in of.rests()) for of in (changes, log))
            assert ends == pytest.approx(expected, rel=1e-8)
            assert changes.time[:10] == pytest.approx(log.time[:10], rel=1e-9)
            size = np.abs(log.impulse).max(initial=0.0)
            assert np.abs(changes.impulse).max(initial=0.0) == pytest.approx(scale * size, rel=1e-9)
            largest = np.abs(run.q).max()
            np.testing.assert_allclose(other.q, run.q, rtol=0, atol=1e-7 * largest)


def test_the_last_impact_obeys_its_law_and_the_rest_has_the_remaining_energy() -> None:
    text = """
coordinates: [y]
T: y'^2/2
V: 9.81*y
constraints: {floor: {expr: y >= 0, restitution: 0.5}}
initial: {y: 1, y': 0}
simulation: {t_end: 2}
"""
    for law in LAWS:
        _, log = simulate(text, impacts=law)
        impacts = np.flatnonzero([kind == "impact" for kind in log.kinds])
        assert log.after[impacts, 0] == pytest.approx(-0.5 * log.before[impacts, 0], rel=1e-12)
        assert log.impulse[impacts, 0] == pytest.approx(-1.5 * log.before[impacts, 0], rel=1e-12)
        (rest,) = np.flatnonzero([kind == "rest" for kind in log.kinds])
        assert log.before[rest] == pytest.approx(log.after[impacts[-1]])
        assert log.after[rest].tolist() == [0.0]
        assert log.loss[rest] == pytest.approx(log.before[rest, 0] ** 2 / 2)
        assert log.loss.sum() == pytest.approx(9.81, rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_coefficients_of_impacts_are_those_of_the_instant(law: str) -> None:
    """A ball falls from 1 m at g = 2 m/s² and strikes at 1 s with e = 0.5, at 2 s with 0.8."""
    _, log = simulate(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 2*y
constraints:
  floor: {{expr: y >= 0, restitution: 0.2 + 0.3*t, friction: 0.1*x, slip: x'}}
initial: {{x: 0, y: 1, x': 1, y': 0}}
simulation: {{t_end: 2.5, samples: 2, impacts: {law}}}
""")
    assert log.kinds == ("impact", "impact")
    assert log.time == pytest.approx([1.0, 2.0], rel=1e-12)
    # friction 0.1 x of the impulse: x = 1 at first, then slower by 0.1 · 3
    assert log.after[0] == pytest.approx([0.7, 1.0], rel=1e-12)
    assert log.after[1] == pytest.approx([0.7 - 0.17 * 1.8, 0.8], rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_impacts_that_begin_and_end_as_the_run_starts(law: str) -> None:
    """Their rest is listed, and has the energy that they lose: v²/2 in all."""
    v, e, g = 1e-4, 0.5, 9.81
    _, log = simulate(f"""
coordinates: [y]
T: y'^2/2
V: {g}*y
constraints: {{floor: {{expr: y >= 1, restitution: {e}}}}}
initial: {{y: 1, y': {-v}}}
simulation: {{t_end: 1, samples: 2, impacts: {law}}}
""")
    assert log.kinds == ("impact", "rest")
    assert log.time == pytest.approx([0, 2 * e * v / g / (1 - e)])
    assert log.loss == pytest.approx([v * v / 2 * (1 - e * e), v * v / 2 * e * e])


def test_a_rest_after_the_run_is_not_listed() -> None:
    """A ball with e = 0.99 bounces lower than the tolerance long before it rests."""
    text = """
coordinates: [y]
T: y'^2/2
V: 9.81*y
constraints: {floor: {expr: y >= 0, restitution: 0.99}}
initial: {y: 1e-6, y': 0}
simulation: {samples: 11, max_steps: 20000}
"""
    rest = math.sqrt(2e-6 / 9.81) * (1 + 2 * 0.99 / 0.01)
    _, log = simulate(text, t_end=1.01 * rest)
    assert [x.time for x in log.rests()] == pytest.approx([rest], rel=1e-7)
    last = log.instants("floor", "impact")[-1]
    _, log = simulate(text, t_end=(last + rest) / 2)
    assert log.rests() == []
    assert (log.time <= (last + rest) / 2).all()
    assert log.kinds[-1] == "closes"


def test_two_ropes_that_tighten_in_turn() -> None:
    """Intervals d₁, d₂, d₃ of alternating impacts: R = d₃/d₁, and (d₂ + d₃) R/(1 − R) remains."""
    run, log = simulate((FOUND / "planar_cable_robot.yaml").read_text())
    impacts = np.sort(np.concatenate([log.instants(f"rope{k}", "impact") for k in (1, 2)]))
    first, second, third = np.diff(impacts[-4:])
    ratio = third / first
    limit = impacts[-1] + (second + third) * ratio / (1 - ratio)
    assert limit == pytest.approx(0.520887, abs=1e-6)
    assert [(x.name, x.impacts) for x in log.rests()] == [("rope1", 3), ("rope2", 2)]
    assert [x.time for x in log.rests()] == pytest.approx([limit] * 2, abs=5e-8)
    assert run.v[run.time > limit] == pytest.approx(0.0, abs=1e-12)
    assert_admissible(run, log, {"rope1": -1, "rope2": -1}, 0.0, 20.0)


def test_a_ball_that_is_thrown_again_rests_again() -> None:
    """Each throw lasts 2 v/g /(1 - e), whatever impacts there were before."""
    throws, e, g = (3.0, 2.0, 2.5, 0.5), 0.5, 9.81
    events = "\n".join(
        f"  throw{k}: {{when: t >= {2 * k + 1}, impulse: {{y: {v!r}}}}}"
        for k, v in enumerate(throws)
    )
    run, log = simulate(f"""
coordinates: [y]
T: y'^2/2
V: {g}*y
constraints: {{floor: {{expr: y >= 0, restitution: {e}}}}}
initial: {{y: 0, y': 0}}
events:
{events}
simulation: {{t_end: 8, samples: 9}}
""")
    rests = [x.time for x in log.rests() if x.time > 1]
    expected = [2 * k + 1 + 2 * v / g / (1 - e) for k, v in enumerate(throws)]
    assert rests == pytest.approx(expected, rel=1e-9)
    assert run.v[-1, 0] == 0.0


def test_a_constraint_that_moves_supplies_energy_in_impacts() -> None:
    """Its impulse times its velocity; what an impact loses is apart."""
    run, log = simulate("""
coordinates: [x, y, z]
parameters: {u: 0.7, g: 9.81}
T: 3*x'^2/4 + 3*y'^2/2 + z'^2
V: 2*g*x
constraints:
  lever: z = 0.5*x
  drive: y - 0.3*x = u*t
  floor: {expr: x + 2*y >= 0, restitution: 0.4}
initial: {x: 1, y: {guess: 0.3}, z: {guess: 0.5}, x': -4, y': {guess: 0}, z': {guess: 0}}
simulation: {t_end: 1.0, samples: 41, rtol: 1e-11}
""")
    assert log.kinds.count("impact") > 2
    assert log.supplied == pytest.approx(0.7 * log.impulse[:, 1], rel=1e-12)
    kinetic = log.after[:, 0] ** 2 + 1.5 * log.after[:, 1] ** 2
    kinetic -= log.before[:, 0] ** 2 + 1.5 * log.before[:, 1] ** 2
    assert kinetic == pytest.approx(log.supplied - log.loss, rel=1e-10)
    # the work that samples record contains it
    assert np.abs(run.energy_balance).max() < 1e-11


def test_a_block_that_falls_flat_has_no_negative_impulse() -> None:
    run, log = simulate((FOUND / "impulse_sign.yaml").read_text())
    signs = {f"f{k}": 1 for k in range(4)} | {f"w{k}": -1 for k in range(4)}
    assert_admissible(run, log, signs, 1.16, 50.0)
    assert {x.name for x in log.rests()} == {"f0", "f1"}


@pytest.mark.parametrize("scale", [2.0**-40, 1.0, 2.0**40])
def test_a_gain_by_rounding_is_none(scale: float) -> None:
    run, log = simulate(scaled((FOUND / "sequential_gain.yaml").read_text(), scale))
    assert_admissible(run, log, {f"f{k}": 1 for k in range(4)}, 0.023, 37.8 * scale)


@pytest.mark.parametrize(("mass", "rate"), [(1.0, 1.0), (1e3, 1e3)])
def test_a_gain_counts_next_to_the_energy_of_the_largest_velocities_so_far(
    mass: float, rate: float
) -> None:
    """Kane and Levinson's pendulum, which gains 1.757611 of its energy under Newton's law.

    It turns with `rate` at first; then the impact with 0.1 of a part of it.
    """
    inertia = np.array([[4 / 3, math.cos(math.radians(10)) / 2], [0.0, 1 / 3]])
    inertia[1, 0] = inertia[0, 1]
    for part, refused in ((1e-4, True), (1e-8, False)):
        v = -rate * part * np.array([0.1, 0.2])
        start = f"""q1: a, q2: b, "q1'": {v[0]}, "q2'": {v[1]}"""
        text = KANE.replace("m: 1 kg", f"m: {mass!r} kg")
        text = text.replace("q1': -0.1, q2': -0.2", f"q1': {rate!r}, q2': {rate!r}")
        run = lagcli.simulate(
            lagcli.load_text(f"""{text}
events:
  slow: {{when: t >= {0.001 / rate!r}, times: 1, set: {{{start}}}}}
simulation: {{t_end: {0.002 / rate!r}, samples: 3, impacts: newton}}
""")
        )
        gain = 1.757611078697391955669194 * mass * (v @ inertia @ v) / 2
        if refused:
            assert run.status == "failed"
            assert f"would gain {gain:.4g} J" in run.message
        else:
            assert run.status == "completed"
            assert run.events is not None
            loss = run.events.loss[run.events.kinds.index("impact")]
            assert loss == pytest.approx(-gain, rel=1e-4)


def test_the_drift_of_a_velocity_is_no_impact() -> None:
    _, log = simulate((FOUND / "baumgarte_drift.yaml").read_text())
    assert "impact" not in log.kinds
    assert log.counts()["a"] == log.counts()["b"] == {"event": 3}


@pytest.mark.parametrize("law", LAWS)
def test_a_rocking_block_comes_to_rest(law: str) -> None:
    """Housner 1963: ω⁺/ω⁻ = 1 − 3/2 sin²α at each impact of a corner, α = atan(b/h)."""
    b, h = 0.1, 0.4
    text = f"""
coordinates: [x, y, phi]
parameters: {{b: {b}, h: {h}}}
definitions:
  X_l: x - b*cos(phi) + h*sin(phi)
  Y_l: y - b*sin(phi) - h*cos(phi)
  X_r: x + b*cos(phi) + h*sin(phi)
  Y_r: y + b*sin(phi) - h*cos(phi)
T: (x'^2 + y'^2)/2 + (b^2 + h^2)/6*phi'^2
V: 9.81*y
constraints:
  left: {{expr: Y_l >= 0, friction: 0.9, slip: X_l'}}
  right: {{expr: Y_r >= 0, friction: 0.9, slip: X_r'}}
initial: {{x: 0, y: b*sin(0.15) + h*cos(0.15), phi: 0.15, x': 0, y': 0, phi': 0}}
simulation: {{t_end: 6, impacts: {law}}}
"""
    run, log = simulate(text)
    signs = {"left": 1, "right": 1}
    assert_admissible(run, log, signs, 0.9, 10.0)
    ratio = 1 - 1.5 * math.sin(math.atan(b / h)) ** 2
    impacts = np.flatnonzero([kind == "impact" for kind in log.kinds])
    spins = log.after[impacts, 2] / log.before[impacts, 2]
    assert spins[:20] == pytest.approx(ratio, rel=1e-6)
    # half periods of the linear block shrink with ω: their sum, by the last two of them
    times = log.time[impacts]
    limit = times[-1] + (times[-1] - times[-2]) * ratio / (1 - ratio)
    assert log.rests()[-1].time == pytest.approx(limit, rel=1e-6)
    assert run.v[run.time > limit] == pytest.approx(0.0, abs=1e-10)


def ropes(seed: int) -> tuple[str, dict[str, int], float, float]:
    """A mass on two ropes."""
    rng = random.Random(seed)
    length, time = rng.choice([1e-6, 1.0, 1e3]), rng.choice([1e-9, 1.0, 3600.0])
    v, g = length / time, 9.81 * length / time**2
    first, second = (length * rng.uniform(1.05, 1.9) for _ in range(2))
    right, up = (v * rng.uniform(-1, 1) for _ in range(2))
    text = f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: {g!r}*y
constraints:
  rope1: {{expr: "hypot(x + {length!r}, y) <= {first!r}", restitution: 0}}
  rope2: {{expr: "hypot(x - {length!r}, y) <= {second!r}", restitution: 0}}
initial: {{x: 0, y: {-0.1 * length!r}, x': {right!r}, y': {up!r}}}
simulation: {{t_end: {4 * time!r}, samples: 51, impacts: {rng.choice(LAWS)}}}
"""
    return text, {"rope1": -1, "rope2": -1}, 0.0, 8 * g * length + 20 * v**2


def groove(seed: int) -> tuple[str, dict[str, int], float, float]:
    """A ball in a groove with two sides."""
    rng = random.Random(seed)
    length, time = rng.choice([1e-6, 1.0, 1e3]), rng.choice([1e-9, 1.0, 3600.0])
    v, g, law = length / time, 9.81 * length / time**2, rng.choice(LAWS)
    mu = rng.choice([0.0, rng.uniform(0, 0.8)]) if law != "newton" else 0.0
    e, sides = rng.choice([0.0, 0.1, 0.4, 0.7, 0.9]), ""
    for name, sign in (("w1", 1), ("w2", -1)):
        angle = rng.uniform(0.2, 1.3)
        normal, along = math.cos(angle), sign * math.sin(angle)
        friction = f", friction: {mu!r}, slip: \"{normal!r}*x' - {along!r}*y'\"" if mu else ""
        expr = f"{normal!r}*y + {along!r}*x >= 0"
        sides += f"  {name}: {{expr: '{expr}', restitution: {e}{friction}}}\n"
    x, right, up = (rng.uniform(-1, 1) for _ in range(3))
    text = f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: {g!r}*y
constraints:
{sides}initial: {{x: {0.1 * x * length!r}, y: {length!r}, x': {0.3 * right * v!r}, y': {up * v!r}}}
simulation: {{t_end: {6 * time!r}, samples: 51, impacts: {law}, max_steps: 100000}}
"""
    return text, {"w1": 1, "w2": 1}, mu, 8 * g * length + 20 * v**2


def stack(seed: int) -> tuple[str, dict[str, int], float, float]:
    """Balls above each other."""
    rng = random.Random(seed)
    length, time, n = rng.choice([1e-6, 1.0, 1e3]), rng.choice([1e-9, 1.0, 3600.0]), 4
    g, e = 9.81 * length / time**2, rng.choice([0.0, 0.1, 0.4, 0.6])
    mass, each = [10 ** rng.uniform(-1, 1) for _ in range(n)], range(n)
    height = np.cumsum([rng.uniform(0.05, 0.5) * length for _ in range(n)]).tolist()
    below = ["0", *(f"y{k}" for k in range(n - 1))]
    text = f"""
coordinates: [{", ".join(f"y{k}" for k in each)}]
T: {" + ".join(f"{mass[k]!r}/2*y{k}'^2" for k in each)}
V: {" + ".join(f"{mass[k] * g!r}*y{k}" for k in each)}
constraints:
  {{{", ".join(f"c{k}: {{expr: y{k} >= {below[k]}, restitution: {e}}}" for k in each)}}}
initial: {{{", ".join(f"y{k}: {height[k]!r}, y{k}': 0" for k in each)}}}
simulation: {{t_end: {4 * time!r}, samples: 51, impacts: {rng.choice(LAWS)}, max_steps: 100000}}
"""
    return text, {f"c{k}": 1 for k in range(n)}, 0.0, 8 * sum(mass) * g * length


def box(seed: int) -> tuple[str, dict[str, int], float, float]:
    """A box that falls on its corners, beside a wall or not."""
    rng = random.Random(seed)
    length, time = rng.choice([1e-6, 1.0, 1e3]), rng.choice([1e-9, 1.0, 3600.0])
    v, g, law = length / time, 9.81 * length / time**2, rng.choice(LAWS)
    a, b, m = length * rng.uniform(0.1, 1), length * rng.uniform(0.1, 1), 10 ** rng.uniform(-3, 3)
    e = rng.choice([0.0, 0.0, 0.2, 0.5, 0.8])
    mu = rng.choice([0.0, rng.uniform(0, 1.5)]) if law != "newton" else 0.0
    corners, contacts, signs, walls = "", "", {}, rng.random() < 0.5
    for k, (i, j) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        corners += f"  X{k}: x + {i * a!r}*cos(phi) - {j * b!r}*sin(phi)\n"
        corners += f"  Y{k}: y + {i * a!r}*sin(phi) + {j * b!r}*cos(phi)\n"
        for name, expr, slip in (
            (f"f{k}", f"Y{k} >= 0", f"X{k}'"),
            (f"w{k}", f"X{k} <= {3 * length!r}", f"Y{k}'"),
        )[: 1 + walls]:
            friction = f", friction: {mu!r}, slip: {slip}" if mu else ""
            contacts += f"  {name}: {{expr: {expr}, restitution: {e}{friction}}}\n"
            signs[name] = 1 if name[0] == "f" else -1
    text = f"""
coordinates: [x, y, phi]
definitions:
{corners}T: {m!r}/2*(x'^2 + y'^2) + {m * (a * a + b * b) / 6!r}*phi'^2
V: {m * g!r}*y
constraints:
{contacts}initial:
  x: 0
  y: {2 * length!r}
  phi: {rng.uniform(-3, 3)!r}
  x': {v * rng.uniform(-3, 3)!r}
  y': {v * rng.uniform(-3, 3)!r}
  phi': {rng.uniform(-3, 3) / time!r}
simulation:
  {{t_end: {time * rng.uniform(0.6, 4)!r}, samples: 51, impacts: {law}, max_steps: 100000}}
"""
    return text, signs, mu, 4 * m * g * length + 10 * m * v**2


@pytest.mark.parametrize("make", [ropes, groove, stack, box])
@pytest.mark.parametrize(
    "seeds", [range(15), pytest.param(range(15, 400), marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_impulses_are_admissible(make, seeds: range) -> None:
    """In any units, by all laws, contacts push, friction is within cones, energy decreases."""
    for seed in seeds:
        text, signs, mu, energy = make(seed)
        run, log = simulate(text)
        if len(log):
            assert_admissible(run, log, signs, mu, energy)


def test_a_light_ball_between_a_heavy_one_and_the_floor() -> None:
    """It bounces at one instant until both rest: with e < 1, none of these impacts was the last."""
    text = """
coordinates: [y, z]
T: 0.01/2*y'^2 + 5*z'^2/2
V: 9.81*(0.01*y + 5*z)
constraints:
  floor: {expr: y >= 0, restitution: 0.6}
  above: {expr: z >= y, restitution: 0.6}
initial: {y: 0, z: 1e-12, y': 0, z': -3}
simulation: {t_end: 1}
"""
    for law in LAWS:
        run, log = simulate(text, impacts=law)
        assert_admissible(run, log, {"floor": 1, "above": 1}, 0.0, 25.0)
        assert run.q[-1] == pytest.approx(0.0, abs=1e-9)
        # all but e^2 of the energy at most is lost, and what is lost at first is momentum
        assert log.impulse[:, 0].max() > 0.0


def test_an_elastic_ball_between_a_block_and_a_wall() -> None:
    """G. Galperin 2003: a block 100^n times as heavy makes 3, 31, 314 collisions with e = 1."""
    text = """
coordinates: [x, z]
parameters: {M: 1}
T: x'^2/2 + M*z'^2/2
V: 0
constraints:
  wall: {expr: x >= 0, restitution: 1}
  block: {expr: z >= x, restitution: 1}
initial: {x: 1, z: 2, x': 0, z': -1}
simulation: {t_end: 10}
"""
    for power, count in enumerate((3, 31, 314)):
        model = text.replace("M: 1}", f"M: {100**power}}}")
        for law in LAWS:
            _, log = simulate(model, impacts=law)
            assert log.kinds.count("impact") == count
            assert log.loss.sum() == pytest.approx(0.0, abs=1e-10 * 100**power)


@pytest.mark.parametrize("seed", seeds(10, 30))
def test_ropes_rest_where_a_finer_tolerance_finds_it(seed: int) -> None:
    text, *_ = ropes(seed)
    coarse, fine = (simulate(text, closed=closed)[1].rests() for closed in (1e-9, 1e-12))
    assert [x.name for x in coarse] == [x.name for x in fine]
    assert [x.time for x in coarse] == pytest.approx([x.time for x in fine], rel=1e-9)


@pytest.mark.parametrize(("make", "seed"), [(groove, 4), (groove, 6), (groove, 11), (stack, 3)])
def test_flat_contacts_rest_at_one_time_wherever_impacts_count_as_ended(make, seed: int) -> None:
    """Between flat contacts, what is left of a sequence is as long as its limit says."""
    text, *_ = make(seed)
    coarse, fine = (simulate(text, closed=closed)[1].rests() for closed in (1e-3, 1e-9))
    assert coarse
    assert [x.name for x in coarse] == [x.name for x in fine]
    assert [x.time for x in coarse] == pytest.approx([x.time for x in fine], rel=1e-10)


@pytest.mark.parametrize("seed", [12, 39])
def test_balls_above_each_other_rest_near_where_a_finer_tolerance_finds_it(seed: int) -> None:
    """While one strikes, another falls: what is left of a sequence begins with a gap of its own."""
    text, *_ = stack(seed)
    coarse, fine = (simulate(text, closed=closed)[1].rests() for closed in (1e-5, 1e-9))
    assert [x.name for x in coarse] == [x.name for x in fine]
    # what is left is 1e-2 of the time, of which the gap is another such part
    assert [x.time for x in coarse] == pytest.approx([x.time for x in fine], rel=2e-4)


@pytest.mark.parametrize(
    ("friction", "restitution", "named"),
    [
        ("0.2", "0.2 + 0.3*sqrt(0.5 - t)", "floor.restitution"),
        ("0.2*sqrt(0.5 - t)", "0.3", "floor.friction"),
    ],
)
def test_an_impact_whose_coefficients_have_no_value(
    friction: str, restitution: str, named: str
) -> None:
    """The ball from y = 1 with y'' = -2 strikes at t = 1; it stopped there as if plastic."""
    model = lagcli.load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 2*y
constraints:
  floor: {{expr: y >= 0, friction: "{friction}", slip: x', restitution: "{restitution}"}}
initial: {{x: 0, x': 1, y: 1, y': 0}}
simulation: {{t_end: 2, samples: 5}}
""")
    found = lagcli.simulate(model)
    assert found.status == "failed"
    assert "at t = 1 s" in found.message
    assert f"`sqrt(0.5 - t)` in constraint `{named}` has no finite value" in found.message


@pytest.mark.parametrize("law", ["poisson", "sequential"])
@pytest.mark.parametrize("swapped", [False, True])
def test_an_impact_in_a_narrow_wedge_ends_at_once(law: str, swapped: bool) -> None:
    """The impulses are 1e4 times what the ball has: they cancel but for rounding."""
    contacts = {
        "left": "y*sin(1e-4) + x*cos(1e-4) >= 0",
        "right": "y*sin(1.7e-4) - x*cos(1.7e-4) >= 0",
    }
    names = sorted(contacts, reverse=swapped)
    lines = "\n".join(f"  {name}: {{expr: {contacts[name]}, restitution: 0}}" for name in names)
    run, log = simulate(f"""
coordinates: [x, y]
T: 7*(x'^2 + y'^2)/2
V: 70*y
constraints:
{lines}
initial: {{x: -1e-5, x': 1e-5, y: 5, y': 0}}
simulation: {{t_end: 2, samples: 5, impacts: {law}}}
""")
    assert log.kinds == ("impact", "impact", "closes", "closes")
    assert log.time == pytest.approx([1.0] * 4, abs=1e-7)
    assert log.loss.sum() == pytest.approx(350, rel=1e-7)
    assert run.q[-1] == pytest.approx([0.0, 0.0], abs=1e-7)


def test_a_ball_rests_on_two_contacts_that_move_fast() -> None:
    """Its velocity is 0.05 in its last impacts, and that of the contacts 1e5.

    One of them is measured in thirds, so that their velocities differ by rounding errors, 1e-11. It
    falls for 1 s; all flights after that take 2/3 s, and 50 J are lost.
    """
    run, log = simulate("""
coordinates: [y]
T: y'^2/2
V: 10*y
constraints:
  left: {expr: y - 1e5*t >= 0, restitution: 0.25}
  right: {expr: y/3 - 1e5/3*t >= 0, restitution: 0.25}
initial: {y: 5, y': 1e5}
simulation: {t_end: 2, samples: 5}
""")
    assert run.q[-1] == pytest.approx([2e5], abs=1e-5)
    assert run.v[-1] == pytest.approx([1e5], abs=1e-9)
    assert {x.name for x in log.rests()} == {"left", "right"}
    assert all(1.65 < x.time < 5 / 3 for x in log.rests())
    assert log.loss.sum() == pytest.approx(50, rel=1e-3)


@pytest.mark.parametrize("value", ["0", "sqrt(y - 1)"])
@pytest.mark.parametrize("mass", ["m*y'^2 + z'^2", "y'^2 + m*z'^2", "m*(y'^2 + z'^2)"])
def test_an_impact_without_a_mass(mass: str, value: str) -> None:
    """It is the mass matrix that has no value, not the law of impacts."""
    model = lagcli.load_text(f"""
coordinates: [y, z]
parameters: {{m: 1}}
T: ({mass})/2
V: 5*y
constraints:
  floor: {{expr: y >= 0, restitution: 0.5}}
events:
  loses: {{when: y <= 0, set: {{m: "{value}"}}}}
initial: {{y: 5, y': 0, z: 0, z': 0}}
simulation: {{t_end: 3, samples: 5}}
""")
    found = lagcli.simulate(model)
    assert found.status == "failed"
    assert "at t = 1.41421356 s; the mass matrix does not determine" in found.message
    assert found.events is not None
    assert found.events.kinds == ("event",)


@pytest.mark.parametrize("others", [0, 38])
def test_an_impact_after_a_change_of_the_mass_matrix_at_the_same_instant(others: int) -> None:
    """With x = π/2, M = [[2, 1], [1, 1]]: the impulse at ẏ = -10 is 7.5, M⁻¹ (0, 7.5) = (-7.5, 15).

    Beside many others that share a momentum, M is not factored by an unrolled elimination.
    """
    more = f"  z[1..{others}]: m\n" if others else ""
    energy = f" + sum(z[i]'^2, i=1..{others}) + sum(z[i]', i=1..{others})^2" if others else ""
    start = f', z[1..{others}]: 0, "z[1..{others}]\'": 0' if others else ""
    _, log = simulate(f"""
coordinates:
  x: m
  y: m
{more}
T: (y' + sin(x)*x')^2/2 + x'^2/2{energy}
V: 10*y
constraints:
  floor: {{expr: y >= 0, restitution: 0.5}}
events:
  turns: {{when: y <= 0, times: 1, set: {{x: pi/2}}}}
initial: {{x: 0, x': 0, y: 5, y': 0{start}}}
simulation: {{t_end: 1.1, samples: 3}}
""")
    assert log.kinds == ("event", "impact")
    assert log.after[-1, :2] == pytest.approx([-7.5, 5.0], rel=1e-9)
    assert log.loss[-1] == pytest.approx(7.5 * (10 - 5) / 2, rel=1e-9)
