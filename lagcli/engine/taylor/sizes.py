"""Sizes of programs for power series: the order, and the length from which they are vectorized."""

from __future__ import annotations

import math

from lagcli.engine.tape.operations import MAX_ORDER

#: Number of operations from which programs are vectorized: those of a chain of 20 bodies.
LONG = 500


def order_for(rtol: float) -> int:
    """Return the order with the least run time at a relative tolerance.

    Jorba and Zou's would be −ln(rtol)/2 + 1. Here, projection and monitoring add to the cost of a
    step, so longer steps are better; in measurements, six more orders are best within a few.
    """
    return min(math.ceil(-math.log(rtol) / 2) + 6, MAX_ORDER)
