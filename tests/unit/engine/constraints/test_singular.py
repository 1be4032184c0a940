"""The watch for singular configurations, on a motion whose configurations are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lowered import lowered
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from singular_motions import stated_accuracy, stated_time

import lagcli
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.constraints.projection import Projection
from lagcli.engine.constraints.singular import (
    Crossing,
    RankWatch,
    SingularTime,
    _distance,
    _divided_differences,
    _resolution,
)
from lagcli.engine.contract import Stop
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.sparse_rows import SparseRows

START, SPEED = 0.5, 2.0
#: Both angles turn at 2 rad/s, and both cosines vanish at π/2.
SINGULAR_TIME = (math.pi / 2 - START) / SPEED


def motion(constraint: str = "sin(phi) = sin(psi)", rank: int = 1) -> Index1:
    system, p = lowered(
        lagcli.load_text(f"""
coordinates: [phi, psi]
T: (phi'^2 + psi'^2)/2
constraints: {{guide: "{constraint}"}}
initial: {{phi: 0.5, phi': 2, psi: {{guess: 0.5}}, psi': {{guess: 2}}}}
""")
    )
    found = Index1(Evaluator(system, p), rank)
    found.measure(0.0, np.full(2, START), np.full(2, SPEED))
    return found


def y(t: float) -> np.ndarray:
    """Return the exact motion: no force acts."""
    angle = START + SPEED * t
    return np.array([angle, angle, SPEED, SPEED, 0.0])


@pytest.fixture
def watch() -> RankWatch:
    return RankWatch(motion())


@pytest.mark.parametrize("t", [0.0, 0.2, SINGULAR_TIME, 1.0])
def test_the_weakest_value_is_the_cosine(watch: RankWatch, t: float) -> None:
    expected = abs(math.cos(START + SPEED * t)) / math.cos(START)
    assert watch.weakest(t, y(t)) == pytest.approx(expected, abs=1e-15)


def test_the_singular_time_is_found_between_two(watch: RankWatch) -> None:
    found = watch.singular_time(y, SINGULAR_TIME - 0.1, SINGULAR_TIME + 0.2)
    assert found is not None
    assert found.certain
    assert abs(found.time - SINGULAR_TIME) <= found.within < 1e-8
    least = watch.time_of_least(y, SINGULAR_TIME - 0.1, SINGULAR_TIME + 0.2)
    assert abs(least.time - SINGULAR_TIME) <= least.within < 1e-8
    assert watch.singular_time(y, 0.0, SINGULAR_TIME - 0.1) is None
    # in microseconds
    found = watch.singular_time(lambda t: y(1e6 * t), 1e-7, 1e-6)
    assert found is not None
    assert found.certain
    assert abs(found.time - 1e-6 * SINGULAR_TIME) <= found.within < 1e-14


def test_of_several_weak_states_the_weakest_is_located(watch: RankWatch) -> None:
    """Of two places in which it is weak, one is a thirtieth as far from zero as the other."""

    def path(t: float) -> np.ndarray:
        away = min(0.01 + abs(t - 0.22), 0.3 + abs(t - 0.8))
        return np.array([math.pi / 2 - away, math.pi / 2 - away, SPEED, SPEED, 0.0])

    for low in (0.0, 0.22):
        found = watch.time_of_least(path, low, 1.0)
        assert found.time == pytest.approx(0.22, abs=1e-8)
        assert not found.certain
        assert found.within == math.inf
    assert watch.time_of_least(path, 0.5, 0.8).time == pytest.approx(0.5, abs=1e-8)
    assert watch.singular_time(path, 0.0, 1.0) is None


def test_the_weakest_state_is_located_between_its_neighbors(watch: RankWatch) -> None:
    """Of many minima the least, not one beyond the next of 17 states."""
    least = 0.23 + math.pi / 15

    def path(t: float) -> np.ndarray:
        away = 0.01 + abs(math.sin(15 * (t - least))) / 30 + 0.1 * abs(t - least)
        return np.array([math.pi / 2 - away, math.pi / 2 - away, SPEED, SPEED, 0.0])

    first = least - 0.035, least + 0.765  # the second of 17 states is the nearest
    for low, high in ((0.0, 0.9), (0.02, 0.95), (0.1, 1.2), (-0.3, 0.5), (0.0, least), first):
        assert watch.time_of_least(path, low, high).time == pytest.approx(least, abs=1e-7)


def test_the_first_of_several_singular_times_is_found(watch: RankWatch) -> None:
    def path(t: float) -> np.ndarray:
        angle = math.pi / 2 - math.sin(15 * (t - 0.23)) / 30
        return np.array([angle, angle, SPEED, SPEED, 0.0])

    found = watch.singular_time(path, 0.1, 0.95)
    assert found is not None
    assert found.time == pytest.approx(0.23, abs=1e-9)


def test_times_are_resolved_relative_to_the_larger_of_time_and_duration() -> None:
    assert _resolution(-1.0, 0.0) == 1e-12
    assert _resolution(0.0, 3.0) == 3e-12
    assert _resolution(1e6, 1e6 + 1.0) == pytest.approx(1e-6, rel=1e-5)
    assert _resolution(-5.0, -4.0) == 4e-12


def test_a_path_off_the_constraints_is_not_certain(watch: RankWatch) -> None:
    """Two branches that miss each other by its residual: one is turned away, one is not."""

    def path(t: float) -> np.ndarray:
        phi = START + SPEED * t
        return np.array([phi, math.pi / 2 + 1e-3, SPEED, SPEED, 0.0])

    found = watch.singular_time(path, SINGULAR_TIME - 0.1, SINGULAR_TIME + 0.2)
    assert found is not None
    assert found.time == pytest.approx(SINGULAR_TIME, abs=1e-3)
    assert not found.certain


@pytest.mark.parametrize("length", [0.1, 1.0, 30.0])
def test_how_far_a_state_is_off_the_constraints_counts_by_the_length_of_their_rows(
    length: float,
) -> None:
    found = motion()
    found.lengths[:] = length
    watch = RankWatch(found)
    state = np.array([0.5, 0.6, SPEED, SPEED, 0.0])
    residual = (math.sin(0.6) - math.sin(0.5)) / length
    point = watch._at(lambda t: state, 0.0)
    assert point.weakest - point.least == pytest.approx(math.sqrt(2 * residual), rel=1e-12)


def test_where_b_is_undefined_or_has_no_rows_nothing_is_near(watch: RankWatch) -> None:
    assert watch.weakest(0.0, np.full(5, math.nan)) == 1.0
    watch.rank = 0
    assert watch.weakest(0.0, y(SINGULAR_TIME)) == 1.0


def test_the_error_of_a_path_is_its_difference_from_another(watch: RankWatch) -> None:
    ends = SINGULAR_TIME - 0.1, SINGULAR_TIME + 0.2
    for late in (1e-3, -1e-5, *(1e-4 * 1.3**k for k in range(1, 6))):
        for search in (watch.singular_time, watch.time_of_least):
            found = search(y, *ends, lambda t, late=late: y(t - late))
            assert found is not None
            # three times the error, and at most twice that
            assert 2.9 * abs(late) < found.within < 6.1 * abs(late)


def test_a_time_is_located_to_where_both_sides_are_clearly_not_zero(watch: RankWatch) -> None:
    """The value rises slowly before the time, and fast after it."""

    def path(t: float) -> np.ndarray:
        away = 1e-6 + (1.0 if t > 0.5 else 1e-5) * abs(t - 0.5)
        return np.array([math.pi / 2 - away, math.pi / 2 - away, SPEED, SPEED, 0.0])

    found = watch.time_of_least(path, 0.0, 1.0)
    assert found.time == pytest.approx(0.5, abs=1e-6)
    assert 0.2 <= found.within <= 0.5


@pytest.mark.parametrize("start", [-3.0, 0.0, 1e3])
def test_a_path_that_jumps_over_a_singular_configuration_is_examined_to_an_end(
    watch: RankWatch, start: float
) -> None:
    def path(t: float) -> np.ndarray:
        angle = math.pi / 2 + (0.5 if t > start + 0.3 else -0.5)
        return np.array([angle, angle, SPEED, SPEED, 0.0])

    assert watch.singular_time(path, start, start + 1.0) is None


@pytest.mark.parametrize("part", [1.0, 0.1])
def test_states_inside_a_step_are_as_near_as_ahead_of_it(part: float) -> None:
    """Whatever the largest value was, in parts of the rows' largest lengths."""
    found = motion()
    found.lengths /= part
    watch = RankWatch(found)
    usual = watch.weakest(0.0, y(0.0))
    singular = SingularTime(SINGULAR_TIME, 1e-9, True)
    project = Projection(watch.motion.evaluator, 1)
    for far in (0.5, 0.01):
        ahead = watch.inside(singular, y, SINGULAR_TIME - far, usual, project)
        # 0.04 of the largest value, that of the start
        distance = min(far, 0.04 * far / math.sin(2 * far) * math.cos(START))
        times = [SINGULAR_TIME - distance * k / 4 for k in (4, 3, 2, 1)]
        assert [t for t, _ in ahead.before] == pytest.approx(times, rel=1e-12)
        for t, state in ahead.before:
            np.testing.assert_allclose(state, y(t), atol=1e-12)
    assert ahead.path(1.0)[1].tolist() == [SPEED, SPEED]


def test_nonzero_entries_are_scaled_as_an_array() -> None:
    found = motion()
    found.sizes, found.lengths = np.array([2.0, 3.0]), np.array([5.0])
    rows = SparseRows((1, 2), np.array([0, 0]), np.array([1, 0]), np.array([7.0, 11.0]))
    watch = RankWatch(found)
    assert watch._scaled(rows).tolist() == pytest.approx([7 * 3 / 5, 11 * 2 / 5])
    assert watch._scaled(np.asarray(rows)).tolist() == [pytest.approx([11 * 2 / 5, 7 * 3 / 5])]


@pytest.mark.parametrize("again", ["", "again: 3*u[1] = 0"])
def test_a_large_system_is_watched_by_its_nonzero_entries(
    again: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two rows whose angle w passes π, among orthonormal ones."""
    monkeypatch.setattr("lagcli.engine.evaluator._LARGE", 0)
    system, p = lowered(
        lagcli.load_text(f"""
coordinates: [x, y, w, u[1..40]]
T: (x'^2 + y'^2 + w'^2 + sum(u[i]'^2, i = 1..40))/2
constraints:
  one: x = 0
  two: x*cos(w) + y*sin(w) = 0
  other[i = 1..40]: 2*u[i] = 0
  {again}
initial: {{x: 0, y: 0, w: 1, x': 0, y': 0, w': 1, u[1..40]: 0, u[1..40]': 0}}
""")
    )
    found = Index1(Evaluator(system, p), 42)

    def path(t: float) -> np.ndarray:
        state = np.zeros(87)
        state[[2, 45]] = 1 + t, 1
        return state

    found.measure(0.0, *np.split(path(math.pi / 2 - 1)[:-1], 2))
    watch = RankWatch(found)
    assert isinstance(watch._rows(0.0, path(0.0)).jacobian, SparseRows)
    for w in (math.pi / 2, 1.0, 3.0, 3.3):
        assert watch.weakest(0.0, path(w - 1)) == pytest.approx((1 - abs(math.cos(w))) ** 0.5)
    assert watch.weakest(0.0, np.full(87, np.nan)) == 1.0
    for search in (watch.singular_time, watch.time_of_least):
        at = search(path, 1.0, 3.0)
        assert at is not None
        assert at.certain
        assert abs(at.time + 1 - math.pi) <= at.within < 1e-5


@pytest.mark.parametrize("scale", [1, 1e5])
@pytest.mark.parametrize(("e", "named"), [(0.08, "abc"), (0.065, "ac"), (-0.08, "abc")])
def test_constraints_with_a_small_part_in_the_dependency_are_not_named(
    e: float, named: str, scale: float
) -> None:
    """Below a twentieth: the combination is (1, e, -1)/√(2 + e²), but for the row's length."""
    system, p = lowered(
        lagcli.load_text(f"""
coordinates: [x, y, z]
T: (x'^2 + y'^2 + z'^2)/2
constraints: {{a: x = 0, b: y = 0, c: {scale}*(x + {e}*y + z^2) = 0}}
initial: {{x: 0, y: 0, z: 0, x': 0, y': 0, z': 0}}
""")
    )
    found = Index1(Evaluator(system, p), 3)
    found.measure(0.0, np.zeros(3), np.zeros(3))
    at = SingularTime(0.0, 1e-9, True)
    message = str(RankWatch(found).stop(at, np.zeros(3), np.zeros(3), ""))
    assert [name for name in "abc" if f"`{name}`" in message] == list(named)


def test_the_distance_of_states() -> None:
    """Of q or v, the larger; relative to the size of the other state, each by its kind."""
    q, v, sizes = np.array([1.0, -20.0]), np.array([3.0, 0.0]), np.array([1.0, 10.0])
    change = np.array([0.01, 0.3])
    assert _distance((q + change, v), (q, v), sizes) == pytest.approx(0.03 / 2)
    assert _distance((q, v - change), (q, v), sizes) == pytest.approx(0.03 / 3)
    assert _distance((q + change, v - change), (q, v), sizes) == pytest.approx(0.03 / 2)
    assert _distance((q, change), (q, np.zeros(2)), sizes) == pytest.approx(0.03)


def states(*distances: float) -> list[tuple[float, np.ndarray]]:
    """Return the states so long before the singular one."""
    return [(SINGULAR_TIME - d, y(SINGULAR_TIME - d)) for d in distances]


def unmoved(_t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return q, v


@pytest.mark.parametrize("count", [3, 4])
def test_what_the_path_leads_to_is_found_before(watch: RankWatch, count: int) -> None:
    last = states(0.03, 0.02, 0.015, 0.01)[-count:]
    ahead = watch.ahead(last, y, unmoved)
    assert ahead is not None
    assert ahead.singular.time == pytest.approx(SINGULAR_TIME, abs=1e-7)
    q, v = ahead.path(ahead.singular.time)
    np.testing.assert_allclose(q, math.pi / 2, atol=1e-7)
    np.testing.assert_allclose(v, SPEED, atol=1e-5)
    assert ahead.before == tuple(last)
    # a long step may have led to them, or to the last but one
    ahead = watch.ahead(states(0.1, 0.02, 0.015, 0.01), y, unmoved)
    assert ahead is not None
    assert [t for t, _ in ahead.before] == [SINGULAR_TIME - d for d in (0.02, 0.015, 0.01)]
    ahead = watch.ahead(states(0.1, 0.02, 0.01), y, unmoved)
    assert ahead is not None
    before = [SINGULAR_TIME - t for t, _ in ahead.before]
    assert before == pytest.approx([0.02, 0.015, 0.01], rel=1e-12)
    # after a long step, nearer ones inside it
    ahead = watch.ahead(states(0.1, 0.05, 0.01), y, unmoved)
    assert ahead is not None
    before = [ahead.singular.time - t for t, _ in ahead.before]
    assert before == pytest.approx([0.04, 0.03, 0.02, 0.01], abs=1e-6)
    for t, state in ahead.before:
        np.testing.assert_allclose(state, y(t), atol=1e-12)
    # none, where the steps lead away from it
    assert watch.ahead([(-t, at) for t, at in reversed(last)], y, unmoved) is None


@pytest.mark.parametrize(("last", "known"), [(1e-8, True), (1e-9, False)])
def test_a_path_that_is_nearer_than_its_time_is_known_is_not_examined(
    watch: RankWatch, last: float, known: bool
) -> None:
    """Rounding errors of 1e-9 in the row's direction are 2e-9 s."""
    ahead = watch.ahead(states(0.03, 0.02, 0.015, last), y, unmoved)
    assert (ahead is not None) == known
    if ahead is not None:
        assert last / 10 < ahead.singular.within < last


@pytest.mark.parametrize(
    ("time", "within", "since", "stated"),
    [
        (0.123456789012, 3e-10, None, "t = 0.123456789 s"),
        (0.123456789012, 3e-9, None, "t = 0.12345679 s"),
        (0.123456789012, 1.2e-7, None, "t = 0.1234568 s (to within 2e-07 s)"),
        (0.123456789012, 1.8e-7, None, "t = 0.1234568 s (to within 2e-07 s)"),
        (0.05185076, 4.1e-6, None, "t = 0.051851 s (to within 5e-06 s)"),
        (1.23e-3, 3e-8, 1e-3, "t = 0.00123 s (to within 3e-08 s, extrapolated from t = 0.001 s)"),
        (1234.567, 2.0, 1200.0, "t = 1235 s (to within 3 s, extrapolated from t = 1200 s)"),
        (-0.5, 1e-9, None, "t = -0.5 s"),
    ],
)
def test_times_have_the_digits_that_are_known(
    time: float, within: float, since: float | None, stated: str
) -> None:
    assert SingularTime(time, within, True).stated(since) == stated


def test_stated_times_include_their_rounding() -> None:
    rng = np.random.default_rng(0)
    for _ in range(500):
        time, within = rng.uniform(0.1, 10), 10 ** rng.uniform(-9, -2)
        text = "singular configuration at " + SingularTime(time, within, True).stated()
        error = within + abs(stated_time(text) - time)
        assert error <= stated_accuracy(text) * (1 + 1e-9), (time, within, text)


def test_messages_name_constraints_and_ways_out(watch: RankWatch) -> None:
    q, v = watch.motion.split(y(SINGULAR_TIME))
    text = str(watch.stop(SingularTime(0.5, 1e-9, True), q, v, "an advice"))
    assert "singular configuration at t = 0.5 s: the constraint" in text
    assert "`guide` has no gradient there" in text
    assert text.endswith("the motion; an advice")
    # where steps become short next to it, its time is not known
    text = str(watch.floor(0.25, y(SINGULAR_TIME - 0.01)))
    assert "fell to its minimum at t = 0.25 s, next to a singular configuration" in text
    assert "`guide` has no gradient there" in text


@pytest.mark.parametrize(("turns", "speed"), [(0, 0.0), (0, 1.0), (300, 1.0)])
def test_a_singular_start_is_distinguished_from_redundant_constraints(
    turns: int, speed: float
) -> None:
    q, v = np.full(2, turns * math.tau), np.full(2, speed)
    found = motion("cos(phi) = cos(psi)", rank=0)
    found.lengths[:] = 0.0
    found.measure(0.0, q, v)
    project = Projection(found.evaluator, 0)
    with pytest.raises(Stop, match=r"the start is a singular configuration: .*`guide`"):
        RankWatch(found).check_start(0.0, q, v, project)
    RankWatch(found).check_start(0.0, q * math.nan, v, project)  # another message says so
    system, p = lowered(
        lagcli.load_text("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
constraints: {one: x + y = 0, two: 2*x + 2*y = 0}
initial: {x: 0, y: 0, x': 0, y': 0}
""")
    )
    found = Index1(Evaluator(system, p), 1)
    found.measure(0.0, 0 * q, v)
    RankWatch(found).check_start(0.0, 0 * q, 0 * v, Projection(found.evaluator, 1))


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_a_singular_start_at_the_origin_is_found_by_the_size_of_the_constraints(
    size: float,
) -> None:
    """A circle and a saddle that touch: apart from the origin, they meet on an axis."""
    system, p = lowered(
        lagcli.load_text(f"""
coordinates: [x, y, z]
T: (x'^2 + y'^2 + z'^2)/2
constraints: {{circle: x^2 + (y - {size})^2 = {size}^2, saddle: y = x*z/{size}}}
initial: {{x: 0, y: 0, z: 0, x': 0, y': 0, z': 0}}
""")
    )
    found = Index1(Evaluator(system, p), 1)
    origin = np.zeros(3)
    found.measure(0.0, origin, origin)
    with pytest.raises(Stop, match=r"the start is a singular configuration: .*`saddle`"):
        RankWatch(found).check_start(0.0, origin, origin, Projection(found.evaluator, 1))


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("turned", [0.0, 2.1])
@pytest.mark.parametrize("gravity", [0.0, 9.81])
@pytest.mark.parametrize("at", [0.4, 1.6])
def test_constraints_that_touch_are_singular_and_not_redundant(
    at: float, gravity: float, turned: float, size: float
) -> None:
    """A point on two bars in one line cannot move, though their gradients are equal; B moves."""
    x, y = size * at * math.cos(turned), size * at * math.sin(turned)
    x_o, y_o = size * math.cos(turned), size * math.sin(turned)
    run = lagcli.simulate(
        lagcli.load_text(f"""
coordinates: [x, y, x_B, y_B]
T: (x'^2 + y'^2 + x_B'^2 + y_B'^2)/2
V: {gravity * size}*(y + y_B)
constraints:
  left: x^2 + y^2 = {x * x + y * y}
  right: (x - {x_o})^2 + (y - {y_o})^2 = {(x - x_o) ** 2 + (y - y_o) ** 2}
  rod: (x - x_B)^2 + (y - y_B)^2 = {size}^2
initial:
  {{x: {x}, y: {y}, x_B: {x + 0.6 * size}, y_B: {y + 0.8 * size}, x': 0, y': 0, x_B': 0, y_B': 0}}
"""),
        t_end=0.01,
        samples=3,
    )
    assert (run.status, len(run.time)) == ("failed", 0)
    assert "the constraints `left`, `right` are dependent there, but do not allow" in run.message


G = 9.81
SYSTEM, P = lowered(
    lagcli.load_text(f"""
coordinates: [phi, psi]
T: (phi'^2 + psi'^2)/2
V: 2*{G}*sin(phi)
constraints: {{guide: sin(phi) = sin(psi)}}
initial: {{phi: 0.5, phi': 6, psi: {{guess: 0.5}}, psi': {{guess: 6}}}}
""")
)
#: phi'' = −2 g cos phi + λ cos phi and psi'' = −λ cos psi: both are one pendulum, with λ = g.
EXACT = solve_ivp(
    lambda t, y: [y[1], -G * math.cos(y[0])],
    (0.0, 0.6),
    [0.5, 6.0],
    method="DOP853",
    rtol=1e-13,
    atol=1e-13,
    dense_output=True,
).sol
SINGULAR = brentq(lambda t: EXACT(t)[0] - math.pi / 2, 0.0, 0.6, xtol=1e-15)


def crank_motion() -> Index1:
    found = Index1(Evaluator(SYSTEM, P), 1)
    found.measure(0.0, np.full(2, 0.5), np.full(2, 6.0))
    return found


def crank_state(t: float) -> np.ndarray:
    angle, speed = EXACT(t)
    return np.array([angle, angle, speed, speed, 0.0])


def guess(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a continuation at a constant speed."""
    angle, speed = EXACT(SINGULAR)
    return np.full(2, angle + speed * (t - SINGULAR)), np.full(2, speed)


BEFORE = [(t, crank_state(t)) for t in SINGULAR - np.array([0.012, 0.008, 0.006, 0.004])]


def test_the_motion_continues_as_one_pendulum() -> None:
    found = crank_motion()
    crossing = Crossing(found, Projection(found.evaluator, 1), BEFORE, SINGULAR, guess)
    assert crossing.end == pytest.approx(SINGULAR + 0.004)
    np.testing.assert_allclose(crossing.state, crank_state(crossing.end), rtol=0, atol=1e-9)
    for t in (SINGULAR - 0.002, SINGULAR, SINGULAR + 0.003):
        q, v, a, multipliers, work = crossing(t)
        np.testing.assert_allclose([*q, *v, work], crank_state(t), rtol=0, atol=1e-9)
        np.testing.assert_allclose(a, -G * math.cos(EXACT(t)[0]), rtol=0, atol=1e-6)
        np.testing.assert_allclose(multipliers, [G], rtol=1e-6)


def test_the_work_goes_on_by_the_power(monkeypatch: pytest.MonkeyPatch) -> None:
    found = crank_motion()
    accelerations = found.accelerations

    def powered(t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        a, multipliers, _ = accelerations(t, q, v)
        return a, multipliers, 3.0 + 1000.0 * (t - SINGULAR)

    monkeypatch.setattr(found, "accelerations", powered)
    before = [(t, y + 7.0 * np.eye(5)[4]) for t, y in BEFORE]
    crossing = Crossing(found, Projection(found.evaluator, 1), before, SINGULAR, guess)
    for after in (-0.002, 0.0, 0.003):
        work = 7.0 + 3.0 * (after + 0.004) + 500.0 * (after**2 - 0.004**2)
        assert crossing(SINGULAR + after)[4] == pytest.approx(work, rel=1e-12)
    assert crossing.state[4] == pytest.approx(7.0 + 3.0 * 0.008, rel=1e-12)


def test_the_states_beyond_are_iterated_until_they_settle() -> None:
    found = crank_motion()
    before = [(t, crank_state(t)) for t in SINGULAR - np.array([0.06, 0.04, 0.03, 0.02])]
    crossing = Crossing(found, Projection(found.evaluator, 1), before, SINGULAR, guess)
    np.testing.assert_allclose(crossing.state, crank_state(crossing.end), rtol=0, atol=1e-11)


@pytest.mark.parametrize("last", [0.004, 1e-6, 1e-8])
def test_a_step_may_end_next_to_the_configuration(last: float) -> None:
    """The work so far goes on, as no power is supplied."""
    found = crank_motion()
    times = SINGULAR - np.array([0.012, 0.008, 0.006, last])
    before = [(t, np.append(crank_state(t)[:4], 2.5)) for t in times]
    crossing = Crossing(found, Projection(found.evaluator, 1), before, SINGULAR, guess)
    np.testing.assert_allclose(crossing.state[:4], crank_state(SINGULAR + last)[:4], atol=1e-8)
    assert crossing.state[4] == pytest.approx(2.5, rel=1e-12)


def test_rounding_of_far_states_does_not_end_a_passage() -> None:
    """Next to the configuration they have no effect: their distance is a million times larger."""
    found = crank_motion()
    project, calls = Projection(found.evaluator, 1), [0]

    def rounded(t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        calls[0] += 1
        q, v = project(t, q, v)
        return q, v + (1e-7 * math.sin(calls[0]) if abs(t - SINGULAR) > 1e-3 else 0.0)

    before = [(t, crank_state(t)) for t in SINGULAR - np.array([0.012, 0.008, 0.006, 1e-8])]
    crossing = Crossing(found, rounded, before, SINGULAR, guess)
    np.testing.assert_allclose(crossing.state[:4], crank_state(SINGULAR)[:4], atol=1e-6)


@pytest.mark.parametrize("first", [0.0, 1.0])
@pytest.mark.parametrize("last", [0.0, 1.0])
def test_where_states_beyond_do_not_settle_there_is_no_continuation(
    first: float, last: float
) -> None:
    """Whichever of them does not."""
    found = crank_motion()
    calls = [0]
    mirrored = [2 * SINGULAR - t for t, _ in BEFORE]
    restless = {min(mirrored): first, max(mirrored): last}

    def project(t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        calls[0] += 1
        return q + 0.01 * math.sin(calls[0]) * restless.get(t, 0.0), v

    if not first and not last:
        assert Crossing(found, project, BEFORE, SINGULAR, guess).end == min(mirrored)
        return
    with pytest.raises(Stop, match="cannot be continued through the singular configuration"):
        Crossing(found, project, BEFORE, SINGULAR, guess)


def test_states_without_accelerations_end_it() -> None:
    found = crank_motion()

    def lost(t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return q * math.nan, v

    with pytest.raises(Stop, match=f"at t = {SINGULAR:.9g} s; try a smaller --rtol"):
        Crossing(found, lost, BEFORE, SINGULAR, guess)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_polynomials_have_values_and_two_derivatives(count: int) -> None:
    """Polynomials of degree 3 n − 1 are known by their values and derivatives at n times."""
    random = np.random.default_rng(count)
    times = (np.linspace(-1, 1, count) + random.uniform(-0.2, 0.2, count)).tolist()
    given = [np.polynomial.Polynomial(random.normal(size=3 * count)) for _ in range(2)]
    rows = [np.array([p.deriv(k)(t) for p in given]) for t in times for k in range(3)]
    nodes = [t for t in times for _ in range(3)]
    found = _divided_differences(nodes, rows)
    at = random.uniform(-2, 2, 20)
    products = [np.prod([at - t for t in nodes[:k]], axis=0) for k in range(3 * count)]
    for i, p in enumerate(given):
        values = sum(c[i] * product for c, product in zip(found, products, strict=True))
        np.testing.assert_allclose(values, p(at), rtol=1e-9, atol=1e-9)
