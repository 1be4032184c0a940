"""Types of NumPy arrays, by content, and the rank of any matrix."""

from typing import Any

import numpy as np

_Shape = tuple[Any, ...]

Array = np.ndarray[_Shape, np.dtype[np.float64]]
Flags = np.ndarray[_Shape, np.dtype[np.bool_]]
#: Indices into other arrays.
Indices = np.ndarray[_Shape, np.dtype[np.intp]]
#: Integers, such as row numbers of a sweep.
Numbers = np.ndarray[_Shape, np.dtype[np.int64]]
#: Integers of the core's type: streams of operations, patterns of matrices.
Int32 = np.ndarray[_Shape, np.dtype[np.int32]]
#: Colours of pixels.
Image = np.ndarray[_Shape, np.dtype[np.uint8]]


def rank_of(matrix: Array) -> int:
    """Return the rank of a matrix, 0 of an empty one, for which NumPy before 2.4 has none."""
    return int(np.linalg.matrix_rank(matrix)) if matrix.size else 0
