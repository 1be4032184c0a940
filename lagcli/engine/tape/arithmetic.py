"""Emission of operations with simplification of zeros, ones and signs; results are unchanged."""

from __future__ import annotations

from lagcli.engine.inputs.functions import NO_FUNCTIONS, InputFunctions
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Builder


class Arithmetic(Builder):
    """A builder that omits operations without effect, and propagates signs as far as possible.

    Sums absorb the signs of their terms, so negations remain only where nothing is added.
    """

    def __init__(
        self,
        inputs: int,
        parameters: int = 0,
        other: int = 0,
        functions: InputFunctions = NO_FUNCTIONS,
    ):
        super().__init__(inputs, parameters, other, functions)
        self.zero, self.one = self.constant(0.0), self.constant(1.0)
        self.opposite: dict[int, int] = {}  # operand of a negation

    def note(self, op: int, register: int, operands: tuple[int, ...]) -> None:
        """Record the properties of a new register."""
        super().note(op, register, operands)
        if op == Op.NEG:
            self.opposite[register] = operands[0]

    def negative(self, a: int) -> int:
        """Return −a."""
        if a == self.zero:
            return a
        return self.opposite[a] if a in self.opposite else self.emit(Op.NEG, a)

    def plus(self, a: int, b: int) -> int:
        """Return a + b."""
        if a == self.zero:
            return b
        if b == self.zero:
            return a
        if b in self.opposite:
            return self.minus(a, self.opposite[b])
        if a in self.opposite:
            return self.emit(Op.SUB, b, self.opposite[a])
        return self.emit(Op.ADD, a, b)

    def minus(self, a: int, b: int) -> int:
        """Return a − b."""
        if b == self.zero:
            return a
        if a == self.zero:
            return self.negative(b)
        if b in self.opposite:
            return self.plus(a, self.opposite[b])
        if a in self.opposite:
            return self.negative(self.plus(self.opposite[a], b))
        return self.emit(Op.SUB, a, b)

    def times(self, a: int, b: int) -> int:
        """Return a b."""
        if self.zero in (a, b):
            return self.zero
        if a == self.one:
            return b
        if b == self.one:
            return a
        if a in self.opposite:
            return self.negative(self.times(self.opposite[a], b))
        if b in self.opposite:
            return self.negative(self.times(a, self.opposite[b]))
        return self.emit(Op.MUL, a, b)

    def inverse(self, a: int) -> int:
        """Return 1 / a."""
        if a in self.opposite:
            return self.negative(self.inverse(self.opposite[a]))
        return a if a == self.one else self.emit(Op.DIV, self.one, a)

    def magnitude(self, a: int) -> int:
        """Return |a|."""
        a = self.opposite.get(a, a)
        return a if a in (self.zero, self.one) else self.emit(Op.ABS, a)
