"""The pattern of the constraint forces, and tables of inputs."""

from __future__ import annotations

import numpy as np
import pytest

from lagcli.trajectory.samples import InputTable, Terms

TERMS = Terms.of([(0, 1), (0, 3), (2, 0), (2, 1)], (3, 4))
VALUES = np.array([[1.0, 2, 3, 4], [5, 6, 7, 8]])


def test_forces_of_constraints_are_those_of_a_sparse_matrix() -> None:
    dense = np.zeros((2, 3, 4))
    for k, (i, j) in enumerate(zip(TERMS.constraint, TERMS.coordinate, strict=True)):
        dense[:, i, j] = VALUES[:, k]
    np.testing.assert_array_equal(TERMS.total(VALUES), dense.sum(axis=1))
    for i in range(3):
        np.testing.assert_array_equal(TERMS.dense(VALUES, i), dense[:, i])
        for j in range(4):
            np.testing.assert_array_equal(TERMS.column(VALUES, i, j), dense[:, i, j])
    assert TERMS.acting(2) == {0: 2, 1: 3}
    assert TERMS.acting(1) == {}


def test_a_system_without_constraints_has_no_terms() -> None:
    nothing = Terms.of([], (0, 2))
    nothing.check()
    assert nothing.total(np.zeros((3, 0))).tolist() == [[0, 0]] * 3


@pytest.mark.parametrize(
    ("terms", "message"),
    [
        (TERMS._replace(coordinate=np.array([1, 3, 0])), "differ in length"),
        (TERMS._replace(constraint=np.array([0, 0, 2, 3])), "that do not exist"),
        (TERMS._replace(coordinate=np.array([1, -1, 0, 1])), "that do not exist"),
        (TERMS._replace(coordinate=np.array([1, 3, 1, 0])), "not in order"),
        (TERMS._replace(coordinate=np.array([1, 1, 0, 1])), "not in order"),
    ],
)
def test_terms_that_are_none(terms: Terms, message: str) -> None:
    TERMS.check()
    with pytest.raises(ValueError, match=message):
        terms.check()


@pytest.mark.parametrize(
    ("times", "values"),
    [([0.0], [1.0]), ([0.0, 1], [1.0]), ([0.0, 0], [1.0, 2]), ([0.0, 1], [1.0, np.nan])],
)
def test_tables_need_increasing_times_and_values(times: list[float], values: list[float]) -> None:
    InputTable(np.array([0.0, 1.0]), np.array([2.0, 2.0])).check("u")
    with pytest.raises(ValueError, match="table of u"):
        InputTable(np.array(times), np.array(values)).check("u")
