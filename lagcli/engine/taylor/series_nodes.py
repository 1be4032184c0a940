"""What programs for power series are put together from: operations on coefficients, and names."""

from __future__ import annotations

from enum import IntEnum


class SeriesOp(IntEnum):
    """Operations on coefficients of order k > 0: a, b, … are series, s, t, … numbers."""

    SUM = 0  # s a + t b
    SCALE = 1  # s a
    RATE = 2  # k a_k: the coefficients of t a′
    MUL = 3
    MULSUM = 4  # s a b + t c
    INVERSE = 5  # 1 / a, from itself up to k − 1
    CHAIN = 6  # c′ = s g a′, of the rate of a and of g up to k − 1
    PAST = 7  # (a − a_0) b, of b up to k − 1
    NEXT = 8  # a_k / (k + 1): coefficient k + 1 of what a is the rate of
    ENTER = 9  # a, from the layer to its row
    COPY = 10  # a, side by side
    PASTSUM = 11  # s (a − a_0) b + t c
    END = 12


#: Which operands are numbers, and which are series that are convolved.
NUMBERS: dict[int, tuple[int, ...]] = {
    SeriesOp.SUM: (0, 2),
    SeriesOp.SCALE: (0,),
    SeriesOp.MULSUM: (0, 3),
    SeriesOp.CHAIN: (0,),
    SeriesOp.PASTSUM: (0, 3),
}
CONVOLVED: dict[int, tuple[int, ...]] = {
    SeriesOp.MUL: (0, 1),
    SeriesOp.MULSUM: (1, 2),
    SeriesOp.INVERSE: (0,),
    SeriesOp.CHAIN: (1,),
    SeriesOp.PAST: (0,),
    SeriesOp.PASTSUM: (1,),
}
#: Names of series that no register has: the work; what is zero beyond its first coefficient; and
#: from the next on, rates and parts.
WORK, NOUGHT, NAMELESS = 1 << 40, (1 << 40) + 1, (1 << 40) + 2
#: Added to the name of a series of which orders up to k − 1 are needed: no need to wait for it.
BEFORE = 1 << 50
#: Added to the name of a series of the state, it is its next coefficient.
AHEAD = 1 << 52
#: Added to a register, it is a number that operations use, and not the series that begins with it.
NUMBER = -(1 << 50)
