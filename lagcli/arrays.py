"""The types of NumPy arrays, by what they hold."""

from typing import Any

import numpy as np

_Shape = tuple[Any, ...]

Array = np.ndarray[_Shape, np.dtype[np.float64]]
Flags = np.ndarray[_Shape, np.dtype[np.bool_]]
#: Places in other arrays.
Indices = np.ndarray[_Shape, np.dtype[np.intp]]
#: Whole numbers, such as those of the rows of a sweep.
Numbers = np.ndarray[_Shape, np.dtype[np.int64]]
#: As the core has whole numbers: streams of operations, patterns of matrices.
Int32 = np.ndarray[_Shape, np.dtype[np.int32]]
#: Colours by pixel.
Image = np.ndarray[_Shape, np.dtype[np.uint8]]
