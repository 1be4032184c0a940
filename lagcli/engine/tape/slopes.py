"""Derivatives of functions as operations of a tape, from the rules of `lagcli.functions`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Arithmetic


class Slope(NamedTuple):
    """A number times a register, over another; None stands for 1."""

    number: float
    register: int | None = None
    divisor: int | None = None


class SlopeRules:
    """Evaluates the rules of derivatives on the registers of a tape.

    Subclasses replace `product` and `quotient` for series, and `root` for roots that are continued
    by their bound.
    """

    def __init__(self, builder: Arithmetic):
        self.builder = builder

    def of(self, op: Op, x: int, y: int) -> Slope:
        """Return f′(x) of a function with a rule, where y = f(x)."""
        assert op.function is not None
        assert op.function.slope is not None, op.name
        return self.apply(op.function.slope, x, y)

    def apply(self, rule: Callable[[Any, Any, Any], Any], x: int, y: int) -> Slope:
        """Return the value of a rule."""
        slope = rule(self, _Operand(self, Slope(1.0, x)), _Operand(self, Slope(1.0, y)))
        assert isinstance(slope, _Operand)
        return slope.value

    def __getattr__(self, name: str) -> Callable[[_Operand], _Operand]:
        """Return a function of rules by its name."""
        return partial(self._applied, Op[name.upper()])

    def _applied(self, op: Op, argument: _Operand) -> _Operand:
        at = argument.register()
        register = self.root(at) if op == Op.SQRT else self.builder.emit(op, at)
        return _Operand(self, Slope(1.0, register))

    def product(self, a: int, b: int) -> int:
        """Return the register of a b."""
        return self.builder.times(a, b)

    def quotient(self, a: int, b: int) -> int:
        """Return the register of a / b."""
        return self.builder.emit(Op.DIV, a, b)

    def root(self, a: int) -> int:
        """Return the register of √a."""
        return self.builder.emit(Op.SQRT, a)


class _Operand:
    """A value in a rule, with the operators of arithmetic."""

    def __init__(self, rules: SlopeRules, value: Slope):
        self.rules, self.value = rules, value

    def register(self) -> int:
        """Return the register of the value."""
        builder, (number, register, divisor) = self.rules.builder, self.value
        if register is None:
            register = builder.constant(number)
            return register if divisor is None else self.rules.quotient(register, divisor)
        if number in (1.0, -1.0):
            return register if number > 0 else builder.negative(register)
        return builder.times(builder.constant(number), register)

    def with_(self, other: _Operand | float) -> _Operand:
        """Return an operand of a rule; numbers become values."""
        return other if isinstance(other, _Operand) else _Operand(self.rules, Slope(other))

    def __neg__(self) -> _Operand:
        return _Operand(self.rules, self.value._replace(number=-self.value.number))

    def __add__(self, other: _Operand | float) -> _Operand:
        a, b = self.register(), self.with_(other).register()
        return _Operand(self.rules, Slope(1.0, self.rules.builder.plus(a, b)))

    def __radd__(self, other: float) -> _Operand:
        return self.with_(other) + self

    def __sub__(self, other: _Operand | float) -> _Operand:
        a, b = self.register(), self.with_(other).register()
        return _Operand(self.rules, Slope(1.0, self.rules.builder.minus(a, b)))

    def __rsub__(self, other: float) -> _Operand:
        return self.with_(other) - self

    def __mul__(self, other: _Operand | float) -> _Operand:
        a, b = self.value, self.with_(other).value
        number = a.number * b.number
        if a.divisor is not None or b.divisor is not None:
            a, b = Slope(1.0, self.register()), Slope(1.0, self.with_(other).register())
            number = 1.0
        register = a.register if b.register is None else b.register
        if a.register is not None and b.register is not None:
            register = self.rules.product(a.register, b.register)
        return _Operand(self.rules, Slope(number, register))

    def __rmul__(self, other: float) -> _Operand:
        return self.with_(other) * self

    def __truediv__(self, other: _Operand | float) -> _Operand:
        divisor = self.with_(other)
        if self.value.register is None and self.value.divisor is None:
            return _Operand(self.rules, Slope(self.value.number, None, divisor.register()))
        quotient = self.rules.quotient(self.register(), divisor.register())
        return _Operand(self.rules, Slope(1.0, quotient))

    def __rtruediv__(self, other: float) -> _Operand:
        return self.with_(other) / self
