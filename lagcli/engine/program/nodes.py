"""Operations of programs on values that have no register yet."""

from __future__ import annotations

from typing import Any

#: Flag of vector operations, added to an operation.
VECTOR = 64
#: Largest number of elements of a vector.
LONGEST = 256
#: Step of an operand whose registers are listed individually.
INDEXED = -(2**31)

#: Operation, destinations, operands: registers, or names of values without a register.
Node = tuple[int, tuple[Any, ...], tuple[Any, ...]]
