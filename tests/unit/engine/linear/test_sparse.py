"""Orders of pivots: a factorization in them, and in their pattern, is that of the matrix."""

from __future__ import annotations

import numpy as np
import pytest

from lagcli.engine.linear.sparse import MatrixPattern, PivotOrder, matrix_pattern, pivot_order
from lagcli.engine.system import JacobianTapes, System
from lagcli.engine.tape.tape import Tape


def sparse(matrix: np.ndarray) -> tuple[MatrixPattern, np.ndarray]:
    """Return the pattern and the entries of a matrix, zeros left out."""
    rows, columns = np.nonzero(matrix)
    start = np.searchsorted(rows, np.arange(len(matrix) + 1))
    parts = np.arange(len(rows))
    pattern = MatrixPattern(*(np.asarray(x, dtype=np.int32) for x in (start, columns, parts)))
    return pattern, matrix[rows, columns]


def factorized(order: PivotOrder, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return L and U by rows, Doolittle's way, touching no place outside the pattern."""
    n = len(order.row)
    rows = [
        dict.fromkeys(order.columns[a:b].tolist(), 0.0)
        for a, b in zip(order.start, order.start[1:], strict=False)
    ]
    of = np.repeat(np.arange(n), np.diff(order.start))
    for place, x in zip(order.places, values, strict=True):
        rows[of[place]][int(order.columns[place])] = x
    for i, row in enumerate(rows):
        for k in sorted(c for c in row if c < i):
            row[k] /= rows[k][k]
            for c, x in rows[k].items():
                if c > k:
                    row[c] -= row[k] * x  # a KeyError is a place that the pattern lacks
    lower, upper = np.eye(n), np.zeros((n, n))
    for i, row in enumerate(rows):
        for c, x in row.items():
            (lower if c < i else upper)[i, c] = x
    return lower, upper


def random_matrix(seed: int) -> np.ndarray:
    """Return a sparse matrix without a structure, with rows and columns of any magnitude."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 30))
    matrix = rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.15)
    matrix[np.arange(n), rng.permutation(n)] += 3.0  # regular, but not by its diagonal
    return matrix * 10.0 ** rng.uniform(-5, 5, n) * 10.0 ** rng.uniform(-5, 5, n)[:, None]


@pytest.mark.parametrize("seed", range(25))
def test_factors_are_those_of_the_matrix(seed: int) -> None:
    matrix = random_matrix(seed)
    pattern, values = sparse(matrix)
    order = pivot_order(pattern, values)
    if order is None:
        assert np.linalg.matrix_rank(matrix) < len(matrix)
        return
    n = len(matrix)
    assert sorted(order.row) == sorted(order.column) == [*range(n)]
    np.testing.assert_array_equal(order.columns[order.diagonal], np.arange(n))
    permuted = matrix[np.ix_(order.row, order.column)]
    lower, upper = factorized(order, values)
    size = np.abs(lower) @ np.abs(upper)  # what is added; its rounding is the error
    assert (np.abs(lower @ upper - permuted) <= 1e-14 * n * size).all()
    # pivots are large enough: L does not grow beyond the threshold, but for scales
    assert (size <= 1e4 * np.abs(permuted).max()).all()


def test_an_arrow_fills_in_little() -> None:
    """Eliminated from its head, it would fill up; what is left at the end is a full matrix."""
    n = 40
    matrix = np.diag(np.full(n, 2.0))
    matrix[0, :] = matrix[:, 0] = 1.0
    order = pivot_order(*sparse(matrix))
    assert order is not None
    assert len(order.columns) < 1.2 * np.count_nonzero(matrix)


def test_small_entries_are_no_pivots() -> None:
    pattern, values = sparse(np.array([[1e-12, 1.0, 0.0], [1.0, 1.0, 1.0], [0.0, 1.0, 3.0]]))
    order = pivot_order(pattern, values)
    assert order is not None
    lower, upper = factorized(order, values)
    assert max(np.abs(lower).max(), np.abs(upper).max()) < 20


@pytest.mark.parametrize(
    "matrix",
    [
        [[1.0, 2.0], [2.0, 4.0]],
        [[1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [0.0, 0.0, 1.0]],
        [[1.0, np.nan], [0.0, 1.0]],
        [[1.0, np.inf], [0.0, 1.0]],
    ],
)
def test_singular_and_infinite_matrices_have_no_order(matrix: list[list[float]]) -> None:
    assert pivot_order(*sparse(np.array(matrix))) is None


def test_dense_rests_are_factorized_too() -> None:
    rng = np.random.default_rng(5)
    matrix = rng.normal(size=(12, 12))
    pattern, values = sparse(matrix)
    order = pivot_order(pattern, values)
    assert order is not None
    lower, upper = factorized(order, values)
    np.testing.assert_allclose(lower @ upper, matrix[np.ix_(order.row, order.column)], atol=1e-12)


@pytest.mark.parametrize("rank", [2, 1])
def test_the_pattern_is_that_of_the_bordered_matrix(rank: int) -> None:
    """Every part goes where a dense sum puts it; a deficient rank adds a border."""
    empty = Tape(0, (), (), ())
    variation = JacobianTapes(
        force_position=((0, 1), (2, 2)),
        force_velocity=((0, 0), (1, 2)),
        rhs_position=((0, 2),),
        rhs_velocity=((1, 0),),
        power_position=(),
        power_velocity=(),
        tape=empty,
    )
    system = System(
        coordinates=("x", "y", "z"),
        constraints=("a", "b"),
        holonomic=(0,),
        parameters=(),
        mass_pattern=((0, 0), (1, 1), (2, 2)),
        jacobian_pattern=((0, 0), (1, 1), (1, 2)),
        dynamics=empty,
        constraint=empty,
        report=empty,
    )
    pattern = matrix_pattern(system, variation, rank)
    jacobian = [(3, 0), (4, 1), (4, 2)]
    border = [(3, 5), (4, 5)] if rank == 1 else []
    parts = [
        *system.mass_pattern,
        *variation.force_velocity,
        *variation.force_position,
        *((j, i) for i, j in jacobian),
        *jacobian,
        (4, 0),
        (3, 2),
        *border,
        *((j, i) for i, j in border),
    ]
    numbers = 2.0 ** np.arange(len(parts))  # no two sums are equal
    n = 5 + len(border) // 2
    expected = np.zeros((n, n))
    np.add.at(expected, tuple(np.transpose(parts)), numbers)
    found = np.zeros((n, n))
    entries = np.bincount(pattern.parts, numbers)
    found[pattern.rows, pattern.columns] = entries
    np.testing.assert_array_equal(found, expected)
