"""What programs for power series are put together from: operations on coefficients, and names."""

from __future__ import annotations

from enum import IntEnum


class SeriesOp(IntEnum):
    """Operations on coefficients of order k > 0: a, b, … are series, s, t, … numbers.

    `lagcli.engine.core.headers` writes the same for C.

    Attributes
    ----------
    operands : str
        A letter for each operand: n is a number, s a series of which order k is used, c one that is
        convolved, and e one that is convolved up to order k − 1.
    """

    operands: str

    def __new__(cls, operands: str) -> SeriesOp:
        """Number the operations in the order of their rows."""
        op = int.__new__(cls, len(cls.__members__))
        op._value_ = len(cls.__members__)
        op.operands = operands
        return op

    SUM = "nsns"  # s a + t b
    SCALE = "ns"  # s a
    RATE = "s"  # k a_k: the coefficients of t a′
    MUL = "cc"  # a b
    MULSUM = "nccns"  # s a b + t c
    INVERSE = "ce"  # 1 / a, from itself up to k − 1
    CHAIN = "nce"  # c′ = s g a′, of the rate of a and of g up to k − 1
    MUL_TAIL = "ce"  # (a − a_0) b
    INTEGRATE = "s"  # a_k / (k + 1): coefficient k + 1 of what a is the rate of
    TO_ROW = "s"  # a, from the layer to its row
    COPY = "s"  # a, side by side
    MUL_TAIL_SUM = "ncens"  # s (a − a_0) b + t c
    END = ""


def _positions(letter: str) -> dict[int, tuple[int, ...]]:
    found = {op: tuple(i for i, x in enumerate(op.operands) if x == letter) for op in SeriesOp}
    return {op: at for op, at in found.items() if at}


#: Which operands are numbers, and which are series that are convolved.
NUMBERS, CONVOLVED = _positions("n"), _positions("c")
#: The largest order; the core's loops know their lengths up to here.
MAX_ORDER = 31
#: Elements that a vector has at most.
LONGEST = 1024
#: Names of series that no register has: the work; what is zero beyond its first coefficient; and
#: from the next on, rates and parts.
WORK, ZERO, NAMELESS = 1 << 40, (1 << 40) + 1, (1 << 40) + 2
#: Added to the name of a series of which orders up to k − 1 are needed: no need to wait for it.
BEFORE = 1 << 50
#: Added to the name of a series of the state, it is its next coefficient.
AHEAD = 1 << 52
#: Added to a register, it is a number that operations use, and not the series that begins with it.
NUMBER = -(1 << 50)
