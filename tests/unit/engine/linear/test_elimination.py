"""Static orders of elimination: LDLᵀ in them, by NumPy, is the matrix."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from core_parts import solve_ldl
from kkt_systems import eliminated, hand_written, whole
from random_cases import seeds

import lagcli
from lagcli.engine.core.library import KERNEL, PORTABLE
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.layout import UnrolledLayout
from lagcli.engine.linear import elimination
from lagcli.engine.linear.elimination import (
    Elimination,
    NoElimination,
    find_order,
    order_at,
    unroll,
)
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import Op
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare

#: Of the core, without and with the instructions of this processor.
KERNELS = (PORTABLE, KERNEL)
FOUND = Path(__file__).parents[3] / "found"


def pattern(matrix: np.ndarray) -> tuple[tuple[int, int], ...]:
    return tuple((int(i), int(j)) for i, j in np.argwhere(matrix))


def found(mass: np.ndarray, jacobian: np.ndarray) -> Elimination:
    """Return the order for one state."""
    m, b = pattern(mass), pattern(jacobian)
    values = [mass[i, j] for i, j in m], [jacobian[i, j] for i, j in b]
    columns = [np.array(x)[:, None] for x in values]
    return find_order(len(mass), len(jacobian), m, b, *columns)


def random_parts(seed: int, nq: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Return a sparse M > 0 but for a coordinate without inertia, and a sparse B."""
    rng = np.random.default_rng(seed)
    nc = nq // 2
    root = rng.normal(size=(nq, nq)) * (rng.random((nq, nq)) < 0.3) + np.eye(nq)
    mass = root.T @ root
    mass[0, :] = mass[:, 0] = 0.0
    jacobian = rng.normal(size=(nc, nq)) * (rng.random((nc, nq)) < 0.5)
    jacobian[:, :nc] += 2 * np.eye(nc)
    return mass, jacobian


def factors(plan: Elimination, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return L and D in the order, by dense elimination."""
    rest = matrix[np.ix_(plan.order, plan.order)].copy()
    n = len(rest)
    lower, middle = np.eye(n), np.zeros((n, n))
    k = 0
    while k < n:
        width = 2 if plan.paired[k] else 1
        now, after = slice(k, k + width), slice(k + width, n)
        middle[now, now] = rest[now, now]
        lower[after, now] = rest[after, now] @ np.linalg.inv(rest[now, now])
        rest[after, after] -= lower[after, now] @ rest[now, after]
        k += width
    return lower, middle


@pytest.mark.parametrize("seed", range(20))
def test_factors_are_zero_outside_the_columns(seed: int) -> None:
    matrix = whole(*random_parts(seed))
    plan = found(*random_parts(seed))
    n = len(matrix)
    assert sorted(plan.order) == [*range(n)]
    lower, middle = factors(plan, matrix)
    permuted = matrix[np.ix_(plan.order, plan.order)]
    np.testing.assert_allclose(lower @ middle @ lower.T, permuted, atol=1e-9)
    inside = np.eye(n, dtype=bool)
    for k, column in enumerate(plan.columns):
        inside[list(column), k] = True
    assert np.abs(np.where(inside, 0.0, lower)).max() < 1e-12
    # pivots are large enough
    assert np.abs(lower).max() < 100
    assert 0 < plan.smallest <= 1


@pytest.mark.parametrize("seed", range(20))
def test_the_postorder_is_the_same_elimination(seed: int) -> None:
    """Each pivot stands directly before those that it is updated into, and L solves as before."""
    rng = np.random.default_rng(seed)
    mass, jacobian = random_parts(seed)
    plan = found(mass, jacobian)
    post = plan.in_postorder()
    assert post.updates == plan.updates
    assert post.smallest == plan.smallest
    assert sorted(post.order) == [*range(len(post.order))]
    for k, column in enumerate(post.columns):
        assert all(i > k for i in column)
        if column and not post.paired[k]:  # the next one, or one whose branch ends before it
            assert set(column[1:]) <= {*post.columns[column[0]], column[0] + 1}
    matrix = whole(mass, jacobian)
    right = rng.normal(size=len(matrix))
    places = pattern(matrix)
    values = [matrix[i, j] for i, j in places]
    exact = np.linalg.solve(matrix, right)
    for order in (plan, post):
        solutions = [solve_ldl(order, places, values, right, kernel) for kernel in KERNELS]
        assert len({x.tobytes() for x in solutions}) == 1
        error = 1e-13 * np.linalg.cond(matrix) * np.abs(exact).max()
        np.testing.assert_allclose(solutions[0], exact, rtol=0, atol=error)


@pytest.mark.parametrize("seed", seeds(7, 20))
def test_stored_zeros_do_not_change_a_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    parts = random_parts(seed, nq=int(rng.integers(8, 40)))
    plan = found(*parts).in_postorder()
    more = plan.amalgamated()
    assert more.order == plan.order
    assert more.paired == plan.paired
    assert all({*a} <= {*b} for a, b in zip(plan.columns, more.columns, strict=True))
    assert more.updates > plan.updates
    matrix = whole(*parts)
    places = pattern(matrix)
    values = [matrix[i, j] for i, j in places]
    right = rng.normal(size=len(matrix))
    solutions = [solve_ldl(x, places, values, right, k) for x in (plan, more) for k in KERNELS]
    assert len({x.tobytes() for x in solutions}) == 1


@pytest.mark.parametrize("seed", range(20))
def test_a_full_remainder_is_eliminated_in_the_same_order(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As an array and row by row, with pairs where coordinates have no inertia."""
    rng = np.random.default_rng(seed)
    nq, nc = int(rng.integers(16, 30)), int(rng.integers(0, 8))
    inertia = np.where(np.arange(nq) < rng.integers(0, nc + 1), 0.0, 1.0)
    terms = rng.normal(size=(nq, nq))
    mass = (terms @ terms.T + nq * np.eye(nq)) * np.outer(inertia, inertia) / nq
    jacobian = rng.normal(size=(nc, nq))
    full = found(mass, jacobian)
    monkeypatch.setattr(elimination, "_FULL", 10**9)
    by_rows = found(mass, jacobian)
    assert full == by_rows
    assert full.smallest == pytest.approx(by_rows.smallest, rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_targets_are_the_places_of_the_lower_half(seed: int) -> None:
    plan = found(*random_parts(seed))
    matrix = whole(*random_parts(seed))
    n, place = len(plan.order), np.argsort(plan.order)
    entries = [(i, k) for k, column in enumerate(plan.columns) for i in column]
    for (row, column), target in zip(pattern(matrix), plan.targets(pattern(matrix)), strict=True):
        i, k = int(place[row]), int(place[column])
        if i == k:
            assert target == i
        elif i < k:
            assert target == -1
        elif plan.paired[k] and i == k + 1:
            assert target == n + k
        else:
            assert entries[target - 2 * n] == (i, k)


def test_updates_are_those_of_symmetric_columns() -> None:
    plan = Elimination((0, 1, 2), (False,) * 3, ((1, 2), (2,), ()), 1.0)
    assert plan.updates == 3 + 1
    assert plan == Elimination((0, 1, 2), (False,) * 3, ((1, 2), (2,), ()), 0.5)
    assert plan != Elimination((0, 2, 1), (False,) * 3, ((1, 2), (2,), ()), 1.0)


def test_pivots_are_large_at_every_state() -> None:
    """The first diagonal entry is large at one state and small at the other."""
    mass = np.array([[1.0, 1e-9], [0.5, 0.5], [0.5, 0.5], [1.0, 1.0]])
    plan = find_order(2, 0, ((0, 0), (0, 1), (1, 0), (1, 1)), (), mass, np.empty((0, 2)))
    assert plan.order == (1, 0)
    assert plan.paired == (False, False)


def test_states_that_are_not_finite_say_nothing() -> None:
    system, _ = hand_written(np.diag([2.0, 3.0]), np.array([[1.0, 1.0]]), np.zeros(3))
    given = (2.0, 3.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0)
    undefined = (math.nan, *given[1:])
    assert order_at(system, [undefined, given]) == order_at(system, [given])
    with pytest.raises(NoElimination):
        order_at(system, [undefined])


@pytest.mark.parametrize("seed", range(3))
def test_the_order_of_some_rows_is_that_without_the_others(seed: int) -> None:
    mass, jacobian = random_parts(seed)
    mass[0, 0] = 1.0
    system, few = (
        hand_written(mass, b, np.zeros(len(mass) + len(b))) for b in (jacobian, jacobian[[0, 2]])
    )
    entries, rest = mass[mass != 0], [0.0] * len(mass)
    states = [
        (*entries, *rest, *b[b != 0], *[0.0] * len(b), 0.0) for b in (jacobian, jacobian[[0, 2]])
    ]
    assert order_at(system.system, [states[0]], [0, 2]) == order_at(few.system, [states[1]])


@pytest.mark.parametrize("seed", range(30))
def test_the_order_does_not_depend_on_units(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """kg, g or t; m or mm beside rad; s or h; a constraint times a number."""
    mass, jacobian = random_parts(seed)
    mass[0, 0] = 1.0
    nq, nc = len(mass), len(jacobian)
    rng = np.random.default_rng(seed)
    plans, chosen = [], []
    for unit in (1.0, 1e-3, 1e3, 1e7):
        lengths = np.where(rng.random(nq) < 0.5, 10.0 ** rng.integers(-3, 4), 1.0)
        rows = 10.0 ** rng.integers(-3, 4, size=(nc, 1))
        m, b = unit * mass * np.outer(lengths, lengths), rows * jacobian * lengths
        system, _ = hand_written(m, b, np.zeros(nq + nc))
        outputs = (*m[m != 0], *[0.0] * nq, *b[b != 0], *[0.0] * nc, 0.0)
        chosen.append(order_at(system, [outputs]).updates)
        with monkeypatch.context() as context:
            context.setattr(elimination, "_FEW", 0)
            plans.append(order_at(system, [outputs]))
    assert len(set(plans)) == 1
    assert max(chosen) <= plans[0].updates / 0.8
    np.testing.assert_allclose([plan.smallest for plan in plans], plans[0].smallest, rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "sizes", "masses", "most"),
    [("net_rods", "5", ("10 g", "1 kg", "1 t"), 1200), ("ring100", "40", ("10 g", "1 kg"), 360)],
)
def test_light_bodies_fill_no_more_than_heavy_ones(
    name: str, sizes: str, masses: tuple[str, ...], most: int
) -> None:
    updates = set()
    for m in masses:
        model = lagcli.load(FOUND / f"{name}.yaml", {"N": sizes, "m": m})
        found = prepare(model, SettingsOverrides()).start.elimination
        assert found is not None
        updates.add(found.updates)
    assert len(updates) == 1
    assert updates.pop() <= most  # pairs of light bodies with rods fill 20 777 of a net of 5


def test_a_coordinate_with_inertia_of_rounding_errors_spoils_no_constraint() -> None:
    """M of a quaternion at rest: 1e-33 in place of 0, which would dominate two of the rows."""
    mass = np.diag([1e-33, 1.0, 2.0, 1.0])
    jacobian = np.array([[2.0, 0.1, 0.0, 1.0], [1.0, 0.0, 0.3, 0.0]])
    rhs = np.arange(1.0, 7.0)
    case = system, p = hand_written(mass, jacobian, rhs)
    plan = order_at(system, [p])
    for x in eliminated(case, plan, rhs)[0]:
        np.testing.assert_allclose(x, np.linalg.solve(whole(mass, jacobian), rhs), rtol=1e-12)


def test_an_entry_that_vanishes_at_the_state_is_not_taken_for_zero() -> None:
    """B = (0, 1) at the state, but its first entry is in the pattern."""
    mass, jacobian = np.diag([0.0, 1.0]), np.array([[1.0, 1.0]])
    system, _ = hand_written(mass, jacobian, np.zeros(3))
    # with the entry, the coordinate without inertia is held; B is changed by what is in its row
    plan = order_at(system, [(1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0)])
    assert sorted(plan.order) == [0, 1, 2]


@pytest.mark.parametrize("n", [20, 200])
def test_a_chain_is_eliminated_from_many_places(n: int) -> None:
    """None of the pivots waits for more than a few others."""
    mass = tuple((i, i) for i in range(2 * n))  # x, y of each body
    jacobian = tuple(
        (i, 2 * j + along)
        for i in range(n)
        for j in range(max(i - 1, 0), i + 1)
        for along in (0, 1)
    )
    values = np.array([[1.0 if j // 2 == i else -1.0] for i, j in jacobian])
    plan = find_order(2 * n, n, mass, jacobian, np.ones((2 * n, 1)), values)
    depth = [1] * (3 * n)
    for k, column in enumerate(plan.columns):
        for i in column:
            depth[i] = max(depth[i], depth[k] + 1)
    assert max(depth) <= 3 + 1.5 * math.log2(n)


def test_a_singular_matrix_has_no_order() -> None:
    mass, jacobian = np.diag([2.0, 0.0]), np.array([[3.0, 0.0]])
    system = hand_written(mass, jacobian, np.zeros(3)).system
    with pytest.raises(NoElimination):
        order_at(system, [(2.0, 0.0, 0.0, 3.0, 0.0, 0.0)])


def test_a_full_matrix_has_an_order() -> None:
    """However large: a full M is no singular one."""
    n = 100
    full = tuple((i, j) for i in range(n) for j in range(n))
    values = np.array([[n if i == j else 1.0] for i, j in full])
    plan = find_order(n, 0, full, (), values, np.empty((0, 1)))
    assert plan.updates == n * (n * n - 1) // 6


def test_a_chain_fills_in_nothing() -> None:
    n = 200
    mass = tuple((i, i) for i in range(n))
    jacobian = tuple(
        place for i in range(n) for place in ((i, max(i - 1, 0)), (i, i)) if i or place == (0, 0)
    )
    ones = np.ones((len(mass), 1))
    values = np.array([[1.0 if j == i else -1.0] for i, j in jacobian])
    plan = find_order(n, n, mass, jacobian, ones, values)
    assert sum(map(len, plan.columns)) <= 2 * 2 * n


MASS = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, 0.5], [0.0, 0.5, 2.0]])
JACOBIAN = np.array([[1.0, -2.0, 0.0], [0.0, 1.0, 1.0]])
RHS = np.array([1.0, 2.0, -1.0, 0.5, 3.0])
V = np.array([0.3, -0.7, 1.1])


def outputs() -> tuple[UnrolledLayout, list[float], np.ndarray]:
    """Return the layout, the outputs, and the other right side that was given."""
    system, p = hand_written(MASS, JACOBIAN, RHS)
    tape = unroll(system, order_at(system, [p]))
    other = np.array([0.2, -1.0, 0.4, 2.0, -3.0])
    moved = np.array([5.0, 7.0])
    found = ScalarTape(tape)((0.0, 0.0, 0.0, 0.0, *V, *p, *other, *moved))
    return UnrolledLayout(system.counts), found, other


def solved(rhs: np.ndarray) -> np.ndarray:
    """Return a and λ by NumPy."""
    x = np.linalg.solve(whole(MASS, JACOBIAN), rhs)
    return np.concatenate([x[:3], -x[3:]])


def test_the_outputs_of_the_dynamics_come_first() -> None:
    layout, found, _ = outputs()
    np.testing.assert_array_equal(found[layout.mass_matrix], MASS[MASS != 0])
    np.testing.assert_array_equal(found[layout.forcing], RHS[:3])
    np.testing.assert_array_equal(found[layout.jacobian], JACOBIAN[JACOBIAN != 0])
    np.testing.assert_array_equal(found[layout.rhs], RHS[3:])


def test_accelerations_multipliers_and_the_power_of_all_forces() -> None:
    layout, found, _ = outputs()
    expected = solved(RHS)
    np.testing.assert_allclose(found[layout.solution], expected, rtol=1e-12)
    # the applied forces have none in this System
    np.testing.assert_allclose(found[layout.total_power], [expected[3:] @ JACOBIAN @ V], rtol=1e-12)


def test_what_is_asked_for_apart() -> None:
    _, found, other = outputs()
    np.testing.assert_allclose(found[-8:-3], solved(other), rtol=1e-12)
    expected = solved(np.array([0.0, 0.0, 0.0, 5.0, 7.0]))
    np.testing.assert_allclose(found[-3:], expected[:3], rtol=1e-12)


def test_structural_zeros_cost_nothing() -> None:
    """Masses without constraints."""
    system, p = hand_written(np.diag([2.0, 4.0, 8.0]), np.empty((0, 3)), np.ones(3))
    tape = unroll(system, order_at(system, [p]))
    kinds = Counter(Op(op) for op, *_ in tape.code)
    # a division for each mass, and a product for each unknown of both right sides
    assert (kinds[Op.DIV], kinds[Op.MUL]) == (3, 6)
    assert not kinds[Op.ADD] + kinds[Op.SUB]


def test_a_coordinate_without_inertia_is_eliminated_with_its_constraint() -> None:
    mass, jacobian = np.diag([2.0, 0.0]), np.array([[0.0, 3.0]])
    rhs = np.array([4.0, 5.0, 6.0])
    case = hand_written(mass, jacobian, rhs)
    plan = order_at(case.system, [(2.0, 4.0, 5.0, 3.0, 6.0, 0.0)])
    assert any(plan.paired)
    for x in eliminated(case, plan, rhs)[0]:
        np.testing.assert_allclose(x, [2.0, 2.0, 5.0 / 3.0])


def test_what_touches_nothing_ends_no_long_elimination() -> None:
    """Free masses beside three with two constraints: a round of pivots without neighbours."""
    mass, jacobian = np.eye(250), np.zeros((2, 250))
    jacobian[:, :3] = [[3.0, 4.0, 5.0], [1.0, -2.0, 1.0]]
    rhs = np.arange(1.0, 253.0)
    case = system, p = hand_written(mass, jacobian, rhs)
    plan = order_at(system, [p])
    for x in eliminated(case, plan, rhs)[0]:
        np.testing.assert_allclose(x, np.linalg.solve(whole(mass, jacobian), rhs), rtol=1e-12)


def test_a_pair_that_touches_all_others_ends_no_round() -> None:
    """A pivot of order two whose neighbours are all that is left."""
    mass, jacobian = np.diag([0.01, 0.01]), np.array([[1.0, 2.0]])
    rhs = np.array([4.0, 5.0, 6.0])
    case = system, p = hand_written(mass, jacobian, rhs)
    plan = order_at(system, [p])
    for x in eliminated(case, plan, rhs)[0]:
        np.testing.assert_allclose(x, np.linalg.solve(whole(mass, jacobian), rhs), rtol=1e-12)


def test_with_as_many_updates_masses_come_before_constraints() -> None:
    """The crank alone before λ is a pivot that vanishes with cos² φ: residuals were 8e-10."""
    simulation = prepare(lagcli.load("slider_crank"), SettingsOverrides(t_end=30.0))
    start, system = simulation.start.state, simulation.system
    plan = order_at(system, [Evaluator(system, start.p).entries(start.t, start.q, start.v)])
    assert plan.order == (0, 1, 2)
    assert plan.updates == 4
    assert lagcli.simulate(simulation.model, t_end=30.0).residual_equation.max() < 1e-13
