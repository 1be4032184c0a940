"""Derivatives of tapes, operation by operation: along a direction (forward mode), and gradients
(reverse mode).

Griewank & Walther, Evaluating Derivatives, 2008, chapter 3.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from functools import partial
from heapq import heappop, heappush
from typing import Any, NamedTuple

from lagcli.engine.tape.operations import OPERATIONS, Op
from lagcli.engine.tape.tape import Arithmetic, Builder, Tape


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


#: Operations whose results are piecewise constant.
_CONSTANT = (Op.LT, Op.LE, Op.EQ, Op.NE, Op.AND, Op.OR, Op.NOT, Op.FLOOR, Op.CEIL)


def directional(tape: Tape) -> Tape:
    """Return the tape of the derivatives of a tape's outputs along a direction.

    Comparisons, `floor` and `ceil` count as constant: the derivative is that of the branch.

    Parameters
    ----------
    tape : Tape
        x → y; deferred inputs are not supported.

    Returns
    -------
    Tape
        (x, x') → (∂y/∂x) x'. x does not include the pieces of known functions.
    """
    assert not tape.rhs_inputs
    given = tape.inputs - tape.functions.size
    new = DerivativeBuilder(2 * given + tape.functions.size, tape.functions.size, 0, tape.functions)
    outputs = new.splice(tape, [*range(given), *range(2 * given, new.inputs)])
    whole = new.finish(new.along(outputs, {i: given + i for i in range(given)}))
    pruned = Builder(whole.inputs, whole.parameters, 0, whole.functions)
    return pruned.finish(pruned.splice(whole, range(whole.inputs)))


class DerivativeBuilder(Arithmetic):
    """A builder that appends derivatives of its registers."""

    @classmethod
    def of(cls, tape: Tape) -> tuple[DerivativeBuilder, list[int]]:
        """Return a builder with the operations of a tape, and the registers of its outputs."""
        builder = cls(tape.inputs, tape.parameters, 0, tape.functions)
        return builder, builder.extend(tape)

    def along(self, registers: Sequence[int], inputs: Mapping[int, int]) -> list[int]:
        """Return the registers of derivatives along a direction.

        Parameters
        ----------
        registers : sequence of int
        inputs : mapping of int to int
            The direction: the registers of the derivatives of inputs; others are constant.

        Returns
        -------
        list of int
        """
        code, needed = list(self.operations), set(registers)
        for at in range(len(code) - 1, -1, -1):
            if self.inputs + at in needed:
                needed.update(code[at][1:])
        slope = dict(inputs)
        for result, (op, *operands) in enumerate(code, self.inputs):
            if result in needed and not slope.keys().isdisjoint(operands):
                slopes = [slope.get(x, self.zero) for x in operands]
                if any(x != self.zero for x in slopes):
                    slope[result] = self.slope(OPERATIONS[op], result, operands, slopes)
        return [slope.get(x, self.zero) for x in registers]

    def gradients(self, registers: Sequence[int], inputs: Container[int]) -> list[dict[int, int]]:
        """Return the gradients of registers.

        Parameters
        ----------
        registers : sequence of int
        inputs : container of int
            Those with respect to which is differentiated.

        Returns
        -------
        list of dicts of int to int
            The registers of the nonzero derivatives, by input.
        """
        code = list(self.operations)
        varying = set()
        for result, (_, *operands) in enumerate(code, self.inputs):
            if any(x in inputs or x in varying for x in operands):
                varying.add(result)
        return [self._gradient(code, varying, inputs, register) for register in registers]

    def _gradient(
        self,
        code: Sequence[tuple[int, ...]],
        varying: Container[int],
        inputs: Container[int],
        register: int,
    ) -> dict[int, int]:
        """Return the gradient of a register, given the operations and those that vary."""
        adjoint, left = {register: self.one}, [-register]  # the latest operation first
        found: dict[int, int] = {}
        while left:
            result = -heappop(left)
            sensitivity = adjoint.pop(result)
            if result in inputs:
                found[result] = sensitivity
                continue
            if sensitivity == self.zero or result not in varying:
                continue
            op, *operands = code[result - self.inputs]
            for k, x in enumerate(operands):
                if x not in inputs and x not in varying:
                    continue
                slopes = [self.zero] * len(operands)
                slopes[k] = sensitivity
                part = self.slope(OPERATIONS[op], result, operands, slopes)
                if x in adjoint:
                    adjoint[x] = self.plus(adjoint[x], part)
                else:
                    adjoint[x] = part
                    heappush(left, -x)
        return {x: found[x] for x in sorted(found) if found[x] != self.zero}

    def slope(self, op: Op, result: int, x: list[int], dx: list[int]) -> int:
        """Return the derivative of an operation's result.

        Parameters
        ----------
        op : Op
        result : int
        x, dx : lists of int
            The operands and their derivatives.
        """
        if op in _CONSTANT:
            return self.zero
        if op == Op.SELECT:
            same = dx[1] == dx[2]
            return dx[1] if same else self.emit(Op.SELECT, x[0], dx[1], dx[2])
        if len(x) == 1:
            return self.over(op, result, x[0], dx[0])
        return self.of_two(op, result, x, dx)

    def of_two(self, op: Op, result: int, x: list[int], dx: list[int]) -> int:
        """Return the derivative of an operation on two numbers."""
        a, b, da, db = *x, *dx
        if op == Op.ADD:
            return self.plus(da, db)
        if op == Op.SUB:
            return self.minus(da, db)
        if op == Op.MUL:
            return self.plus(self.times(da, b), self.times(a, db))
        if op == Op.DIV:
            return self.quotient(self.minus(da, self.times(result, db)), b)
        if op == Op.ATAN2:
            square = self.plus(self.times(a, a), self.times(b, b))
            return self.quotient(self.minus(self.times(b, da), self.times(a, db)), square)
        if op == Op.CLIP:
            return da
        assert op == Op.POW, op.name
        derivative = self.zero
        if da != self.zero:
            lower = self.emit(Op.POW, a, self.minus(b, self.one))
            derivative = self.times(self.times(b, lower), da)
        if db != self.zero:
            derivative = self.plus(
                derivative, self.times(self.times(result, self.emit(Op.LOG, a)), db)
            )
        return derivative

    def over(self, op: Op, y: int, a: int, da: int) -> int:
        """Return the derivative of a function of one number."""
        if op == Op.NEG:
            return self.negative(da)
        if op == Op.ABS:
            below = self.emit(Op.LT, a, self.zero)
            return self.emit(Op.SELECT, below, self.negative(da), da)
        number, register, divisor = _RootsWithBounds(self).of(op, a, y)
        if divisor is not None:
            return self.scaled(number, self.quotient(da, divisor))
        assert register is not None
        return self.times(self.scaled(number, register), da)

    def scaled(self, number: float, a: int) -> int:
        """Return a number times a register."""
        if abs(number) == 1.0:
            return a if number > 0 else self.negative(a)
        return self.times(self.constant(number), a)

    def quotient(self, a: int, b: int) -> int:
        """Return a / b."""
        return self.zero if a == self.zero else self.emit(Op.DIV, a, b)


class _RootsWithBounds(SlopeRules):
    """Rules whose roots of differences are 0 where rounding makes the difference negative."""

    def root(self, a: int) -> int:
        """Return the register of √a."""
        builder = self.builder
        op, *operands = list(builder.operations)[a - builder.inputs]
        if op == Op.SUB:
            squares = builder.plus(*[builder.times(x, x) for x in operands])
            a = builder.emit(Op.CLIP, a, squares)
        return super().root(a)
