"""Results of rows of a sweep, as computed, journaled and written."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lagcli.arrays import Array, Numbers

#: Statuses of rows, by number; MISSING does not occur in results.
STATUSES = ("completed", "failed", "error", "missing")
COMPLETED, FAILED, ERROR, MISSING = range(4)
#: The beginning of a completed row's message that is a warning.
WARNING = "warning: "


class Results(NamedTuple):
    """The results of n rows, as arrays.

    Parameters
    ----------
    numbers : (n,) array of int
        Numbers of the rows.
    status : (n,) array of int8
        Indices into ``STATUSES``: completed; failed, if the integration failed or, in a strict
        sweep, has warnings; error, if the values are invalid for the model.
    messages : list of n str
        Messages; empty for most completed rows. Those with values that are not finite have a
        message that begins with ``WARNING``.
    counts : (n, 3) array of int
        Steps, rejected steps and evaluations.
    measures : (n, m) array
        Measures; NaN in rows that are not completed.
    kept : (n, nt, columns) array
        Stored samples, NaN after the end of a run; (n, 0, 0) if they are not stored.
    """

    numbers: Numbers
    status: NDArray[np.int8]
    messages: list[str]
    counts: Numbers
    measures: Array
    kept: Array
