"""Random models with known events: none is missed or found twice, and the motion is right."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from core_parts import search_cost
from known_event_cases import EVENT_CASES
from known_events import METHODS, judge
from known_force_cases import FORCE_CASES
from known_rest_cases import REST_CASES
from scipy.special import ellipk, ellipkinc

import lagcli
from lagcli.engine.core.switching import SwitchingIntegrator

FOUND = Path(__file__).parents[1] / "found"
CASES = {**EVENT_CASES, **FORCE_CASES, **REST_CASES}
#: Random cases of each kind; `make fuzz` tries more.
SEEDS = {"stick-slip": 10, "lift-off": 10, "pulses": 8}
#: Coefficients of interval jets and states that the search for events evaluates in these cases: the
#: same motion and events for less are welcome, and for more a mistake.
COSTS = {
    "cubic": (887, 311),
    "chebyshev": (2054, 493),
    "sine": (20029, 9370),
    "near_touch": (26317, 14365),
    "product": (55723, 14372),
    "beat": (48052, 13684),
    "absolute": (65037, 8599),
    "square": (648365, 3132),
    "sawtooth": (180612, 778),
    "touch": (4090, 111),
    "only_touches": (64936, 12),
    "never": (32, 10),
    "rational": (10482, 2603),
    "positive_factor": (4147, 629),
    "tangent": (273942, 3233),
    "oscillator": (2943, 1469),
    "pendulum": (2129, 942),
    "multiplier": (0, 11549),
    "bounce": (3599, 5662),
    "wrap": (1152, 577),
    "kick": (16249, 12134),
    "together": (40674, 21071),
    "compound": (19285, 3801),
    "ends": (172, 121),
    "distance": (178, 118),
    "height": (291, 251),
    "pulses": (20441, 50470),
    "springs": (4439, 1273),
    "stick-slip": (3281, 34041),
    "lift-off": (17064, 24038),
    "landing": (4194, 2772),
    "moving floor": (459842, 3185),
    "stop": (985, 520),
}
#: What rounding may add, in part of these.
ROUNDING = 0.02


def load(name: str, **changes: float) -> lagcli.Model:
    return lagcli.load(FOUND / f"{name}.yaml", set=changes)


@pytest.mark.parametrize("kind", CASES)
def test_no_event_is_missed_or_found_twice(kind: str, cores: list[SwitchingIntegrator]) -> None:
    """And the search costs what it should."""
    cases = [CASES[kind](seed) for seed in range(SEEDS.get(kind, 4))]
    wrong = [(v, case) for case in cases if not (v := judge(case)).right]
    shown = "\n".join(f"{v}: {case}" for v, case in wrong[:3])
    assert not wrong, f"{len(wrong)} of {len(cases)} are wrong:\n{shown}"
    cost = sum(search_cost(core._run) for core in cores)
    assert (cost <= (1 + ROUNDING) * np.array(COSTS[kind])).all(), cost
    assert ((cost > 0) == (np.array(COSTS[kind]) > 0)).all(), cost


#: Roots 1e-8 of the run apart, expanded and factored; events beside those of functions that are
#: rounded more; a gap that opens with the third power of time.
NEAR = {
    "cubic": [1030, 1033, 1050, 1069, 1156, 1305, 1309, 1324],
    "together": [1161, 1177, 1266],
    "lift-off": [1100],
}


@pytest.mark.parametrize(("kind", "seed"), [(k, s) for k, seeds in NEAR.items() for s in seeds])
def test_events_that_rounding_nearly_hides(kind: str, seed: int) -> None:
    verdict = judge(case := CASES[kind](seed))
    assert verdict.right, f"{verdict}: {case}"


@pytest.mark.slow
def test_a_condition_whose_sign_cannot_be_determined_is_named() -> None:
    """It touches zero more often in a step than the search divides it."""
    run = lagcli.simulate(
        lagcli.load_text(
            "coordinates: [x]\nT: x'^2/2\ninitial: {x: 0, x': 1}\nevents:\n"
            "  first: {when: x >= 5}\n  second: {when: cos(1e6*x) >= 1}\n  third: {when: x >= 7}\n"
        ),
        t_end=3,
    )
    assert run.status == "failed"
    assert run.message.startswith("the sign of the condition of `second` cannot be determined")


@pytest.mark.parametrize("mass", [1.0, 3.7, 0.0071])
def test_a_body_at_rest_under_a_load_has_no_event(mass: float) -> None:
    """Its velocity is zero but for rounding errors, which grow with the forces."""
    run = lagcli.simulate(
        lagcli.load_text(
            f"""
coordinates: [x]
T: {mass}*x'^2/2
Q: {{x: {-5.3 * mass} + {3.1 * mass}*sin(7*t)}}
constraints: {{floor: {{expr: x >= -0.7, restitution: 0}}}}
initial: {{x: 0, x': -1.2}}
events: {{rises: {{when: x' >= 0}}, below: {{when: x < -0.7}}}}
"""
        ),
        t_end=30,
    )
    assert run.events is not None
    assert list(run.events.kinds) == [
        "event",
        "impact",
        "closes",
    ]  # `below`, as it reaches the floor


def test_a_turning_point_from_which_the_projection_moves_the_velocity() -> None:
    """Radau's dense output there is off the rod by 1e-10 of the largest velocity."""
    model = lagcli.load_text(
        """
coordinates: [x, y]
T: 0.028556*(x'^2 + y'^2)/2
V: 2.38631*y
constraints:
  rod: x^2 + y^2 = 1.4718758812830384^2
  wall: {expr: 0.7041607731770556*x + 0.7100405661078044*y >= 0, restitution: 0}
initial: {x: 1.2246473717343445, y: -0.816490921447926, x': 0, y': 0}
events:
  kick: {every: 1.6677577952548126, offset: 2.5, impulse: {x: 0.0057322, y: 0.0057801}}
  rises: {when: x' >= 0, record: false}
  turns: {when: x' = 0, record: false}
"""
    )
    run = lagcli.simulate(model, method="Radau", t_end=9.1)
    assert run.events is not None
    names = list(run.events.names)
    assert (names.count("rises"), names.count("turns")) == (4, 8)


@pytest.mark.parametrize("method", METHODS)
def test_the_distance_from_a_curved_floor_stays_zero(method: str) -> None:
    model = lagcli.load_text(
        """
coordinates: [x, y]
T: 0.078*(x'^2 + y'^2)/2
V: 0.51*y
constraints: {floor: {expr: y >= x^2/3.4, restitution: 0}}
initial: {x: 0.54, y: 0.54^2/3.4, x': 0, y': 0}
events:
  apart: {when: y - x^2/3.4 = 0, record: false}
  leaves: {when: y' - 2*x*x'/3.4 = 0, record: false}
"""
    )
    run = lagcli.simulate(model, method=method, t_end=6.5)
    assert run.events is not None
    assert len(run.events.time) == 0


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("when", ["sin(2*pi*t/T) >= 0.5", "sin(2*pi*t/T) = 0"])
def test_a_periodic_kick(when: str, method: str) -> None:
    text = (FOUND / "periodic_kick.yaml").read_text(encoding="utf-8")
    model = lagcli.load_text(text.replace("sin(2*pi*t/T) >= 0.5", when))
    run = lagcli.simulate(model, method=method, t_end=6.4)
    expected = np.arange(7) + 1 / 12 if ">=" in when else np.arange(1, 13) / 2
    assert run.events is not None
    np.testing.assert_allclose(run.events.time, expected, rtol=1e-12)
    assert run.v[-1, 0] == pytest.approx(len(expected), rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_passages_of_a_pendulum_in_both_directions(method: str) -> None:
    run = lagcli.simulate(load("two_way_set"), method=method, rtol=1e-10)
    half = 2 * ellipk(math.sin(0.3) ** 2) / math.sqrt(9.81)
    expected = (np.arange(19) + 0.5) * half
    assert run.events is not None
    np.testing.assert_allclose(run.events.time, expected, rtol=1e-8)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "action",
    [
        "set: {x': -x'}",
        "set: {x': -x', y': -y'}",
        "impulse: {x: -2*x', y: -2*y'}",
    ],
)
def test_a_pendulum_on_a_rod_that_turns_back_at_a_stop(action: str, method: str) -> None:
    """The projection moves the states at its roots off them, by the error of the dense output."""
    rng = np.random.default_rng(5)
    for _ in range(4):
        g, largest = rng.uniform(5, 15), rng.uniform(0.5, 1.2)
        stop = rng.uniform(-0.9, 0.9) * largest
        k = math.sin(largest / 2)
        phase = math.asin(math.sin(stop / 2) / k)  # of the stop; F is the time from the bottom
        quarter, passes = (x / math.sqrt(g) for x in (ellipk(k * k), ellipkinc(phase, k * k)))
        first = passes if stop > 0 else 2 * quarter - passes
        expected = first + 2 * (quarter + abs(passes)) * np.arange(4)
        model = lagcli.load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: {g!r}*y
constraints: {{rod: x^2 + y^2 = 1}}
initial: {{x: 0, y: -1, x': {2 * k * math.sqrt(g)!r}, y': 0}}
events: {{stop: {{when: x = {math.sin(stop)!r}, {action}, record: false}}}}
""")
        run = lagcli.simulate(model, method=method, t_end=1.01 * expected[-1])
        assert run.events is not None
        np.testing.assert_allclose(run.events.time, expected, rtol=1e-7)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("action", ["set: {x': 0, y': 0}", "impulse: {x: -x', y: -y'}"])
def test_a_pendulum_on_a_rod_that_is_stopped_once(action: str, method: str) -> None:
    """It leaves the place where an event has stopped it without another event."""
    rng = np.random.default_rng(6)
    for _ in range(6):
        stop, speed = float(rng.choice([-1, 1]) * rng.uniform(0.1, 0.8)), rng.uniform(5, 9)
        model = lagcli.load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {{rod: x^2 + y^2 = 1}}
initial: {{x: 0, y: -1, x': {math.copysign(speed, stop)!r}, y': 0}}
events: {{stop: {{when: x = {stop!r}, {action}, record: false}}}}
""")
        run = lagcli.simulate(model, method=method, t_end=1)
        assert run.events is not None
        assert len(run.events.time) == 1


def test_passages_of_a_pendulum_on_a_rope() -> None:
    """The rope stays tight: within steps, states of the dense output are off it by its error."""
    model = lagcli.load_text(
        f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {{rope: x^2 + y^2 <= 1}}
initial: {{x: {math.sin(0.6)!r}, y: {-math.cos(0.6)!r}, x': 0, y': 0}}
events: {{passes: {{when: x = 0}}, right: {{when: x >= 0}}, turns: {{when: x' <= 0}}}}
"""
    )
    half = 2 * ellipk(math.sin(0.3) ** 2) / math.sqrt(9.81)
    run = lagcli.simulate(model, t_end=11 * half, rtol=1e-10)
    assert run.events is not None
    k = np.arange(11)
    for name, expected in (("passes", k + 0.5), ("right", 2 * k[:5] + 1.5), ("turns", 2 * k[1:6])):
        np.testing.assert_allclose(run.events.instants(name, "event"), expected * half, rtol=1e-8)


@pytest.mark.parametrize("method", METHODS)
def test_conditions_of_forces_beside_those_of_time_and_of_states(method: str) -> None:
    """A block is kicked up from the floor, which bears it again when it has fallen."""
    model = lagcli.load_text(
        """
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
Q: {x: 2*t}
constraints: {floor: {expr: y >= 0, restitution: 0}}
initial: {x: 0, y: 0, x': 0, y': 0}
events:
  kick: {when: t >= 1, impulse: {y: 3}}
  free: {when: lambda.floor <= 1}
  high: {when: y' <= 0}
  bears: {when: lambda.floor >= 1}
  fast: {when: x'' >= 2.5}
"""
    )
    run = lagcli.simulate(model, method=method, t_end=2)
    assert run.events is not None
    flight = 3 / 9.81
    expected = {"kick": 1, "free": 1, "high": 1 + flight, "bears": 1 + 2 * flight, "fast": 1.25}
    for name, time in expected.items():
        assert run.events.instants(name, "event") == pytest.approx([time], rel=1e-9), name


@pytest.mark.parametrize("seed", range(4))
def test_redundant_friction_holds_up_to_the_sum_of_its_limits(seed: int) -> None:
    """The forces of least norm reach each limit in turn; then the largest bears the rest."""
    rng = np.random.default_rng(seed)
    limits = np.sort(rng.uniform(0.5, 3.0, 2 + seed % 2))
    total, last = limits.sum(), len(limits) - 1
    level = limits[-2:].mean()  # beyond all limits but the largest
    rows = "".join(
        f"  s{i}: {{expr: x' = 0, limit: {x!r}}}\n" for i, x in enumerate(limits.tolist())
    )
    model = lagcli.load_text(
        f"coordinates: [x]\nT: x'^2\nQ: {{x: t}}\nconstraints:\n{rows}"
        f"events: {{e: {{when: abs(lambda.s{last}) >= {float(level)!r}}}}}\n"
        "initial: {x: 0, x': 0}\n"
    )
    run = lagcli.simulate(model, t_end=1.2 * total, samples=31, max_steps=100)
    assert run.status == "completed"
    assert run.events is not None
    for i in range(len(limits)):
        assert run.events.instants(f"s{i}", "slips") == pytest.approx([total], rel=1e-9)
    bears = limits[:-1].sum() + level
    assert run.events.instants("e", "event") == pytest.approx([bears], rel=1e-9)
    holds = run.time < total
    forces = -run.multipliers[holds]
    np.testing.assert_allclose(forces.sum(axis=1), run.time[holds], rtol=0, atol=1e-9)
    assert (forces <= limits + 1e-9).all()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("force", [1.01, 1.05, 1.1, 1.2])
def test_a_block_slips_twice_per_period(force: float, method: str) -> None:
    run = lagcli.simulate(load("stick_harmonic", F=force), method=method)
    assert run.events is not None
    assert (run.events.kinds.count("slips"), run.events.kinds.count("sticks")) == (20, 20)
    assert np.abs(run.multipliers).max() <= 1 + 1e-9
    assert run.q[-1, 0] == pytest.approx(0, abs=1e-7)


def test_two_blocks_slip_as_each_does_alone() -> None:
    """Functions of forces are sampled together, and their roots are found each by itself."""
    text = """
coordinates: {{x: m, y: m}}
parameters: {{m: 1 kg, F: {f} N, H: {h} N, G: 1 N, w: 1 1/s, u: 1.7 1/s}}
T: m/2*(x'^2 + y'^2)
Q: {{x: F*sin(w*t), y: H*sin(u*t)}}
constraints:
  s: {{expr: x' = 0, limit: G}}
  r: {{expr: y' = 0, limit: G}}
initial: {{x: 0 m, x': 0 m/s, y: 0 m, y': 0 m/s}}
simulation: {{t_end: 20, samples: 2}}
"""

    def slips(f: float, h: float, name: str) -> np.ndarray:
        run = lagcli.simulate(lagcli.load_text(text.format(f=f, h=h)), rtol=1e-10)
        assert run.events is not None
        return run.events.instants(name, "slips")

    for name, force, alone in (("s", 1.1, (1.1, 0.5)), ("r", 1.3, (0.5, 1.3))):
        found, rate = slips(1.1, 1.3, name), {"s": 1.0, "r": 1.7}[name]
        expected = slips(*alone, name)
        assert len(expected) > 3
        np.testing.assert_allclose(found, expected, atol=1e-8)
        assert found[0] == pytest.approx(math.asin(1 / force) / rate, abs=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_a_block_lifts_off_once_per_period(method: str) -> None:
    run = lagcli.simulate(load("lift_harmonic"), method=method)
    assert run.events is not None
    assert run.events.kinds.count("opens") == 10
    assert run.multipliers.min() >= -1e-9


@pytest.mark.parametrize("method", METHODS)
def test_a_train_of_pulses_on_an_oscillator(method: str) -> None:
    run = lagcli.simulate(load("pulse_train"), method=method, rtol=1e-10)
    # the force is 1 from a to b in each period: a difference of two cosines each
    start, end = (math.asin(0.95) / math.tau, 0.5 - math.asin(0.95) / math.tau)
    edges = 0.3 * (np.arange(20)[:, None] + [start, end])
    x, v = (float(np.diff(f(6 - edges)).sum()) for f in (np.cos, lambda s: -np.sin(s)))
    # the errors of some 200 steps, each up to 1e-10 of a motion of 0.03 m; Radau's are 2.4e-9
    assert run.q[-1, 0] == pytest.approx(x, abs=5e-9)
    assert run.v[-1, 0] == pytest.approx(v, abs=5e-9)


#: An oscillator that is kicked every second, from 0.5 s on, in five ways.
KICKED = """\
coordinates: [x, y]
parameters: {{w: 3, g: 9.81, T: 1, n: 0}}
{inputs}
T: (x'^2 + y'^2)/2
V: w^2*x^2/2 + g*y
constraints:
  floor: {{expr: y >= 0, restitution: 1}}
initial: {{x: 1, y: g*T^2/8, x': 0, y': 0}}
outputs: {{count: n}}
events:
  kick: {{{occasion}, impulse: {{x: 0.5}}, set: {{n: n + 1}}}}
"""
KICKS = {
    "periodic": "when: sin(2*pi*t/T) <= 0, times: 6",
    "two-way": "when: cos(pi*t/T) = 0",
    "clock": "every: T, offset: T/2",
    "table": "when: u > 0.5",
    "contact": "when: floor impacts",
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("form", KICKS)
def test_five_forms_of_a_kick_give_the_same_motion(form: str, method: str) -> None:
    table = (
        "inputs:\n  u: {times: [0, 0.5, 0.75, 1], values: [0, 1, 0, 0], interpolation: step,"
        " extend: periodic}"
    )
    text = KICKED.format(inputs=table if form == "table" else "", occasion=KICKS[form])
    run = lagcli.simulate(lagcli.load_text(text), t_end=6.3, samples=64, rtol=1e-11, method=method)
    assert run.status == "completed"
    kicks = np.arange(6) + 0.5
    assert run.events is not None
    found = [t for t, n in zip(run.events.time, run.events.names, strict=True) if n == "kick"]
    np.testing.assert_allclose(found, kicks, rtol=1e-9)
    assert run.outputs["count"][-1] == 6
    since = run.time[:, None] - kicks
    waves = np.where(since >= 0, np.sin(3 * since), 0).sum(axis=1)
    # a sample at a kick is to its right, where sin is zero in any case
    np.testing.assert_allclose(run.q[:, 0], np.cos(3 * run.time) + 0.5 / 3 * waves, atol=1e-8)


@pytest.mark.parametrize("method", METHODS)
def test_a_condition_is_not_passed_over_at_the_instant_of_another(method: str) -> None:
    """Two roots 2.4e-5 apart, of x and of t: the second instant begins within rounding of the first
    condition's root."""
    cubic = "0.00167243805458425*({z}^3 - 2.045428748892167*{z}^2 + 1.3338426225705602*{z}"
    cubic += " - 0.28129209670049915)"
    model = lagcli.load_text(
        "coordinates: [x]\nT: x'^2/2\ninitial: {x: 0, x': 2.231681335237453e-08}\nevents:\n"
        f'  c: {{when: "{cubic.format(z="(x/2.231681335237453)")} = 0"}}\n'
        f'  d: {{when: "{cubic.format(z="(t/1e8)")} >= 0"}}\n'
    )
    run = lagcli.simulate(model, t_end=1e8, samples=2, method=method)
    assert run.events is not None
    assert (len(run.events.instants("c", "event")), len(run.events.instants("d", "event"))) == (
        3,
        2,
    )
