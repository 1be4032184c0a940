"""What the core's watch measures at a state: how near B is to losing rank."""

from __future__ import annotations

import re
from ctypes import byref, c_double, c_int
from functools import cache

import numpy as np
import pytest
from core_parts import parts
from known_events import METHODS
from numpy.polynomial import Polynomial
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import qr

import lagcli
from lagcli.arrays import Array
from lagcli.engine.core.status import Status
from lagcli.engine.core.structures import Arguments
from lagcli.engine.integrate.prepared import prepare
from lagcli.engine.integrate.run import Integration
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import Simulation
from lagcli.simulations.simulation import prepare as prepare_run

SOLUTIONS = ("unrolled", "in a loop", "densely")
#: Particles whose rows of B are too many to orthogonalize them.
MANY = 22

#: Two rows of unit length with the angle w between them; the second can become short with s.
TWO_ROWS = """
coordinates: [x, y, w, s]
T: (x'^2 + y'^2 + w'^2 + s'^2)/2
constraints:
  one: x = 0
  two: s*(x*cos(w) + y*sin(w)) = 0
initial: {x: 0, y: 0, w: 1, s: 1, x': 0, y': 0, w': 1, s': 0}
"""

#: Particles on rods, heavy and light in turn.
CHAIN = """
parameters: {{N: {count}}}
coordinates: [x[1..N], y[1..N], u]
T: sum((1.01 + cos(pi*i))*(x[i]'^2 + y[i]'^2), i = 1..N)/2 + u'^2/200
V: sum(y[i], i = 1..N) + u
constraints:
  first: x[1]^2 + y[1]^2 = 1
  rod[i = 2..N]: (x[i] - x[i-1])^2 + (y[i] - y[i-1])^2 = 1
  bar: u = x[N]*y[1]
initial:
  x[i = 1..N]: i*0.8
  y[i = 1..N]: {{guess: -i*0.6}}
  u: {{guess: 0}}
  x[1..N]': 0
  y[1..N]': {{guess: 0}}
  u': {{guess: 0}}
"""


#: A coordinate without inertia beside one with little influence on it.
PAIRS = """
coordinates: [x, y, z]
T: x'^2/2 + y'*x'*x/9 + 3*z'^2
constraints: {one: (2 + cos(x))*y = 0.01*sin(x)*z}
initial: {x: 0.3, y: {guess: 0}, z: 1, x': 0, y': {guess: 0}, z': 0}
"""


@cache
def prepared(text: str, sensitivity: tuple[str, ...]) -> Simulation:
    settings = SettingsOverrides(t_end=1.0, method="DOP853", sensitivity=sensitivity or None)
    return prepare_run(lagcli.load_text(text), settings)


class Watched(Integration):
    """An integration that has started, at (0, q, v), and solves for a and λ in one way."""

    def __init__(self, text: str, solution: str, sensitivity: tuple[str, ...] = ()):
        simulation = prepared(text, sensitivity)
        super().__init__(simulation.system, simulation.request, lambda block: None, None)
        self.plan = self.in_use.elimination
        if solution != "unrolled":
            dynamics = prepare(self.system, None, None).dynamics
            if solution == "densely":
                self.core.use_dense(dynamics)
            else:
                assert self.plan is not None
                self.core.use_elimination(dynamics, self.plan, False)
        else:
            assert self.in_use.unrolled
        self.core.start()

    def measured(self, q: Array, v: Array) -> tuple[float, float]:
        """Return ln |det [[M, Bᵀ], [B, 0]]|, but for a constant, and the least pivot."""
        determinant, pivot = c_double(), c_double()
        y = Arguments().doubles([*q, *v, 0.0])
        assert not parts.lag_part_watch(self.core._run, 0.0, y, byref(determinant), byref(pivot))
        return determinant.value, pivot.value

    def steps_over(self, before: Array, after: Array, h: float, speed: float) -> bool:
        """Return whether a step between states (q, v, W) passes a small minimum."""
        given = Arguments()
        ends = given.doubles(before), given.doubles(after)
        return bool(parts.lag_part_steps_over(self.core._run, h, speed, *ends))

    def path(self, times: Array, states: Array) -> tuple[int, Array]:
        """Return whether a step through states (q, v, W) passes a small minimum; the length and the
        largest speed of its path, the margin at its end, and whether it approaches one.
        """
        given, found = Arguments(), np.zeros(4)
        walk = given.doubles(times), given.doubles(states.ravel()), given.doubles(found)
        return parts.lag_part_path(self.core._run, len(times), *walk), found

    def approaches(self, q: Array) -> bool:
        """Return whether a step to a state at rest approaches a singular configuration."""
        y = Arguments().doubles([*q, *np.zeros(len(q) + 1)])
        return bool(parts.lag_part_approaches(self.core._run, 0.0, y))

    def follow(self, t: float, w: float) -> tuple[Status, float, bool]:
        """Return what a step of `TWO_ROWS` to an angle between the rows returns, the limit of the
        next step, and whether the state is near a singular configuration."""
        y, limit, near = Arguments().doubles(angle(w, 1.0)), c_double(), c_int()
        status = parts.lag_part_follow_approach(self.core._run, t, y, byref(limit), byref(near))
        return Status(status), limit.value, bool(near.value)

    def matrices(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return M and B."""
        found = self.evaluator.dynamics(0.0, q, v)
        return found.mass_matrix, found.jacobian


@pytest.mark.parametrize("w", [1.0, 1.5, 0.3, -0.01, 3.14])
def test_the_pivot_of_two_rows_is_the_sine_of_their_angle(w: float) -> None:
    _, pivot = Watched(TWO_ROWS, "unrolled").measured(np.array([0, 0, w, 1.0]), np.zeros(4))
    assert pivot == pytest.approx(abs(np.sin(w)), rel=1e-13)


@pytest.mark.parametrize("s", [0.5, -0.1, 1e-3])
def test_a_row_that_becomes_short_counts_by_its_length(s: float) -> None:
    q = np.array([0, 0, np.pi / 2, s])
    _, pivot = Watched(TWO_ROWS, "unrolled").measured(q, np.zeros(4))
    assert pivot == pytest.approx(abs(s), rel=1e-12)


@pytest.mark.parametrize("solution", SOLUTIONS)
@pytest.mark.parametrize("text", [CHAIN.format(count=8), PAIRS])
def test_the_determinant_of_factors(text: str, solution: str) -> None:
    """Beside NumPy's, but for a constant; also with pivots of order two."""
    watched = Watched(text, solution)
    assert watched.plan is not None
    assert any(watched.plan.paired) == (text == PAIRS)
    rng = np.random.default_rng(8)
    state = watched.request.state
    constants = []
    for _ in range(40):
        q = state.q + rng.normal(scale=0.4, size=len(state.q))
        mass, jacobian = watched.matrices(q, state.v)
        zeros = np.zeros((len(jacobian), len(jacobian)))
        expected = np.linalg.slogdet(np.block([[mass, jacobian.T], [jacobian, zeros]]))[1]
        constants.append(watched.measured(q, state.v)[0] - expected)
    assert np.ptp(constants) < 1e-9


@pytest.mark.parametrize("count", [3, MANY])
def test_of_redundant_rows_the_least_pivot_is_that_of_their_rank(count: int) -> None:
    """Beside a QR decomposition with pivoting; factors of the bordered matrix tell nothing."""
    text = CHAIN.format(count=count).replace("  bar:", "  again: 3*u = 3*x[N]*y[1]\n  bar:")
    watched = Watched(text, "densely")
    state = watched.request.state
    assert watched.request.rank == count + 1
    q = state.q + np.random.default_rng(3).normal(scale=0.3, size=len(state.q))
    sized = watched.matrices(q, state.v)[1] * watched.evaluator.sizes(0.0, state.q, state.v)
    expected = qr((sized / watched.core.lengths[:, None]).T, mode="r", pivoting=True)[0]
    _, pivot = watched.measured(q, state.v)
    assert pivot == pytest.approx(abs(expected[count, count]), rel=1e-9)


class Seen(Exception):
    """A run that is not to begin."""


@pytest.mark.parametrize("rows", ["few", "many"])
def test_derivatives_do_not_change_the_least_pivot(
    rows: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = CHAIN.format(count=3).replace("N: 3}", "N: 3, k: 1}").replace("+ u\n", "+ k*u\n")
    if rows == "many":
        text = AMONG_MANY + "parameters: {k: 1}\nV: k*x\n"
    plain = Watched(text, "in a loop")
    runs: list[Integration] = []

    def see(run: Integration) -> None:
        runs.append(run)
        raise Seen

    model = lagcli.load_text(text)
    with monkeypatch.context() as patch:
        patch.setattr(Integration, "run", see)
        with pytest.raises(Seen):
            lagcli.simulate(model, t_end=1, sensitivity=["k"], method="DOP853")
    (run,) = runs
    assert len(run.system.coordinates) == 2 * len(plain.system.coordinates)
    run.core.start()
    state = plain.request.state
    for seed in range(3):
        q = state.q + np.random.default_rng(seed).normal(scale=0.3, size=len(state.q))
        twice = np.append(q, 0 * q), np.append(state.v, 0 * state.v)
        expected = plain.measured(q, state.v)[1]
        found = Watched.measured(run, *twice)[1]  # type: ignore[arg-type]
        assert found == pytest.approx(expected, rel=1e-2 if rows == "many" else 1e-12)
    walk = state.q + np.random.default_rng(3).normal(scale=0.1, size=(5, len(state.q)))
    rest = np.zeros_like(walk)
    alone = plain.path(np.arange(5.0), np.hstack([walk, rest, rest[:, :1]]))
    beside = np.hstack([walk, rest, rest, rest, rest[:, :1]])
    found_beside = Watched.path(run, np.arange(5.0), beside)  # type: ignore[arg-type]
    assert found_beside[0] == alone[0]
    np.testing.assert_allclose(found_beside[1], alone[1], rtol=1e-12)


@pytest.mark.parametrize(
    ("solution", "unit"), [("in a loop", "1"), ("densely", "1"), ("in a loop", "1e-8")]
)
def test_the_least_singular_value_of_many_rows(solution: str, unit: str) -> None:
    """By inverse iteration, from above: exact next to a singular configuration."""
    text = CHAIN.format(count=MANY).replace("T: ", f"T: {unit}*(").replace("/200", "/200)")
    watched = Watched(text, solution)
    state, n = watched.request.state, MANY
    rng = np.random.default_rng(2)
    for near, short in [(1.0, 1), (1e-1, 0), (1e-2, 1), (1e-2, 0), (1e-3, 0), (1e-3, 1)]:
        q = state.q + rng.normal(scale=0.1, size=len(state.q))
        # the last rod, or the first, becomes short, and so its row
        if short:
            q[[n - 1, 2 * n - 1]] = q[[n - 2, 2 * n - 2]] + near * rng.normal(size=2)
        else:
            q[[0, n]] = near * rng.normal(size=2)
        mass, jacobian = watched.matrices(q, state.v)
        rows = jacobian / watched.core.lengths[:, None]
        least = np.sqrt(np.linalg.eigvalsh(rows @ np.linalg.solve(mass, rows.T))[0])
        _, pivot = watched.measured(q, state.v)
        assert least * (1 - 1e-9) <= pivot <= least * (1.2 if near > 0.05 else 1.02)


def test_the_least_singular_value_of_orthonormal_rows_is_one() -> None:
    watched = Watched(AMONG_MANY, "in a loop")
    q = np.zeros(30)
    q[2:4] = np.pi / 2, 1
    assert watched.measured(q, 0 * q)[1] == pytest.approx(1.0, rel=1e-12)


def angle(w: float, rate: float) -> Array:
    """Return the state (q, v, W) of the two rows."""
    return np.array([0, 0, w, 1, 0, 0, rate, 0, 0])


def test_a_minimum_within_a_step_is_found_wherever_it_is() -> None:
    """The angle moves from one side of zero to the other, at the ends and inside."""
    watched = Watched(TWO_ROWS, "unrolled")
    watched.measured(np.array([0, 0, np.pi / 2, 1]), np.zeros(4))
    for h in (0.01, 1.0, 30.0):
        for place in np.linspace(0.002, 0.998, 40):
            a, b = 1.2 * place, -1.2 * (1 - place)
            assert watched.steps_over(angle(a, -1.2 / h), angle(b, -1.2 / h), h, 1.2 / h)
            # the sine of an angle that has its minimum beyond an end
            past = angle(a + 0.2, 1.2 / h), angle(a + 1.4, 1.2 / h)
            assert not watched.steps_over(*past, h, 1.2 / h)


@pytest.mark.parametrize("h", [0.01, 1.0, 30.0])
@pytest.mark.parametrize("side", [-1e-6, 1e-6])
def test_a_step_that_ends_next_to_a_singular_configuration_is_found(h: float, side: float) -> None:
    """Below 1e-4 of the largest value at an end, whatever is between."""
    watched = Watched(TWO_ROWS, "unrolled")
    watched.measured(np.array([0, 0, np.pi / 2, 1]), np.zeros(4))
    rate = (side - 1.2) / h
    assert watched.steps_over(angle(1.2, rate), angle(side, rate), h, 1.2 / h)
    assert watched.steps_over(angle(side, -rate), angle(1.2, -rate), h, 1.2 / h)


def cubic(start: Array, rate: Array, end: Array, slope: Array, h: float, x: Array) -> Array:
    """Return Hermite's polynomial at parts x of an interval, by SciPy."""
    return np.asarray(CubicHermiteSpline([0, h], [start, end], [rate, slope])(h * np.asarray(x)))


def test_the_path_of_b_is_measured_through_all_stages() -> None:
    """Step by step; its margin is a bound of the least singular value."""
    rng = np.random.default_rng(12)
    # the first entry of B changes, or is constant
    first = "  one: x = 0\n"
    rows = (
        TWO_ROWS,
        TWO_ROWS.replace(first, "")
        .replace("two: ", "two: 3*")
        .replace("initial", f"{first}initial"),
    )
    for k in range(12):
        watched = Watched(rows[k % 2], "unrolled")
        sizes = watched.evaluator.sizes(0.0, watched.request.state.q, watched.request.state.v)
        scale = sizes / watched.core.lengths[:, None]

        def scaled(q: Array, watched: Watched = watched, scale: Array = scale) -> Array:
            return watched.matrices(q, np.zeros(4))[1] * scale

        t, last = 0.0, watched.request.state.q
        step, usual = 10.0 ** rng.uniform(-4, -1), np.sin(1.0)
        margin = usual / 2
        for _ in range(30):
            count = int(rng.integers(2, 6))
            times = t + np.append(0, 10.0 ** rng.uniform(-2, 1) * np.sort(rng.random(count)))
            walk = np.array([last, *(last + step * rng.normal(size=(count, 4)))])
            b = np.array([scaled(q) for q in walk])
            parts_of_it = np.linalg.norm(np.diff(b, axis=0), axis=(1, 2))
            seen = watched.core.report.examined
            over, found = watched.path(times, np.pad(walk, [(0, 0), (0, 5)]))
            seen = watched.core.report.examined - seen
            assert found[0] == pytest.approx(parts_of_it.sum(), rel=1e-9)
            assert found[1] == pytest.approx((parts_of_it / np.diff(times)).max(), rel=1e-9)
            least = [np.linalg.svd(x, compute_uv=False)[-1] for x in b]
            if found[0] < margin - usual * 0.15:
                assert not over
                assert not seen  # nothing is computed
                assert found[2] == pytest.approx(margin - found[0], rel=1e-9)
            else:
                pivot = watched.measured(walk[-1], np.zeros(4))[1]
                usual = max(usual, pivot)
                assert found[2] == pytest.approx(pivot / 2, rel=1e-12)
                assert (seen == 1) == (found[0] < margin + found[2])
                assert over or min(least) > 1e-4
                assert not over or found[0] >= margin + found[2]
            assert found[2] <= least[-1]
            margin, t, last = found[2], times[-1], walk[-1]
            if over:
                break


def test_where_rows_become_longer_the_margin_shrinks_as_much() -> None:
    """The second row's length is s."""
    watched = Watched(TWO_ROWS, "unrolled")
    margin = np.sin(1.0) / 2

    def step(t: float, s: float) -> Array:
        walk = np.zeros((3, 9))
        walk[:, 2], walk[:, 3] = 1.0, np.linspace(s, s + 0.02, 3)
        over, found = watched.path(t + np.arange(3.0), walk)
        assert not over
        return found

    found = step(0, 1.0)
    assert found[0] == pytest.approx(0.02)
    assert found[2] == pytest.approx(margin - 0.02)
    y = Arguments().doubles([0, 0, 1.0, 2.0, 0, 0, 0, 0, 0])
    parts.lag_part_measure(watched.core._run, 2.0, y)
    assert watched.core.lengths == pytest.approx([1, 2])
    found = step(2, 1.02)
    assert found[0] == pytest.approx(0.01)
    assert found[2] == pytest.approx((margin - 0.02) / 2 - 0.01)


def test_long_paths_of_few_rows_are_watched_by_the_determinant_from_the_second_on() -> None:
    """The angle swings back and forth, where ln |det| is nearly a parabola; then it passes π."""
    watched = Watched(TWO_ROWS, "unrolled")

    def sweep(t: float, start: float, end: float) -> tuple[int, int]:
        seen, walk = watched.core.report.examined, np.zeros((9, 9))
        walk[:, 2], walk[:, 3], walk[:, 6] = np.linspace(start, end, 9), 1, (end - start) / 2
        over, _ = watched.path(t + np.linspace(0, 2, 9), walk)
        return over, watched.core.report.examined - seen

    over, examined = sweep(0, 0.6, 2.5)
    assert not over
    assert examined > 2
    for k in (1, 2, 3):
        # the end, and what a search would cost
        assert sweep(2 * k, *((2.5, 0.6) if k % 2 else (0.6, 2.5))) == (0, 5)
    assert sweep(8, 0.6, 4.0)[0] == 1
    with np.errstate(invalid="ignore"):
        assert watched.path(np.arange(3.0), np.full((3, 9), np.nan))[0] == -1  # undefined
    # the factors of redundant rows tell nothing
    text = TWO_ROWS.replace("  two:", "  again: 2*x = 0\n  two:")
    watched = Watched(text, "densely")
    for k in range(3):
        # the end and two states more: a search each time
        assert sweep(2 * k, *((2.2, 0.8) if k % 2 else (0.8, 2.2))) == (0, 3)
    assert sweep(6, 0.8, 4.0)[0] == 1


@pytest.mark.parametrize(("start", "speed", "largest"), [(1, 3, 4), (4, -1, 1)])
def test_the_largest_lengths_of_rows_are_kept(start: int, speed: int, largest: int) -> None:
    """The second row's is s, which grows or falls."""
    text = TWO_ROWS.replace("s: 1", f"s: {start}").replace("s': 0", f"s': {speed}")
    watched = Watched(text.replace("w': 1", "w': 0"), "unrolled")
    before = watched.core.lengths.copy()
    assert watched.run().counts["steps"] > 1
    np.testing.assert_allclose(watched.core.lengths / before, [1, largest], rtol=1e-9)


@pytest.mark.parametrize("count", [3, 4, 5, 6, 9, 16])
def test_what_is_smooth_is_nearly_a_parabola(count: int) -> None:
    """Beside NumPy's least squares, whatever the times, sizes and units."""
    rng = np.random.default_rng(count)
    limit = 0.02 if count == 5 else 0.1
    seen = set()
    for _ in range(60):
        t, h = rng.normal(), 10.0 ** rng.uniform(-3, 2)
        x = np.sort(rng.random(count))
        values = rng.normal(size=3) @ [x**2, x, x**0] * 10.0 ** rng.uniform(-2, 2)
        values += rng.normal(size=count) * 10.0 ** rng.uniform(-3, 0.5)
        fit = Polynomial.fit(x, values, 2)
        deviation = np.abs(values - fit(x)).max()
        given = Arguments()
        args = given.doubles(t + h * x), given.doubles(values)
        smooth = parts.lag_part_is_smooth(count, *args)
        if abs(deviation - limit) > 1e-6:
            assert smooth == (count >= 5 and deviation < limit)
            seen.add(smooth)
    assert seen == ({0, 1} if count > 4 else {0})
    values[rng.integers(count)] = np.nan
    args = given.doubles(t + h * x), given.doubles(values)
    assert not parts.lag_part_is_smooth(count, *args)


#: The two rows among so many that ln |det| is watched.
AMONG_MANY = """
coordinates: [x, y, w, s, u[1..26]]
T: (x'^2 + y'^2 + w'^2 + s'^2 + sum(u[i]'^2, i = 1..26))/2
constraints:
  one: x = 0
  two: s*(x*cos(w) + y*sin(w)) = 0
  other[i = 1..26]: u[i] = 0
initial: {x: 0, y: 0, w: 1, s: 1, x': 0, y': 0, w': 1, s': 0, u[1..26]: 0, u[1..26]': 0}
"""


def test_among_many_rows_the_place_of_a_minimum_is_bracketed() -> None:
    """Where the angle passes zero, and twice where a parabola does; not where it stays away."""
    watched = Watched(AMONG_MANY, "in a loop")

    def state(w: float, rate: float) -> Array:
        q, v = np.zeros((2, 30))
        q[2], q[3], v[2] = w, 1.0, rate
        return np.array([*q, *v, 0.0])

    def bracket(
        before: tuple[float, float], after: tuple[float, float], h: float
    ) -> tuple[float, float] | None:
        """Return the part of the step, from 0 to 1."""
        found = watched.steps_over(state(*before), state(*after), h, 1.0)
        since, _ = watched.core.step
        low, high = ((x - since) / h for x in watched.core.suspect)
        return (low - 1e-9, high + 1e-9) if found else None

    for h in (0.01, 1.0, 30.0):
        for place in np.linspace(0.002, 0.998, 25):
            a, b = 1.2 * place, -1.2 * (1 - place)
            found = bracket((a, -1.2 / h), (b, -1.2 / h), h)
            assert found is not None
            assert max(0.0, place - 4 / 64) <= found[0] + 1e-8
            assert found[0] <= place <= found[1] <= min(1.0, place + 4 / 64) + 1e-8
            # a part more on both sides: the motion is not quite on the cubic
            assert found[0] <= max(0.0, place - 1 / 64)
            assert found[1] >= min(1.0, place + 1 / 64)
            assert not bracket((a + 0.4, 1.2 / h), (a + 1.2, 1.2 / h), h)
            ends = [((x - place) ** 2 - 0.04, 2 * (x - place) / h) for x in (0.0, 1.0)]
            found = bracket(ends[0], ends[1], h)
            inside = [x for x in (place - 0.2, place + 0.2) if 0.0 <= x <= 1.0]
            assert found is not None
            assert found[0] <= min(inside) <= max(inside) <= found[1]
            assert found[1] - found[0] < max(inside) - min(inside) + 8 / 64
            ends = [((x - place) ** 2 + 0.04, 2 * (x - place) / h) for x in (0.0, 1.0)]
            assert not bracket(ends[0], ends[1], h)


#: A row whose length swings from 0.5 to 2.5 with w, among so many that ln |det| is watched.
SWINGING = AMONG_MANY.replace("s*(x*cos(w) + y*sin(w))", "s*(1.5 + cos(w))*y")


@pytest.mark.parametrize("turns", [60.0, 76.0, 92.0, 128.0])
def test_where_a_step_has_too_many_parts_the_rest_of_it_is_suspect(turns: float) -> None:
    """Beside NumPy's least squares, in halves of halves: 40 parts."""
    places = 0.5 - 0.5 * np.cos(np.arange(8) * np.pi / 7)
    parts_left = [(0.0, 1.0)]
    for _ in range(40):
        low, length = parts_left.pop()
        values = 2 * np.log(1.5 + np.cos(turns * (low + length * places)))
        if np.abs(values - Polynomial.fit(places, values, 3)(places)).max() > 0.1:
            assert length > 1 / 64
            parts_left += [(low + length / 2, length / 2), (low, length / 2)]
    watched = Watched(SWINGING, "in a loop")
    ends = np.zeros((2, 61))
    ends[:, 3], ends[:, 32] = 1.0, turns
    ends[1, 2] = turns
    assert watched.steps_over(*ends, 1.0, 1.0)
    since, _ = watched.core.step
    assert np.array(watched.core.suspect) - since == pytest.approx([parts_left[-1][0], 1.0])


def test_states_within_a_step_lie_on_the_cubic_through_its_ends() -> None:
    """Where it makes the angle zero is where B loses rank, with few rows and with many."""
    rng = np.random.default_rng(5)
    few, many = Watched(TWO_ROWS, "unrolled"), Watched(AMONG_MANY, "in a loop")
    few.measured(np.array([0, 0, np.pi / 2, 1]), np.zeros(4))
    x, shown = np.linspace(0, 1, 2001), set()
    for _ in range(60):
        h = 10.0 ** rng.uniform(-2, 1.5)
        (a, b), rates = rng.uniform(-1.2, 1.2, 2), rng.uniform(-4, 4, 2) / h
        w = cubic(a, rates[0], b, rates[1], h, x)
        if np.abs(w).max() > 1.4 or min(abs(a), abs(b)) < 0.1:
            continue
        roots = x[1:][np.diff(np.sign(w)) != 0]
        least = np.abs(w).min()
        if not len(roots) and least < 0.1:
            continue
        shown.add(len(roots))
        speed = np.abs(np.diff(w)).max() * len(x) / h
        assert few.steps_over(angle(a, rates[0]), angle(b, rates[1]), h, speed) == bool(len(roots))
        ends = [np.zeros(61) for _ in range(2)]
        for end, place, rate in zip(ends, (a, b), rates, strict=True):
            end[[2, 3, 32]] = place, 1.0, rate
        found = many.steps_over(*ends, h, 1.0)
        assert found == bool(len(roots))
        if found:
            since, _ = many.core.step
            low, high = ((t - since) / h for t in many.core.suspect)
            assert low - 1e-6 <= roots[0] <= roots[-1] <= high + 1e-6
            assert roots[0] - low < 4 / 64
            assert high - roots[-1] < 4 / 64
    assert shown >= {0, 1, 2}


#: Two rows that depend on v: parallel where y' is zero; with few others, or many.
TURNING = """
parameters: {{N: {count}}}
coordinates: [y, x, u[1..N]]
T: (x'^2 + y'^2 + sum(u[i]'^2, i = 1..N))/2
constraints:
  speed: x'^2 + y'^2 = 1
  along: x' = 0.5
  other[i = 1..N]: u[i] = 0
initial: {{x: 0, y: 0, x': {{guess: 1}}, y': {{guess: 1}}, u[1..N]: 0, u[1..N]': 0}}
"""


@pytest.mark.parametrize("count", [1, 26])
def test_velocities_within_a_step_are_the_slope_of_the_cubic(count: int) -> None:
    rng = np.random.default_rng(6)
    watched = Watched(TURNING.format(count=count), "unrolled")
    n, x, shown = count + 2, np.linspace(0, 1, 2001), set()
    assert watched.measured(np.zeros(n), np.array([0.75**0.5, 0.5, *np.zeros(count)]))[1] > 0.5
    sizes = watched.evaluator.sizes(0.0, np.zeros(n), np.zeros(n))
    change = 2 * sizes[0] / watched.core.lengths[0]
    for _ in range(60):
        h = 10.0 ** rng.uniform(-2, 1.5)
        a, b, *rates = rng.uniform(-2, 2, 4) * np.array([h, h, 1, 1])
        y = CubicHermiteSpline([0, h], [a, b], rates)(h * x, 1)
        roots, least = x[1:][np.diff(np.sign(y)) != 0], np.abs(y).min()
        if min(map(abs, rates)) < 0.1 or (not len(roots) and least < 0.15):
            continue
        shown.add(len(roots))
        ends = np.zeros((2, 2 * n + 1))
        ends[:, 0], ends[:, n], ends[:, n + 1] = (a, b), rates, 0.5
        ends[1, 1] = 0.5 * h
        speed = change * np.abs(np.diff(y)).max() * len(x) / h
        over = watched.steps_over(*ends, h, speed)
        assert over == bool(len(roots))
        if over and count > 1:
            since, _ = watched.core.step
            low, high = ((t - since) / h for t in watched.core.suspect)
            assert low - 1e-6 <= roots[0] <= roots[-1] <= high + 1e-6
    assert shown >= {0, 1, 2}


@pytest.mark.parametrize("w", [0.0, 1e-100, 1e-160])
def test_a_matrix_that_cannot_be_factored_is_singular(w: float) -> None:
    """And one that can be, thereafter, is not."""
    watched = Watched(AMONG_MANY, "in a loop")
    q = np.zeros(30)
    q[3] = 1.0
    for _ in range(2):
        q[2] = w
        assert watched.approaches(q)
        q[2] = 0.5
        assert watched.measured(q, 0 * q)[1] == pytest.approx((1 - np.cos(0.5)) ** 0.5, rel=0.05)
        assert not watched.approaches(q)


@pytest.mark.parametrize("turn", ["w", "w + t"])
def test_among_many_rows_what_is_near_shows_where_steps_become_short(turn: str) -> None:
    """Relative to the largest value found there; until then, ln |det| is watched alone."""
    text = AMONG_MANY.replace("w: 1,", "w: 0.3,").replace("(w)", f"({turn})")
    watched = Watched(text, "in a loop")
    last, t = 0.3, 0.0
    seen = watched.core.report.examined
    for h, w, computed, near in [
        (1.0, 0.4, 0, 0), (3.0, 0.5, 0, 0), (1.6, 0.35, 0, 0), (1.4, 1.57, 1, 0),
        (1.0, 0.2, 0, 0), (0.5, 0.3, 1, 1), (0.2, 0.28, 1, 1), (1.0, 0.25, 1, 1),
        (1.0, 0.27, 1, 0), (1.0, 0.26, 0, 0),
    ]:  # fmt: skip
        walk = np.zeros((6, 61))
        walk[:, 3], walk[:, 2], walk[:, 32] = 1, np.linspace(last, w, 6), (w - last) / h
        if turn != "w":
            walk[:, 2] -= t + h * np.linspace(0, 1, 6)
            walk[:, 32] -= 1
        over, found = watched.path(t + h * np.linspace(0, 1, 6), walk)
        assert not over
        assert found[2] == 0  # the path of B is no bound there
        # the determinant is nearly a parabola at the stages: no state is examined but the end
        assert watched.core.report.examined - seen == computed, (h, w)
        assert found[3] == near, (h, w)
        last, t, seen = w, t + h, watched.core.report.examined


@pytest.mark.parametrize("h", [0.01, 1.0, 30.0])
def test_a_small_minimum_counts_below_a_twentieth_of_the_largest(h: float) -> None:
    """A parabola through its least angle at some place of the step."""
    watched = Watched(TWO_ROWS, "unrolled")
    assert not watched.approaches(np.array([0, 0, 1.0, 1]))  # the largest value: of the start
    largest = np.sin(1.0)
    for place in np.linspace(0.05, 0.95, 19):
        for least, bend, expected in ((0.0495, 1.0, True), (0.09, 0.3, False)):
            w = np.arcsin(least * largest)
            ends = [
                angle(w + bend * (x - place) ** 2, 2 * bend * (x - place) / h) for x in (0.0, 1.0)
            ]
            assert watched.steps_over(*ends, h, 2 * bend / h) == expected


@pytest.mark.parametrize("solution", SOLUTIONS[:2])
def test_what_approaches_is_near_and_nearer_than_before(solution: str) -> None:
    """Near: below 0.3 of the largest sine so far, which is 0.252, and later 0.3."""
    watched = Watched(TWO_ROWS, solution)
    steps = [
        (1.0, False), (0.26, False), (0.25, True), (0.2, True), (0.19, True), (0.195, False),
        (0.19, True), (-0.1, True), (-0.2, False), (0.5, False), (0.2, True), (1.0, False),
        (np.pi / 2, False), (0.31, False), (0.30, True), (0.29, True), (0.295, False),
    ]  # fmt: skip
    found = [watched.approaches(np.array([0, 0, w, 1])) for w, _ in steps]
    assert found == [expected for _, expected in steps]


def test_what_is_near_is_so_beside_the_largest_value_of_all_steps() -> None:
    """The sine of the angle grows from 0.295 to 1 and falls again."""
    watched = Watched(TWO_ROWS.replace("w: 1,", "w: 0.3,"), "unrolled")
    near = []
    for k, (since, until) in enumerate([(0.3, 1.57), (1.57, 0.31), (0.31, 0.295), (0.295, 0.1)]):
        walk = np.zeros((6, 9))
        walk[:, 2], walk[:, 3], walk[:, 6] = np.linspace(since, until, 6), 1, until - since
        over, found = watched.path(k + np.linspace(0, 1, 6), walk)
        assert not over
        near.append(found[3])
    assert near == [0, 0, 1, 1]


def weakest(w: float) -> float:
    """Return the least singular value of `TWO_ROWS`: of two unit vectors with an angle of w."""
    return (1.0 - abs(float(np.cos(w)))) ** 0.5


def minimum_ahead(states: list[tuple[float, float]]) -> float:
    """Return the least value of the parabola through the last squares of `weakest`, if any."""
    if len(states) < 3:
        return -np.inf
    t = np.array([s for s, _ in states[-3:]])
    parabola = Polynomial.fit(t, [weakest(w) ** 2 for _, w in states[-3:]], 2).convert(
        domain=[t[0], t[-1]]
    )
    bend = parabola.deriv(2)(0.0)
    return float(parabola(parabola.deriv().roots()[0])) if bend > 0.0 else -np.inf


#: As long rows as those of `TWO_ROWS`, one of which is another's double.
REDUNDANT = TWO_ROWS.replace("  two:", "  again: 2*x = 0\n  two:")


@pytest.mark.parametrize(
    ("text", "solution"), [*((TWO_ROWS, s) for s in SOLUTIONS), (REDUNDANT, "densely")]
)
def test_steps_towards_a_singular_configuration_are_limited(text: str, solution: str) -> None:
    """Below a fifth of the largest value, each reduces it by a fiftieth of the largest at most;
    below a twenty-fifth, the path ahead is to be examined; later, if the values have a minimum."""
    rng = np.random.default_rng(len(text))
    asked = 0
    for _ in range(40):
        watched = Watched(text, solution)
        largest, t, last, before = weakest(1.0), 0.0, 1.0, []
        examined, approaching, pivot = np.inf, False, np.sin(1.0)
        while last > 1e-3:
            # now and then away from it
            away = rng.uniform(size=2)
            w = last * (rng.uniform(1.0, 1.2) if away[0] < 0.05 else rng.uniform(0.6, 0.99))
            h = 10 ** rng.uniform(-3, 1)
            status, limit, near = watched.follow(t + h, w)
            value, fall = weakest(w), weakest(last) - weakest(w)
            assert near == (value < 0.2 * largest)
            pivot = max(pivot, np.sin(w))
            if not np.sin(w) < min(np.sin(last), 0.3 * pivot):
                assert limit == np.inf
                approaching = False
            else:
                if not approaching:
                    before, examined = [(t, last)], 0.04 * largest
                before = [*before[-3:], (t + h, w)]
                approaching = True
                found = watched.core.approach()
                np.testing.assert_array_equal([s for s, _ in found], [s for s, _ in before])
                np.testing.assert_array_equal([y[2] for _, y in found], [s for _, s in before])
                expected = 0.02 * largest * h / fall if near else np.inf
                assert limit == pytest.approx(expected, rel=1e-3)
                below = examined * (0.5 if minimum_ahead(before) > 0.71**2 * value**2 else 1.0)
                assert status == (Status.NEAR if value < below else Status.RUNNING)
                if value < below:
                    examined = 0.85 * value
                    asked += 1
            t, last = t + h, w
    assert asked > 40


@pytest.mark.parametrize(("part", "rtol", "stuck"), [
    (1e-6, 1e-9, True), (0.02, 1e-9, False), (1e-6, 1e-3, False),
])  # fmt: skip
def test_steps_without_progress_are_limited_by_rounding_errors(
    part: float, rtol: float, stuck: bool
) -> None:
    """At a least value of 5e-6, those of a are 1e-5; each step covers a part of what is left."""
    text = TWO_ROWS.replace("initial:", f"simulation: {{rtol: {rtol}}}\ninitial:")
    watched = Watched(text, "unrolled")
    found = []
    for k in range(60):
        # not below 1e-7, where the products of rows are rounding errors
        status, _, _ = watched.follow(0.1 + 1e-3 * k, 1e-5 * (1 - part) ** k)
        found.append(status)
    assert Status.RUNNING in found
    assert (Status.FLOOR in found) == stuck
    if stuck:
        assert found.index(Status.FLOOR) == 20


def test_what_is_near_is_relative_to_values_after_the_start() -> None:
    """A run that begins next to a singular configuration, and leaves it."""
    watched = Watched(TWO_ROWS.replace("w: 1,", "w: 0.01,"), "unrolled")
    for k, w in enumerate((0.02, 0.05, 0.1, 0.3, 0.9, 1.5, 1.0, 0.12)):
        _, limit, near = watched.follow(0.1 + k, w)
        assert near == (w == 0.12)
        assert (limit < np.inf) == near


@pytest.mark.parametrize("kind", ["", "explicit in t", "redundant"])
@pytest.mark.parametrize("method", METHODS)
def test_no_step_passes_a_singular_configuration_unseen(method: str, kind: str) -> None:
    """The angle grows evenly through π, at any place of a step that may be long: with the
    coordinate, or with t."""
    rng = np.random.default_rng(METHODS.index(method))
    for _ in range(4):
        start, largest = float(rng.uniform(0.3, 2.8)), float(rng.uniform(0.05, 3.0))
        text = TWO_ROWS.replace("w: 1,", f"w: {start!r},")
        if kind == "explicit in t":
            text = text.replace("(w)", "(w + t)").replace("w': 1,", "w': 0,")
        elif kind == "redundant":
            text = text.replace("  two:", "  again: 2*x = 0\n  two:")
        model = lagcli.load_text(text)
        found = lagcli.simulate(model, t_end=4.0, samples=2, method=method, max_step=largest)
        assert found.status == "failed", (start, largest)
        match = re.search(r"singular configuration at t = (\S+) s", found.message)
        assert match is not None, found.message
        assert float(match[1]) == pytest.approx(np.pi - start, abs=1e-6)


@pytest.mark.parametrize("order", ["x, w", "w, x"])
def test_a_row_of_one_entry_that_changes_is_not_passed(order: str) -> None:
    model = lagcli.load_text(
        f"coordinates: [{order}]\nT: (x'^2 + w'^2)/2\nconstraints: {{one: x*cos(w) = 0}}\n"
        "initial: {x: 0, x': 0, w: 0.2, w': 1}\n"
    )
    found = lagcli.simulate(model, t_end=4.0, samples=2)
    assert "singular configuration at t = 1.3707" in found.message


def test_long_steps_of_a_method_with_few_stages_are_examined() -> None:
    """Radau's three stages may all lie far from the configuration, but not all equally far."""
    rng = np.random.default_rng(6)
    for _ in range(10):
        start, largest = float(rng.uniform(0.2, 1.3)), float(rng.uniform(1.5, 2.5))
        model = lagcli.load_text(TWO_ROWS.replace("w: 1,", f"w: {start!r},"))
        found = lagcli.simulate(model, t_end=4.0, samples=2, method="Radau", max_step=largest)
        assert "singular configuration" in found.message, (start, largest)


def test_redundant_rows_are_examined_in_each_step() -> None:
    """Their bordered matrix tells nothing; the rank still falls from 2 to 1."""
    text = TWO_ROWS.replace("  two:", "  again: 2*x = 0\n  two:")
    found = lagcli.simulate(lagcli.load_text(text), t_end=4.0, samples=2)
    assert "singular configuration at t = 2.14159" in found.message
