"""The operations of programs for power series.

`lagcli.engine.core.headers` writes them for C when the core is built, so this module imports only
the standard library.
"""

from __future__ import annotations

from enum import IntEnum


class SeriesOp(IntEnum):
    """Operations on coefficients of order k > 0: a, b, … are series, s, t, … numbers.

    `lagcli.engine.core.headers` writes them for C.

    Attributes
    ----------
    operands : str
        A letter for each operand: n is a number, s a series of which order k is used, c one that is
        convolved, and e one that is convolved up to order k − 1.
    numbers, convolved : tuples of int
        Which operands are numbers, and which are series of a letter.
    """

    operands: str
    numbers: tuple[int, ...]
    convolved: tuple[int, ...]

    def __new__(cls, operands: str) -> SeriesOp:
        """Number the operations in the order of their rows."""
        op = int.__new__(cls, len(cls.__members__))
        op._value_ = len(cls.__members__)
        op.operands = operands
        op.numbers, op.convolved = (
            tuple(i for i, x in enumerate(operands) if x == letter) for letter in "nc"
        )
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


#: Largest number of elements of a vector.
LONGEST = 1024
