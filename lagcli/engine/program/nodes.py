"""What programs are put together from: operations on values that have no place yet."""

from __future__ import annotations

from lagcli.engine.tape.tape import ARITY, Op

#: Operations that only programs have, after those of tapes.
MULADD, MULSUB, SUBMUL, SINCOS, END, MOVE = range(len(Op), len(Op) + 6)
#: Added to an operation, it is one on vectors.
VECTOR = 64
#: The step of an operand whose places are listed one by one.
INDEXED = -(2**31)

Node = tuple[int, tuple[int, ...], tuple[int, ...]]  # operation, destinations, operands

#: Numbers of operands and destinations, by operation.
PLACES = {
    **{int(op): 1 + n for op, n in zip(Op, ARITY, strict=True)},
    **dict.fromkeys((MULADD, MULSUB, SUBMUL), 4),
    SINCOS: 3,
    MOVE: 2,
}
