"""Accelerations and multipliers of one state, and the smallest change that meets constraints."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lagcli.engine.linear import dense

SEEDS = st.integers(0, 10**9)
SIZES = st.tuples(st.integers(1, 9), st.integers(0, 9)).map(lambda s: (s[0], min(s)))


def spd(random: np.random.Generator, n: int) -> np.ndarray:
    """Return a mass matrix of condition below 1e4 or so."""
    root = random.normal(size=(n, n))
    return root @ root.T + 0.1 * np.eye(n)


def full(random: np.random.Generator, rows: int, n: int) -> np.ndarray:
    """Return constraint rows that are well apart."""
    q, _ = np.linalg.qr(random.normal(size=(n, n)))
    return q[:rows] * random.uniform(0.5, 2, size=(rows, 1))


def kkt(
    mass: np.ndarray, forcing: np.ndarray, jacobian: np.ndarray, rhs: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Solve the textbook's block matrix by NumPy."""
    n = len(rhs)
    block = np.block([[mass, jacobian.T], [jacobian, np.zeros((n, n))]])
    x = np.linalg.solve(block, np.concatenate([forcing, rhs]))
    return x[: len(forcing)], -x[len(forcing) :]


@settings(max_examples=70, deadline=None)
@given(SEEDS, SIZES)
def test_regular_against_numpy(seed: int, size: tuple[int, int]) -> None:
    random, (nq, nc) = np.random.default_rng(seed), size
    mass, jacobian = spd(random, nq), full(random, nc, nq)
    forcing, rhs = random.normal(size=nq), random.normal(size=nc)
    a, multipliers = dense.solve_regular(mass, forcing, jacobian, rhs)
    expected_a, expected = kkt(mass, forcing, jacobian, rhs)
    # 1e-16 times a condition of at most 1e6 or so
    size_of = 1 + np.abs(np.concatenate([expected_a, expected])).max()
    np.testing.assert_allclose(a, expected_a, rtol=0, atol=1e-9 * size_of)
    np.testing.assert_allclose(multipliers, expected, rtol=0, atol=1e-9 * size_of)


@settings(max_examples=50, deadline=None)
@given(SEEDS, st.integers(2, 7), st.floats(-12, 12), st.floats(-12, 12))
def test_units_do_not_matter(seed: int, nq: int, of_mass: float, of_rows: float) -> None:
    random, nc = np.random.default_rng(seed), nq - 1
    mass, jacobian = spd(random, nq), full(random, nc, nq)
    forcing, rhs = random.normal(size=nq), random.normal(size=nc)
    a, multipliers = dense.solve_regular(mass, forcing, jacobian, rhs)
    m, b = 10.0**of_mass, 10.0**of_rows
    scaled_a, scaled = dense.solve_regular(m * mass, m * forcing, b * jacobian, b * rhs)
    # as above; the scales differ by up to 24 orders of magnitude
    tolerance = 1e-9 * (1 + np.abs(a).max() + np.abs(multipliers).max())
    np.testing.assert_allclose(scaled_a, a, rtol=0, atol=tolerance)
    np.testing.assert_allclose(scaled * b / m, multipliers, rtol=0, atol=tolerance)


def test_badly_scaled_rows_and_masses() -> None:
    mass = np.diag([1e-9, 1.0, 1e9])
    jacobian = np.array([[1e8, 1e8, 0.0], [0.0, 1e-8, -1e-8]])
    a, multipliers = dense.solve_regular(mass, np.ones(3), jacobian, np.zeros(2))
    # all three move as one: a = (−1, 1, 1)·x, total mass x = total force
    x = (-1 + 1 + 1) / (1e-9 + 1 + 1e9)
    np.testing.assert_allclose(a, [-x, x, x], rtol=1e-12)
    np.testing.assert_allclose(jacobian.T @ multipliers, mass @ a - 1, rtol=0, atol=1e-12)


def test_massless_coordinate_that_a_constraint_determines() -> None:
    mass = np.diag([2.0, 0.0])
    jacobian, rhs = np.array([[3.0, -1.0]]), np.array([5.0])
    a, multipliers = dense.solve_regular(mass, np.array([4.0, 1.0]), jacobian, rhs)
    # second row: 0 = 1 − λ; first: 2 a = 4 + 3 λ
    np.testing.assert_allclose(multipliers, [1.0], rtol=1e-14)
    np.testing.assert_allclose(a, [3.5, 5.5], rtol=1e-14)


@pytest.mark.parametrize(
    ("mass", "jacobian"),
    [
        (np.diag([1.0, 0.0]), np.zeros((0, 2))),
        (np.diag([1.0, 0.0]), np.array([[1.0, 0.0]])),
        (np.eye(2), np.array([[1.0, 1.0], [1.0, 1.0]])),
        (np.zeros((2, 2)), np.array([[1.0, 0.0]])),
    ],
)
def test_singular_system_is_rejected(mass: np.ndarray, jacobian: np.ndarray) -> None:
    with pytest.raises(dense.SingularSystem):
        dense.solve_regular(mass, np.ones(2), jacobian, np.zeros(len(jacobian)))


# redundant rows


@settings(max_examples=60, deadline=None)
@given(SEEDS, st.integers(2, 7), st.integers(1, 4), st.booleans())
def test_redundant_rows(seed: int, nq: int, extra: int, singular: bool) -> None:
    random = np.random.default_rng(seed)
    rank = int(random.integers(1, nq + 1))
    base, mass = full(random, rank, nq), spd(random, nq)
    if singular:  # M may lack what the constraints determine
        direction = base[:1].T / np.linalg.norm(base[0])
        project = np.eye(nq) - direction @ direction.T
        mass = project @ mass @ project
    mix = np.vstack([np.eye(rank), random.normal(size=(extra, rank))])
    # rows in different units
    units = 10.0 ** random.uniform(-3, 3, size=(rank + extra, 1))
    forcing, base_rhs = random.normal(size=nq), random.normal(size=rank)
    jacobian, rhs = units * (mix @ base), units[:, 0] * (mix @ base_rhs)
    d = dense.decompose(jacobian)
    assert d.rank == rank
    a, multipliers = dense.solve_redundant(mass, forcing, rhs, d)
    expected_a, base_multipliers = kkt(mass, forcing, base, base_rhs)
    reaction = base.T @ base_multipliers
    size = 1 + np.abs(expected_a).max() + np.abs(reaction).max()
    # 1e-16 times the conditions of M and of the mix
    np.testing.assert_allclose(a, expected_a, rtol=0, atol=1e-8 * size)
    np.testing.assert_allclose(jacobian.T @ multipliers, reaction, rtol=0, atol=1e-8 * size)
    least = np.linalg.lstsq(jacobian.T, reaction, rcond=1e-13)[0]
    np.testing.assert_allclose(multipliers, least, rtol=0, atol=1e-7 * np.abs(least).max())


def test_rank_does_not_depend_on_the_unit_of_a_row() -> None:
    jacobian = np.array([[1.0, 2.0, 0.0], [0.0, 1e-12, 1e-12], [3e9, 6e9, 0.0]])
    d = dense.decompose(jacobian)
    assert d.rank == 2
    # the two parallel rows are the dependent ones
    np.testing.assert_allclose(np.abs(d.dependent[:, 0]), [0.5**0.5, 0, 0.5**0.5], atol=1e-12)
    np.testing.assert_allclose(jacobian @ d.null, 0, atol=1e-5)


def test_row_of_zeros_has_no_rank() -> None:
    assert dense.decompose(np.zeros((2, 3))).rank == 0
    assert dense.decompose(np.array([[0.0, 0.0], [0.0, 1e-30]])).rank == 1


# the smallest change


@settings(max_examples=60, deadline=None)
@given(SEEDS, SIZES)
def test_least_change_is_least_in_the_metric_of_the_mass(seed: int, size: tuple[int, int]) -> None:
    random, (nq, nc) = np.random.default_rng(seed), size
    mass, jacobian, residual = spd(random, nq), full(random, nc, nq), random.normal(size=nc)
    delta = dense.least_change(jacobian, residual, mass, None)
    big = 1 + np.abs(delta).max()
    np.testing.assert_allclose(jacobian @ delta, -residual, rtol=0, atol=1e-10 * big)
    # orthogonal, in that metric, to every change that keeps the constraints
    null = np.linalg.svd(jacobian)[2][nc:]
    np.testing.assert_allclose(null @ mass @ delta, 0, atol=1e-9 * big * np.abs(mass).max())


def test_least_change_with_dependent_rows_or_without_a_mass() -> None:
    jacobian, residual = np.array([[1.0, 1.0], [2.0, 2.0]]), np.array([1.0, 2.0])
    even = dense.least_change(jacobian, residual, None, 1)
    np.testing.assert_allclose(even, [-0.5, -0.5], rtol=1e-14)
    # the heavy coordinate moves less: δ ∝ 1/m
    uneven = dense.least_change(jacobian, residual, np.diag([3.0, 1.0]), 1)
    np.testing.assert_allclose(uneven, [-0.25, -0.75], rtol=1e-14)


def test_least_change_where_the_mass_is_singular() -> None:
    # no inertia at all: all changes cost nothing, and a plain one is returned
    delta = dense.least_change(np.array([[1.0, 1.0]]), np.array([2.0]), np.zeros((2, 2)), 1)
    np.testing.assert_allclose(delta, [-1.0, -1.0], rtol=1e-14)
    assert not dense.least_change(np.zeros((1, 2)), np.array([1.0]), np.eye(2), 0).any()
    assert not dense.least_change(np.zeros((0, 2)), np.zeros(0), np.eye(2), None).any()
