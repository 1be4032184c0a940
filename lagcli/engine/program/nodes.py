"""Operations of programs, on values without a place yet."""

from __future__ import annotations

from typing import Any

#: Added to an operation, it is one on vectors.
VECTOR = 64
#: The number of elements that a vector has at most.
LONGEST = 256
#: The step of an operand whose places are listed one by one.
INDEXED = -(2**31)

#: Operation, destinations, operands: places, or what has a place later, such as registers.
Node = tuple[int, tuple[Any, ...], tuple[Any, ...]]
