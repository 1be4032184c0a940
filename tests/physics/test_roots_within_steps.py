"""Events and impacts within a step: roots of polynomials, grazing impacts, given times."""

import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.special import ellipk

import lagcli
from lagcli.model.loader import load_text
from tests.support.contact_cases import ContactRun, run_contact

CUBIC = """
coordinates: {x: m}
T: x'^2/2
Q: {x: 6*t - 12}
events:
  zero: {when: x = 0}
  rises: {when: x >= 0}
initial: {x: -6, x': 11}
simulation: {times: [0, 4]}
"""

GRAZING = """
coordinates: {x: m, y: m}
parameters: {depth: 1e-6}
T: (x'^2 + y'^2)/2
constraints:
  hump: {expr: y + x^2 >= depth, restitution: 0}
initial: {x: -1, y: 0, x': 1, y': 0}
simulation: {times: [0, 2]}
"""


def run(text: str, **settings: object) -> ContactRun:
    return run_contact(load_text(text), **settings)


def test_all_three_roots_of_a_cubic_within_a_step() -> None:
    """(t − 1)(t − 2)(t − 3), of SciPy's issue 9228: x = 0 both ways, x ≥ 0 twice."""
    found = run(CUBIC)
    times = [x.time for x in found.entries("event", "zero")]
    np.testing.assert_allclose(times, [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(
        [x.time for x in found.entries("event", "rises")], [1, 3], atol=1e-12
    )


def test_a_force_that_is_negative_for_a_part_of_a_step() -> None:
    """Cubics that are large and level at three of four control points, below zero at the other."""
    random = np.random.default_rng(0)
    for _ in range(24):
        start, levels = random.uniform(0.1, 0.6), random.uniform(1.0, 1.5, 4)
        levels[1] = -random.uniform(1.4, 3.0)
        s = Polynomial([-start, 1.0]) / (1.0 - start)
        basis = ((1 - s) ** 3, 3 * (1 - s) ** 2 * s, 3 * (1 - s) * s**2, s**3)
        force = 1000 * sum((x * p for x, p in zip(levels, basis, strict=True)), Polynomial([0.0]))
        terms = " + ".join(f"({float(c)!r})*x^{i}" for i, c in enumerate(force.convert().coef))
        model = load_text(
            f"coordinates: [x, y]\nT: (x'^2 + y'^2)/2\nconstraints: {{rail: y = 0}}\n"
            f"Q: {{y: -({terms})}}\nevents: {{pulls: {{when: lambda.rail < 0}}}}\n"
            "initial: {x: 0, x': 1, y: 0, y': 0}\nsimulation: {times: [0, 1]}\n"
        )
        events = lagcli.simulate(model).events
        assert events is not None
        roots = force.roots()
        real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
        falls = real[(real > 0) & (real < 1) & (force.deriv()(real) < 0)]
        np.testing.assert_allclose(events.time, falls, rtol=0, atol=1e-11)


@pytest.mark.parametrize("early", [1.0, 1e-6])
@pytest.mark.parametrize("depth", [0.0, 1e-9])
def test_a_force_that_touches_zero_within_rounding_does_not_change_its_sign(
    depth: float, early: float
) -> None:
    """c (t - a)^2, expanded, less a part of c: forces of 30 rails, or t times that."""
    rng, count = np.random.default_rng(7), 30
    a, c = rng.uniform(0.1, 0.9, count), rng.uniform(0.5, 20, count)
    grows = Polynomial([early, 1.0 - early])
    polynomials = (
        u * Polynomial([v**2 - depth, -2 * v, 1.0]) * grows
        for u, v in zip(c.tolist(), a.tolist(), strict=True)
    )
    forces = ", ".join(
        f"y[{i + 1}]: -({' + '.join(f'{x!r}*t^{k}' for k, x in enumerate(p.coef.tolist()))})"
        for i, p in enumerate(polynomials)
    )
    events = ", ".join(f"e{i}: {{when: 'lambda.rail[{i + 1}] < 0'}}" for i in range(count))
    model = load_text(f"""
coordinates: ["y[1..{count}]"]
T: sum(y[i]'^2, i = 1..{count})/2
constraints: {{"rail[i = 1..{count}]": "y[i] = 0"}}
Q: {{{forces}}}
events: {{{events}}}
initial: {{"y[1..{count}]": 0, "y[1..{count}]'": 0}}
simulation: {{times: [0, 1]}}
""")
    found = run_contact(model).outcome.events
    falls = dict(enumerate((a - depth**0.5).tolist())) if depth else {}
    assert {x.which: x.time for x in found} == pytest.approx(falls, rel=0, abs=1e-10)


def test_a_force_that_is_zero_where_a_step_ends() -> None:
    """It vanishes at a root within the step, and again at the step's end, exactly."""
    for root in np.linspace(0.55, 0.95, 9).tolist():
        model = load_text(
            f"coordinates: [x]\nT: x'^2/2\nQ: {{x: (t - {root!r})*(t - 1)}}\n"
            "events:\n  begins: {when: x'' <= 0}\n  zero: {when: x'' = 0, times: 1}\n"
            "  c: {every: 0.5}\ninitial: {x: 0, x': 1}\nsimulation: {times: [0, 1]}\n"
        )
        found = run_contact(model)
        for name in ("begins", "zero"):
            times = [x.time for x in found.entries("event", name)]
            np.testing.assert_allclose(times, [root], rtol=0, atol=1e-13, err_msg=name)


def test_an_acceleration_is_watched_while_redundant_contacts_share_forces() -> None:
    """A plate on three supports in a line; it is pushed along them by a growing force."""
    model = load_text(
        "coordinates: {x: m, y: m, phi: rad}\nT: (x'^2 + y'^2)/2 + 0.1*phi'^2/2\nV: 9.81*y\n"
        "Q: {x: t}\nevents: {fast: {when: x'' >= 2}}\n"
        "constraints: {a: y - 0.5*phi >= 0, b: y >= 0, c: y + 0.5*phi >= 0}\n"
        "initial: {x: 0, x': 1, y: 0, y': 0, phi: 0, phi': 0}\nsimulation: {times: [0, 3]}\n"
    )
    (event,) = run_contact(model).entries("event", "fast")
    assert event.time == pytest.approx(2, abs=1e-12)


@pytest.mark.parametrize("depth", [1e-4, 1e-8, 1e-12])
def test_grazing_impacts(depth: float) -> None:
    """A particle that passes over a parabola too low by so little."""
    model = load_text(GRAZING, set={"depth": depth})
    found = run_contact(model)
    (impact,) = found.entries("impact")
    root = np.sqrt(depth)
    # the condition of the root is 1/(2 √depth)
    assert impact.time == pytest.approx(1 - root, abs=1e-14 / root + 1e-12)
    model = load_text(GRAZING, set={"depth": -depth})
    assert not run_contact(model).outcome.events


def test_times_are_landed_on_exactly() -> None:
    text = CUBIC.replace("zero: {when: x = 0}", "at: {when: t >= 0.7}")
    (event,) = run(text).entries("event", "at")
    assert event.time == 0.7
    assert event.q[0] == pytest.approx((0.7 - 1) * (0.7 - 2) * (0.7 - 3), abs=1e-13)


@pytest.mark.parametrize("start", [0.0, -0.5, 2.0])
@pytest.mark.parametrize("length", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(
    ("late", "happens"), [(0.0, True), (0.6, True), (0.95, True), (1.05, False), (3.0, False)]
)
def test_a_root_within_1e_12_of_the_run_beyond_its_end_is_at_the_end(
    late: float, length: float, start: float, *, happens: bool
) -> None:
    model = load_text(f"""
coordinates: [x]
T: x'^2/2
initial: {{x: 0, x': 1}}
events: {{hit: {{when: x >= {length * (1 + late * 1e-12)!r}}}}}
simulation: {{t_start: {start * length}, t_end: {(start + 1) * length}, samples: 2}}
""")
    assert len(run_contact(model).outcome.events) == happens


def test_a_bead_in_a_bowl_is_above_a_height_for_a_moment_at_each_turn() -> None:
    """The turns of a pendulum of length 1, 1e-9 below its largest height."""
    below = 1e-9
    model = load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {{bowl: {{expr: x^2 + y^2 <= 1, restitution: 0}}}}
initial: {{x: 0, x': 2, y: -1, y': 0}}
events: {{up: {{when: y >= -1 + 2/9.81 - {below}}}}}
simulation: {{times: [0, 10]}}
""")
    found = run_contact(model, rtol=1e-10)
    turn = np.arccos(1 - 2 / 9.81)
    quarter = ellipk(np.sin(turn / 2) ** 2) / 9.81**0.5
    early = np.sqrt(2 * below / 9.81) / np.sin(turn)  # the height is a parabola there
    expected = quarter * np.arange(1, 10 / quarter, 2) - early
    np.testing.assert_allclose(
        [x.time for x in found.entries("event", "up")], expected, rtol=0, atol=early / 10
    )


@pytest.mark.parametrize("held", ["x = 0", "x = t/2"])
def test_a_closed_contact_that_nothing_moves_hides_no_event(held: str) -> None:
    """Its inverse inertia is zero: x is given."""
    model = load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
constraints: {{held: {held}, floor: x >= 0}}
initial: {{x: 0, x': {{guess: 0}}, y: 0, y': 1}}
events: {{hit: {{when: y >= 0.5}}}}
simulation: {{times: [0, 1]}}
""")
    (hit,) = run_contact(model).outcome.events
    assert hit.time == pytest.approx(0.5, rel=1e-14)


def test_a_root_at_the_end_is_found_whatever_happens_just_before() -> None:
    model = load_text("""
coordinates: [x]
T: x'^2/2
initial: {x: 0, x': 1}
events:
  before: {when: x >= 0.9999999999995}
  beyond: {when: x >= 1.0000000000005}
simulation: {times: [0, 1]}
""")
    found = run_contact(model)
    assert [len(found.entries("event", name)) for name in ("before", "beyond")] == [1, 1]


def test_a_root_at_the_end_leaves_other_modes_as_they_are() -> None:
    """x = 10 t - t^2 slips, u sticks, |w| is on one side, and `past` has happened before."""
    found = run_contact(
        load_text("""
coordinates: [x, u, w]
T: (x'^2 + u'^2 + w'^2)/2
V: -u + abs(w)
constraints:
  slides: {expr: "x' = 0", limit: 2}
  rests: {expr: "u' = 0", limit: 2}
initial: {x: 0, x': 10, u: 0, u': 0, w: 8, w': 0}
events: {past: {when: x >= 5}, hit: {when: x >= 9.000000000004}}
simulation: {times: [0, 1]}
""")
    )
    past, hit = found.outcome.events
    assert (past.occurrence, hit.occurrence) == ("event", "event")
    assert past.time == pytest.approx(5 - 20**0.5)
    assert hit.time == 1.0
    np.testing.assert_allclose(found.block.q[-1], [9, 0, 7.5], rtol=1e-12, atol=1e-12)


def test_a_model_without_contacts_is_not_switched() -> None:
    plain = run(CUBIC.split("events:")[0] + "initial: {x: -6, x': 11}\nsimulation: {times: [0, 4]}")
    assert plain.system.switching is None
    assert plain.outcome.modes == ()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("of", ["x", "lambda.rail", "z''"])
def test_conditions_that_are_undefined_for_a_part_of_a_step(of: str, scale: float) -> None:
    """Roots and logarithms of a parabola in x, which is negative from c - w to c + w, and acosh.

    The force of the rail and z'' are x.
    """
    rng = np.random.default_rng(3)
    for _ in range(5):
        c, w, level = rng.uniform([-0.5, 0.1, 0.02], [0.5, 2.0, 0.5]).tolist()
        near = f"({of} - {scale * c!r})^2 - {(scale * w) ** 2!r}"
        model = load_text(f"""
coordinates: [x, y, z]
T: (x'^2 + y'^2 + z'^2)/2
Q: {{y: -x, z: x}}
constraints: {{rail: y = 0}}
initial: {{x: {-3 * scale}, x': {scale}, y: 0, y': 0, z: 0, z': 0}}
events:
  root: {{when: "sqrt({near}) >= {scale * level!r}"}}
  falls: {{when: "sqrt({near}) <= {scale * level!r}"}}
  log: {{when: "log({near}) >= {2 * math.log(scale * level)!r}"}}
  acosh: {{when: "acosh(({of} - {scale * c!r})^2/{(scale * w) ** 2!r}) >= {level!r}"}}
simulation: {{times: [0, 6]}}
""")
        found = run_contact(model)
        assert found.outcome.status == "completed"
        root, acosh = math.hypot(w, level), w * math.sqrt(math.cosh(level))
        for name, x in (
            ("falls", c - root),
            ("root", c + root),
            ("log", c + root),
            ("acosh", c + acosh),
        ):
            (event,) = found.entries("event", name)
            assert event.time == pytest.approx(3 + x, rel=1e-12), name


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_row_sticks_until_a_load_reaches_its_limit(scale: float, way: int) -> None:
    """The load grows; limits are constant, fall in time, or depend on another motion."""
    rng = np.random.default_rng(11)
    for _ in range(3):
        load, limit, fall, v = rng.uniform([1, 0.5, 0.02, 0.5], [3, 2, 0.15, 1.5]).tolist()
        model = load_text(f"""
coordinates: [a, b, c, y]
T: (a'^2 + b'^2 + c'^2 + y'^2)/2
Q: {{a: "{way * scale * load!r}*t", b: "{way * scale * load!r}*t", c: "{way * scale * load!r}*t"}}
constraints:
  constant: {{expr: "a' = 0", limit: {scale * limit!r}}}
  falls: {{expr: "b' = 0", limit: "{scale * limit!r} - {scale * fall!r}*t"}}
  follows: {{expr: "c' = 0", limit: "{scale * limit!r} - {scale * fall!r}*(y + y'^2)"}}
initial: {{a: 0, a': 0, b: 0, b': 0, c: 0, c': 0, y: 0, y': {v!r}}}
simulation: {{times: [0, 2.5]}}
""")
        found = run_contact(model)
        follows = (limit - fall * v**2) / (load + fall * v)
        times = {"constant": limit / load, "falls": limit / (load + fall), "follows": follows}
        for name, time in times.items():
            (slips,) = found.entries("slips", name)
            assert slips.time == pytest.approx(time, rel=1e-12), name
        for k, (name, rate) in enumerate((("constant", load), ("falls", load + fall))):
            slid = way * scale * rate * (2.5 - times[name]) ** 3 / 6
            assert found.block.q[-1, k] == pytest.approx(slid, rel=1e-9), name


@pytest.mark.parametrize("rtol", [1e-4, 1e-12])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("power", [1, 2, 3, 4, 5])
def test_forces_that_begin_at_their_bounds_and_leave_them_slowly(
    power: int, scale: float, rtol: float
) -> None:
    """A friction force at its limit and a contact force of zero: by powers of time."""
    rng = np.random.default_rng(power)
    k, end, limit, weight = rng.uniform([0.2, 1.5, 0.5, 0.5], [0.8, 2.5, 2, 2]).tolist()
    model = load_text(f"""
coordinates: [a, b, y]
T: (a'^2 + b'^2 + y'^2)/2
Q:
  a: "{scale * limit!r}*(1 - {k!r}*t^{power})"
  b: "-{scale * limit!r}*(1 - {k!r}*t^{power})"
  y: "-{scale * weight!r}*t^{power}*({end!r} - t)"
constraints:
  forward: {{expr: "a' = 0", limit: {scale * limit!r}}}
  backward: {{expr: "b' = 0", limit: {scale * limit!r}}}
  floor: y >= 0
initial: {{a: 0, a': 0, b: 0, b': 0, y: 0, y': 0}}
simulation: {{times: [0, 4]}}
""")
    found = run_contact(model, rtol=rtol)
    slips = (2 / k) ** (1 / power)
    expected = {("slips", "forward"): slips, ("slips", "backward"): slips, ("opens", "floor"): end}
    for (kind, name), time in expected.items():
        assert [x.time for x in found.entries(kind, name)] == pytest.approx([time], rel=1e-12)
    # without a load, the floor counts as open: it closes where the body is below it beyond rounding
    (closes,) = found.entries("closes", "floor")
    assert closes.time < 0.01
    assert closes.q[2] == pytest.approx(0, abs=1e-13 * scale)
    assert not found.entries("sticks")


def test_the_sign_of_a_force_ends_no_step_where_no_friction_depends_on_it() -> None:
    """A rail that an event may release, and that it never does, costs what one without it does."""
    text = """
coordinates: [x, y]
T: (x'^2 + y'^2)/2
Q: {x: -x, y: 3*sin(7*t)}
constraints: {rail: y = 0}
initial: {x: 1, x': 0, y: 0, y': 0}
"""
    release = "events: {never: {when: x >= 5, release: rail}}\n"
    runs = [
        lagcli.simulate(load_text(text + events), method="DOP853", t_end=10, samples=2)
        for events in ("", release)
    ]
    assert runs[1].counts["steps"] == runs[0].counts["steps"]
    assert runs[1].counts["evaluations"] <= runs[0].counts["evaluations"] + 10
    np.testing.assert_allclose(runs[1].q, runs[0].q, rtol=1e-9, atol=1e-12)


def test_friction_of_guides_whose_forces_change_their_signs() -> None:
    """The deceleration has a corner where the force of a guide is zero, and is linear beside it."""
    errors = []
    for k, root in enumerate(np.linspace(0.3, 1.9, 16).tolist()):
        model = load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
Q: {{y: "{1.7 * (-1) ** k}*(t - {root!r})"}}
constraints: {{guide: y = 0, rubs: {{expr: "x' = 0", limit: 0.3*abs(lambda.guide)}}}}
initial: {{x: 0, x': {5 * (-1) ** (k // 2)}, y: 0, y': 0}}
simulation: {{times: [0, 2]}}
""")
        v = run_contact(model, rtol=1e-12).block.v[-1, 0]
        errors.append(abs(v) - (5 - 0.3 * 1.7 * (root**2 + (2 - root) ** 2) / 2))
    # without a stop at the root, five times as much
    assert np.median(np.abs(errors)) < 5e-13


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("root", [1e-3, 1e-2, 1.0])
def test_what_leaves_zero_from_rest_and_returns(root: float, scale: float) -> None:
    """x = c t^n (t - root): in the first step, or where a clock's tick of 1 s ends one."""
    for c, power in ((0.7, 2), (-1.3, 2), (1.1, 3), (-0.4, 4)):
        force = (c * scale * Polynomial.fromroots([0.0] * power + [root])).deriv(2)
        terms = " + ".join(f"({x!r})*t^{k}" for k, x in enumerate(force.coef.tolist()))
        model = load_text(f"""
coordinates: [x]
T: x'^2/2
Q: {{x: "{terms}"}}
initial: {{x: 0, x': 0}}
events:
  zero: {{when: x = 0}}
  c: {{every: 1}}
simulation: {{times: [0, 2.2]}}
""")
        times = [x.time for x in run_contact(model).entries("event", "zero")]
        assert times == pytest.approx([root], rel=1e-9)


@pytest.mark.parametrize(
    ("method", "kick", "rtol", "size"),
    [(x, y, 1e-2, 1.0) for x in ("DOP853", "Taylor") for y in (1e-2, 1e-4, 1e-6)]
    + [
        (x, y, z, 1e6)
        for x in ("Radau", "Rodas5P")
        for y, z in ((0.1, 1e-8), (1e-3, 1e-8), (1e-5, 1e-4))
    ],
)
def test_hops_are_seen_beside_larger_motions(
    method: str, kick: float, rtol: float, size: float
) -> None:
    """A body falls from 1 onto the floor, rests there, and is kicked up by very little.

    Implicit methods have dense outputs that are off the floor by their tolerance as a gap opens.
    """
    model = load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 2*y
constraints: {{far: x >= 0, floor: {{expr: y >= 0, restitution: 0}}}}
initial: {{x: {size}, x': {size}, y: 1, y': 0}}
events: {{kick: {{when: t >= 2, impulse: {{y: {kick}}}}}}}
simulation: {{times: [0, 3]}}
""")
    found = run_contact(model, method=method, rtol=rtol)
    times = [x.time for x in found.entries("impact", "floor")]
    assert times == pytest.approx([1, 2 + kick], rel=1e-9)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("walls", ["x <= {0}, x >= -{1}", "{0} - x >= 0, -x - {1} <= 0"])
def test_a_body_between_two_walls_strikes_them_in_turn(walls: str, scale: float) -> None:
    """Walls of either sense, far from each other and from the middle; without and with a loss."""
    rng = np.random.default_rng(8)
    for returned in (1.0, 0.8):
        right, left, v = (scale * rng.uniform([0.5, 0.2, 3.0], [2.0, 4.0, 5.0])).tolist()
        first, second = walls.format(repr(right), repr(left)).split(", ")
        model = load_text(f"""
coordinates: [x]
T: x'^2/2
constraints:
  right: {{expr: "{first}", restitution: {returned}}}
  left: {{expr: "{second}", restitution: {returned}}}
initial: {{x: 0, x': {v!r}}}
simulation: {{times: [0, 6]}}
""")
        found = run_contact(model)
        times, speed = [right / v], v
        while times[-1] < 6:
            speed *= returned
            times.append(times[-1] + (right + left) / speed)
        for name, expected in (("right", times[:-1:2]), ("left", times[1:-1:2])):
            impacts = [x.time for x in found.entries("impact", name)]
            assert impacts == pytest.approx(expected, rel=1e-12), name


@pytest.mark.parametrize("way", [">=", "<="])
def test_a_condition_that_a_contact_holds_at_zero_from_the_start(way: str) -> None:
    """A body on a floor, or below a ceiling, is kicked off it, and comes back."""
    rng = np.random.default_rng(9)
    up = 1 if way == ">=" else -1
    for scale in (1e-6, 1.0, 1e6):
        h, g, kick, drift = (scale * rng.uniform([-5, 1, 0.5, -3], [5, 10, 2, 3])).tolist()
        model = load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: {up * g!r}*y
constraints: {{floor: {{expr: "y {way} {h!r} + x/3", restitution: 0}}}}
initial: {{x: {scale}, x': {drift!r}, y: {h + scale / 3!r}, y': {drift / 3!r}}}
events:
  there: {{when: "y - x/3 = {h!r}"}}
  back: {{when: "{h!r} + x/3 = y"}}
  still: {{when: "y' = x'/3"}}
  stays: {{when: "x'/3 = y'"}}
  other: {{when: t >= 0.5}}
  kick: {{when: t >= 1, impulse: {{y: {up * kick!r}}}}}
simulation: {{times: [0, {1 + 3 * kick / g!r}]}}
""")
        found = run_contact(model)
        for names, time in (("there back", 1 + 2 * kick / g), ("still stays", 1 + kick / g)):
            for name in names.split():
                times = [x.time for x in found.entries("event", name)]
                assert times == pytest.approx([time], rel=1e-11), name


@pytest.mark.parametrize("way", ["=", ">="])
@pytest.mark.parametrize("factor", ["1", "(1 + t)"])
def test_a_triple_root_at_the_instant_of_another_event(factor: str, way: str) -> None:
    """The condition is zero there, and has no slope, but does not rest."""
    found = run(f"""
coordinates: [x]
T: x'^2/2
initial: {{x: 0, x': 1}}
events:
  crosses: {{when: '{factor}*(t - 1)^3 {way} 0'}}
  clock: {{every: 1}}
simulation: {{times: [0, 3]}}
""")
    times = [x.time for x in found.entries("event", "crosses")]
    assert times == pytest.approx([1], rel=1e-15)


@pytest.mark.parametrize("method", ["DOP853", "Radau", "Rodas5P"])
@pytest.mark.parametrize("rtol", [1e-4, 1e-8])
def test_a_block_lifts_off_and_lands_however_large_its_coordinate_is(
    rtol: float, method: str
) -> None:
    """Under 2 m g sin(2 pi t): from 1/12 of each period on, wherever the floor is.

    Tolerances are those of y, beside which a hop may be small.
    """
    for height in (0.0, 50.0, 1e4, 1e6):
        found = run(
            f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
Q: {{y: 2*9.81*sin(2*pi*t)}}
constraints: {{far: x >= 0, floor: {{expr: y >= {height}, restitution: 0}}}}
initial: {{x: 1, y: {height}, x': 0, y': 0}}
simulation: {{t_end: 6, samples: 200}}
""",
            method=method,
            rtol=rtol,
        )
        opens = [x.time for x in found.entries("opens", "floor")]
        assert opens == pytest.approx(np.arange(6) + 1 / 12, abs=1e-9), height
        assert len(found.entries("impact", "floor")) == 6


@pytest.mark.parametrize("method", ["DOP853", "Radau", "Rodas5P"])
@pytest.mark.parametrize("height", [1.0, 1e3, 1e6])
def test_a_hop_within_the_first_step_after_a_kick_is_seen(height: float, method: str) -> None:
    """A step of this rtol is longer than the hop, and its tolerance is larger."""
    for kick in (1.0, 1e-1, 1e-2, 1e-3):
        found = run(
            f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 2*y
constraints: {{far: x >= 0, floor: {{expr: y >= {height}, restitution: 0}}}}
initial: {{x: 1, x': 1, y: {height}, y': 0}}
events: {{kick: {{when: t >= 2, impulse: {{y: {kick}}}}}}}
simulation: {{t_end: 4, samples: 2}}
""",
            method=method,
            rtol=1e-4,
        )
        times = [x.time for x in found.entries("impact", "floor")]
        # y has rounding errors of 1e-16 of its size, and the hop ends with the speed of the kick
        assert times == pytest.approx([2 + kick], abs=1e-14 + 1e-14 * height / kick), kick
