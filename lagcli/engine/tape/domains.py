"""Functions of arrays that are continued by their bound where rounding leaves their domain.

See `lagcli.engine.tape.operations.ROUNDING`.
"""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.tape.operations import ROUNDING
from lagcli.functions import Domain


def bounded(a: Array, domain: Domain) -> Array:
    """Return a, or the bound of a domain where it is beyond by rounding."""
    low, high = domain.low, domain.high
    a = np.where((a < low) & (a >= low - ROUNDING), low, a)
    return np.where((a > high) & (a <= high + ROUNDING), high, a)


def clipped(a: Array, b: Array) -> Array:
    """Return a, or 0 where it is negative by rounding of terms whose squares add up to b."""
    return np.where((a < 0.0) & (a * a <= ROUNDING * ROUNDING * b), 0.0, a)
