"""Directional derivatives of tapes, operation by operation (forward mode).

Griewank & Walther, Evaluating Derivatives, 2008, chapter 3.
"""

from __future__ import annotations

from lagcli.engine.tape.operations import ARITY, OPERATIONS, Op
from lagcli.engine.tape.slopes import SlopeRules
from lagcli.engine.tape.tape import Arithmetic, Builder, Tape

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
    new = _DerivativeRules(2 * given + tape.functions.size, tape.functions.size, 0, tape.functions)
    place = {i: i if i < given else i + given for i in range(tape.inputs)}
    slope = {i: given + i for i in range(given)}
    for i, x in enumerate(tape.constants, tape.inputs):
        place[i] = new.constant(x)
    for op, to, *rest in tape.code:
        operands = rest[: ARITY[op]]
        values = [place[x] for x in operands]
        slopes = [slope.get(x, new.zero) for x in operands]
        place[to] = new.new((op, *values))
        if any(x != new.zero for x in slopes):
            slope[to] = new.slope(OPERATIONS[op], place[to], values, slopes)
    whole = new.finish([slope.get(x, new.zero) for x in tape.outputs])
    pruned = Builder(whole.inputs, whole.parameters, 0, whole.functions)
    return pruned.finish(pruned.splice(whole, range(whole.inputs)))


class _DerivativeRules(Arithmetic):
    """The derivative of each operation."""

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
