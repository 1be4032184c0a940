"""Forces of redundant contacts in given modes: of least norm within the laws, and their slack."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from core_parts import share_contacts
from scipy.linalg import null_space
from scipy.optimize import linprog

from lagcli.analysis.local.active_set import least_norm_within
from lagcli.arrays import Array, Indices
from lagcli.engine.core.contact_problem import ContactLaw, ContactProblem
from lagcli.engine.switching.switching import RowMode

UNILATERAL, LIMITED, FREE = ContactLaw.UNILATERAL, ContactLaw.LIMITED, ContactLaw.FREE
HOLDS = RowMode.HOLDS


def held(jacobian: Array, force: Array, friction: Array) -> ContactProblem:
    """Return a problem of unit masses whose rows all hold by these forces.

    Rows with coefficients of friction (n, n) are limited.
    """
    matrix, nothing = jacobian @ jacobian.T, np.zeros(len(force))
    laws = np.where(friction.any(axis=1), int(LIMITED), int(UNILATERAL))
    return ContactProblem(matrix, -matrix @ force, laws, nothing, nothing, friction, friction)


def laws_of(problem: ContactProblem, given: Array) -> tuple[Array, Array, Indices]:
    """Return rows, constants and owners of the laws rows x + constants ≥ 0.

    Forces of bilateral rows, which limit others, keep their given sign.
    """
    rows, constants, owners = [], [], []
    unit, sign = np.eye(len(problem.offset)), np.where(given < 0, -1.0, 1.0)
    for k, law in enumerate(problem.laws):
        sides = [unit[k], -unit[k]] if law == LIMITED else [sign[k] * unit[k]]
        rows += [sign * problem.static_slopes[k] + side for side in sides]
        constants += [problem.static[k]] * len(sides)
        owners += [k] * len(sides)
    return np.array(rows), np.array(constants), np.array(owners)


def common_slack(problem: ContactProblem, force: Array, given: Array) -> tuple[float, Indices]:
    """Return the largest common slack of the laws that shares change, and the owners of these.

    It is not larger than the largest of the forces.
    """
    rows, constants, owners = laws_of(problem, given)
    free = null_space(problem.matrix, rcond=1e-9)
    along = rows @ free
    some = np.abs(along).max(axis=1) > 1e-9
    n = free.shape[1]
    found = linprog(
        np.append(np.zeros(n), -1.0),
        A_ub=np.hstack([-along[some], np.ones((int(some.sum()), 1))]),
        b_ub=(rows @ force + constants)[some],
        bounds=[(None, None)] * n + [(None, np.abs(force).max())],
    )
    return -float(found.fun), np.unique(owners[some])


def slacks_of_signs(problem: ContactProblem, force: Array, tolerance: float) -> list[float]:
    """Return the slacks with all signs of bilateral forces that these have but for a tolerance."""
    free = np.flatnonzero(problem.laws == FREE)
    signed, slacks = np.ones_like(force), []
    for signs in itertools.product((-1.0, 1.0), repeat=len(free)):
        signed[free] = signs
        if (force[free] * signs >= -tolerance).all():
            slacks.append(common_slack(problem, force, signed)[0])
    return slacks


def random_shares(rng: np.random.Generator) -> tuple[ContactProblem, Array]:
    """Return contacts and guides with friction, some of which depend on others, and forces."""
    contacts = int(rng.integers(2, 6))
    freedom = int(rng.integers(1, contacts + 2))
    jacobian = rng.standard_normal((2 * contacts, freedom))
    normal = rng.uniform(0.1, 2.0, contacts)
    mu = rng.uniform(0.2, 1.0, contacts)
    friction = np.zeros((2 * contacts, 2 * contacts))
    friction[contacts + np.arange(contacts), np.arange(contacts)] = mu
    tangent = mu * normal * rng.uniform(-1.0, 1.0, contacts)
    guides = np.concatenate([rng.random(contacts) < 0.4, np.zeros(contacts, dtype=bool)])
    force = np.concatenate([normal, tangent]) * np.where(guides, rng.choice([-1.0, 1.0]), 1.0)
    problem = held(jacobian, force, friction)
    return problem._replace(laws=np.where(guides, int(FREE), problem.laws)), force


@pytest.mark.parametrize("seed", range(40))
def test_random_shares(seed: int) -> None:
    """Beside SciPy's linear program, and the forces of least norm of an independent program."""
    problem, given = random_shares(np.random.default_rng(seed))
    redundant, force, slack, tight = share_contacts(problem, [HOLDS] * len(given), given)
    size = np.abs(given).max()
    np.testing.assert_allclose(problem.matrix @ force, problem.matrix @ given, atol=1e-9 * size)
    free = null_space(problem.matrix, rcond=1e-9)
    assert redundant == bool(free.shape[1])
    if not redundant:
        assert np.isinf(slack).all()
        return
    expected, owners = common_slack(problem, force, given)
    shared = np.isfinite(slack)
    np.testing.assert_array_equal(np.flatnonzero(shared), owners)
    np.testing.assert_allclose(slack[shared], expected, atol=1e-9 * size)
    assert tight.any() == (expected < (1 - 1e-9) * np.abs(force).max())
    assert not tight[~shared].any()
    assert (force[problem.laws == UNILATERAL] >= 0.0).all()
    rows, constants, _ = laws_of(problem, given)
    assert (rows @ force + constants >= -1e-9 * size).all()
    least = least_norm_within(given, free, rows @ free, -(rows @ given + constants))
    assert least is not None
    np.testing.assert_allclose(force, least, atol=1e-6 * size)


@pytest.mark.parametrize("seed", range(30))
def test_random_forces_beyond_what_some_shares_bear(seed: int) -> None:
    """Three times as much friction: the slack beside SciPy's, and if it is negative the least norm.

    Where no share with the given signs of bilateral forces obeys the laws, others do, or the best.
    """
    problem, given = random_shares(np.random.default_rng(seed))
    given = given * np.where(problem.laws == LIMITED, 3.0, 1.0)
    problem = problem._replace(offset=-problem.matrix @ given)
    redundant, force, slack, tight = share_contacts(problem, [HOLDS] * len(given), given)
    free = null_space(problem.matrix, rcond=1e-9)
    assert redundant == bool(free.shape[1])
    if not redundant:
        return
    size = np.abs(given).max()
    expected, owners = common_slack(problem, force, given)
    if expected < -1e-9 * size:
        expected = max(slacks_of_signs(problem, force, np.inf))
    if expected >= -1e-9 * size:
        rows, constants, _ = laws_of(problem, force)
        assert (rows @ force + constants >= -1e-9 * size).all()
        slacks = slacks_of_signs(problem, force, 1e-9 * size)
        expected = min(slacks, key=lambda x: abs(x - slack[owners[0]]))
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(slack)), owners)
    np.testing.assert_allclose(slack[owners], expected, atol=1e-9 * size)
    assert tight.any() == (expected < (1 - 1e-9) * np.abs(force).max())
    np.testing.assert_allclose(problem.matrix @ force, problem.matrix @ given, atol=1e-9 * size)
    if expected < -1e-9 * size:
        np.testing.assert_allclose(force @ free, 0.0, atol=1e-9 * size)


def test_two_feet_of_one_block() -> None:
    """Normal forces 1 and 3, friction 0.5 of each: half of 1.6 is too much for the first."""
    jacobian = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    friction = np.zeros((4, 4))
    friction[2, 0] = friction[3, 1] = 0.5
    problem = held(jacobian, np.array([1.0, 3.0, 0.8, 0.8]), friction)
    redundant, force, slack, tight = share_contacts(
        problem, [HOLDS] * 4, np.array([1, 3, 0.8, 0.8])
    )
    assert redundant
    np.testing.assert_allclose(force, [1, 3, 0.5, 1.1], rtol=1e-12)
    # 0.5 − x = s, 1.5 − (1.6 − x) = s
    np.testing.assert_allclose(slack, [np.inf, np.inf, 0.2, 0.2], rtol=1e-12)
    assert tight.tolist() == [False, False, True, True]


@pytest.mark.parametrize("order", [[0, 1, 2, 3, 4], [3, 4, 0, 1, 2], [0, 3, 1, 4, 2]])
def test_guides_without_friction_have_no_laws(order: list[int]) -> None:
    """Three in one place share a force of 30 beside two contacts with the sum 4: by 10, by 2."""
    jacobian = np.array([[1.0, 0.0]] * 3 + [[0.0, 1.0]] * 2)[order]
    given = np.array([20.0, 10.0, 0.0, 3.0, 1.0])[order]
    problem = held(jacobian, given, np.zeros((5, 5)))
    guides = jacobian[:, 0] == 1.0
    problem = problem._replace(laws=np.where(guides, int(FREE), problem.laws))
    redundant, force, slack, tight = share_contacts(problem, [HOLDS] * 5, given)
    assert redundant
    np.testing.assert_allclose(force, np.where(guides, 10.0, 2.0), rtol=1e-12)
    np.testing.assert_allclose(slack, np.where(guides, np.inf, 2.0), rtol=1e-12)
    assert tight.tolist() == (~guides).tolist()


def test_forces_beyond_what_all_shares_bear() -> None:
    """The slack is then negative: by so much each law is broken at best."""
    problem = held(np.array([[1.0], [1.0]]), np.array([-3.0, 1.0]), np.zeros((2, 2)))
    redundant, force, slack, tight = share_contacts(problem, [HOLDS] * 2, np.array([-3.0, 1.0]))
    assert redundant
    np.testing.assert_allclose(force, [-1, -1], rtol=1e-12)
    np.testing.assert_allclose(slack, [-1, -1], rtol=1e-12)
    assert tight.all()


def test_forces_that_are_unique_stay() -> None:
    problem = held(np.eye(2), np.array([2.0, -1.0]), np.zeros((2, 2)))
    redundant, force, slack, tight = share_contacts(problem, [HOLDS] * 2, np.array([2.0, -1.0]))
    assert not redundant
    assert force.tolist() == [2.0, -1.0]
    assert np.isinf(slack).all()
    assert not tight.any()
