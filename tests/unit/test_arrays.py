"""Ranks of matrices."""

from __future__ import annotations

import numpy as np

from lagcli.arrays import rank_of


def test_an_empty_matrix_has_rank_zero() -> None:
    """NumPy before 2.4 raises an error."""
    assert [rank_of(np.zeros(shape)) for shape in ((0, 3), (3, 0), (2, 3))] == [0, 0, 0]
    assert rank_of(np.eye(3)[:2]) == 2
