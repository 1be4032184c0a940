"""Functions of arrays that are continued by their bound where rounding leaves their domain.

See `lagcli.engine.tape.operations.ROUNDING`.
"""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.tape.operations import ROUNDING


def arcsin(a: Array) -> Array:
    """Return the arcsine; ±π/2 where a is beyond [−1, 1] by rounding."""
    return np.asarray(np.arcsin(_bounded(a)))


def arccos(a: Array) -> Array:
    """Return the arccosine; 0 or π where a is beyond [−1, 1] by rounding."""
    return np.asarray(np.arccos(_bounded(a)))


def arccosh(a: Array) -> Array:
    """Return the inverse hyperbolic cosine; 0 where a is below 1 by rounding."""
    return np.asarray(np.arccosh(np.where((a < 1.0) & (a >= 1.0 - ROUNDING), 1.0, a)))


def clipped(a: Array, b: Array) -> Array:
    """Return a, or 0 where it is negative by rounding of terms whose squares add up to b."""
    return np.where((a < 0.0) & (a * a <= ROUNDING * ROUNDING * b), 0.0, a)


def _bounded(a: Array) -> Array:
    beyond = (np.abs(a) > 1.0) & (np.abs(a) <= 1.0 + ROUNDING)
    return np.where(beyond, np.copysign(1.0, a), a)
