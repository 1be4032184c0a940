"""The results of rows of a sweep, as they are computed, journaled and written."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lagcli.arrays import Array, Numbers

#: The status of a row, by its number; MISSING is none that a result has.
STATUSES = ("completed", "failed", "error", "missing")
COMPLETED, FAILED, ERROR, MISSING = range(4)


class Results(NamedTuple):
    """The results of n rows; arrays, so that they are sent and kept as they are.

    Parameters
    ----------
    numbers : (n,) array of int
        The rows' numbers.
    status : (n,) array of int8
        An index of ``STATUSES``: completed; failed, where the numbers did or, of a strict sweep,
        cannot be trusted; error, where the model cannot have these values.
    messages : list of n str
        Empty for most completed rows.
    counts : (n, 3) array of int
        Steps, rejected steps and evaluations.
    measures : (n, m) array
        NaN in rows that are not completed.
    kept : (n, nt, columns) array
        The samples, NaN where a run did not come to them; (n, 0, 0) where they are not kept.
    """

    numbers: Numbers
    status: NDArray[np.int8]
    messages: list[str]
    counts: Numbers
    measures: Array
    kept: Array
