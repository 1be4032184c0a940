"""Sparse rows against whole arrays of random numbers."""

from __future__ import annotations

import numpy as np
import pytest

from lagcli.sparse_table import SparseTable, changes_of, merged_changes, modes_after


def random_modes(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return modes at the start, and after each of some entries, few of which change."""
    entries, rows = int(random.integers(0, 40)), int(random.integers(0, 6))
    start, modes = random.integers(0, 4, rows), np.empty((entries, rows), dtype=np.intp)
    now = start
    for k in range(entries):
        now = np.where(random.random(rows) < 0.2, random.integers(0, 4, rows), now)
        modes[k] = now
    return start, modes


@pytest.mark.parametrize("seed", range(50))
def test_modes_are_recovered_from_their_changes(seed: int) -> None:
    random = np.random.default_rng(seed)
    start, modes = random_modes(random)
    changes = changes_of(start, modes)
    changes.check("modes")
    every = np.vstack([start, modes])
    counts = random.integers(0, len(modes) + 1, 12)  # in any order
    np.testing.assert_array_equal(modes_after(start, changes, counts), every[counts])
    assert len(changes.value) == np.count_nonzero(every[1:] != every[:-1])


@pytest.mark.parametrize("seed", range(50))
def test_changes_that_are_merged_show_the_last_modes(seed: int) -> None:
    """Each shown entry has the modes of the last one that it stands for."""
    random = np.random.default_rng(seed)
    start, modes = random_modes(random)
    changes = changes_of(start, modes)
    seen = np.maximum.accumulate(random.permutation(len(modes))) if len(modes) else np.empty(0, int)
    shown = np.searchsorted(seen, changes.row)
    found = merged_changes(start, len(modes), shown, changes.column, changes.value)
    found.check("modes")
    expected = changes_of(start, modes[seen])
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("seed", range(20))
def test_parts_of_sparse_rows(seed: int) -> None:
    random = np.random.default_rng(seed)
    shape = (int(random.integers(1, 30)), int(random.integers(1, 6)))
    dense = random.standard_normal(shape) * (random.random(shape) < 0.3)
    rows = SparseTable.of(dense)
    rows.check("numbers")
    order = random.permutation(shape[0])[: int(random.integers(1, shape[0] + 1))]
    taken = rows.taken(order)
    taken.check("numbers")
    np.testing.assert_array_equal(rows.dense(), dense)
    np.testing.assert_array_equal(taken.dense(), dense[order])
    row, column = (random.integers(0, n, 20) for n in shape)
    np.testing.assert_array_equal(rows.at(row, column), dense[row, column])
    places, values = rows.of_column(0)
    np.testing.assert_array_equal(places, np.flatnonzero(dense[:, 0]))
    np.testing.assert_array_equal(values, dense[places, 0])
    starts = rows.starts()
    assert np.diff(starts).tolist() == np.count_nonzero(dense, axis=1).tolist()


@pytest.mark.parametrize(
    ("row", "column", "message"),
    [
        ([0, 2], [0, 0], "outside of the 2"),
        ([0, 1], [0, -1], "outside of the 3"),
        ([1, 0], [0, 0], "not in order"),
        ([1, 1], [2, 1], "not in order"),
        ([1, 1], [2, 2], "twice"),
        ([1], [2, 2], "differ in number"),
    ],
)
def test_places_without_sense(row: list[int], column: list[int], message: str) -> None:
    rows = SparseTable((2, 3), np.array(row), np.array(column), np.ones(2))
    with pytest.raises(ValueError, match=message):
        rows.check("numbers")
