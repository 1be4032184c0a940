"""The types of NumPy arrays, by what they hold."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
#: Places in other arrays.
Indices = NDArray[np.intp]
#: Whole numbers, such as those of the rows of a sweep.
Numbers = NDArray[np.int64]
#: As the core has whole numbers: streams of operations, patterns of matrices.
Int32 = NDArray[np.int32]
#: Colours by pixel.
Image = NDArray[np.uint8]
