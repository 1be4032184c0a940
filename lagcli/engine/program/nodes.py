"""What programs are put together from: operations on values that have no place yet."""

from __future__ import annotations

#: Added to an operation, it is one on vectors.
VECTOR = 64
#: The number of elements that a vector has at most.
LONGEST = 256
#: The step of an operand whose places are listed one by one.
INDEXED = -(2**31)

Node = tuple[int, tuple[int, ...], tuple[int, ...]]  # operation, destinations, operands
