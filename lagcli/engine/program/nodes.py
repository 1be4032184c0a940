"""Operations of programs on values without a register, and the allocation of registers."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from typing import Any

#: Flag of vector operations, added to an operation.
VECTOR = 64
#: Largest number of elements of a vector.
LONGEST = 256
#: Step of an operand whose registers are listed individually.
INDEXED = -(2**31)

#: Operation, destinations, operands: registers, or names of values without a register.
Node = tuple[int, tuple[Any, ...], tuple[Any, ...]]


#: Registers in a cache line.
LINE = 8


class Slots:
    """Free intervals of registers; the registers of a vector are released together."""

    def __init__(self, end: int):
        self.end = end
        self.starts: list[int] = []
        self.stops: list[int] = []
        self.vector: dict[int, tuple[int, int]] = {}  # of each place in use
        self.alive: Counter[int] = Counter()

    def take(self, size: int) -> int:
        """Return the first of a number of contiguous registers."""
        values = size
        if size > 1:  # whole lines of the cache
            size = -(-size // LINE) * LINE
        for i, (start, stop) in enumerate(zip(self.starts, self.stops, strict=True)):
            if stop - start >= size and (size == 1 or not start % LINE):
                self.starts[i] += size
                if self.starts[i] == stop:
                    del self.starts[i], self.stops[i]
                break
        else:
            start = self.end if size == 1 else -(-self.end // LINE) * LINE
            self.end = start + size
        self.vector.update(dict.fromkeys(range(start, start + size), (start, size)))
        self.alive[start] = values
        return start

    def release(self, at: int) -> None:
        """Release a register, with its vector when no other register of it is in use."""
        first, size = self.vector[at]
        self.alive[first] -= 1
        if self.alive[first]:
            return
        i = bisect_left(self.starts, first)
        self.starts.insert(i, first)
        self.stops.insert(i, first + size)
        for k in (i, i - 1):  # with its neighbours
            if 0 <= k < len(self.starts) - 1 and self.stops[k] == self.starts[k + 1]:
                self.stops[k] = self.stops.pop(k + 1)
                del self.starts[k + 1]
