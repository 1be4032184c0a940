"""Tapes as assignments of nested expressions, which code prints.

A tape has one register for each operation, and code with one variable for each cannot be read.
Here a result that is used once is written where it is used. The operations and their order are
those of the tape, so that compiled code has the values of the core, to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from lagcli.engine.tape.operations import ARITY, OPERATIONS, ROUNDING, Op
from lagcli.engine.tape.tape import Tape
from lagcli.functions import Domain

#: Largest number of operations of an expression that is written where it is used.
_LONGEST = 10


class Variable(NamedTuple):
    """A variable."""

    name: str


class Constant(NamedTuple):
    """A constant."""

    value: float


class AppliedOperation(NamedTuple):
    """An operation on expressions."""

    op: Op
    operands: tuple[Expression, ...]


Expression = Variable | Constant | AppliedOperation


class Assignments(NamedTuple):
    """A tape as assignments.

    Parameters
    ----------
    steps : tuple of (str, Expression)
        Variables and their values, in order.
    outputs : tuple of Expression
    read : frozenset of str
        The inputs that are used.
    used : frozenset of Op
        The operations that are used.
    """

    steps: tuple[tuple[str, Expression], ...]
    outputs: tuple[Expression, ...]
    read: frozenset[str]
    used: frozenset[Op]


def assignments(tape: Tape, inputs: Sequence[str]) -> Assignments:
    """Return a tape as assignments to the variables w1, w2, ….

    Parameters
    ----------
    tape : Tape
    inputs : sequence of str
        The variables of its inputs.
    """
    tape = tape.selected(range(len(tape.outputs)))  # without what nothing needs
    uses = [0] * tape.registers
    for op, _, *operands in tape.code:
        for register in operands[: ARITY[op]]:
            uses[register] += 1
    inner = uses.copy()
    for register in tape.outputs:
        uses[register] += 1
    values: list[Expression] = [Variable(name) for name in inputs]
    values += map(Constant, tape.constants)
    sizes = [0] * len(values)
    steps: list[tuple[str, Expression]] = []
    for op, to, *operands in tape.code:
        own = operands[: ARITY[op]]
        value: Expression = AppliedOperation(OPERATIONS[op], tuple(values[x] for x in own))
        size = 1 + sum(sizes[x] for x in own)
        if uses[to] > 1 or (inner[to] and size >= _LONGEST):
            steps.append((f"w{len(steps) + 1}", value))
            value, size = Variable(steps[-1][0]), 0
        values.append(value)
        sizes.append(size)
        assert len(values) == to + 1
    read = (inputs[i] for i in tape.read)
    used = (OPERATIONS[line[0]] for line in tape.code)
    outputs = tuple(values[x] for x in tape.outputs)
    return Assignments(tuple(steps), outputs, frozenset(read), frozenset(used))


_RELATIONS = {Op.LT: "<", Op.LE: "<=", Op.EQ: "==", Op.NE: "!="}
_INFIX = {Op.ADD: ("+", 1), Op.SUB: ("-", 1), Op.MUL: ("*", 2), Op.DIV: ("/", 2)}
#: How tightly expressions bind: a choice, a sum, a product, a name.
_CHOICE, _SUM, _PRODUCT, _ATOM = range(4)


class Syntax(NamedTuple):
    """How a language writes expressions.

    Parameters
    ----------
    choice : str
        Format of a choice between two values, with ``{0}`` as the condition.
    function : callable
        Returns the name of the function that evaluates an operation.
    logic : mapping of Op to str
        Formats of AND, OR and NOT of conditions.
    number : callable
        Returns a constant as text.
    relations : mapping of Op to str
        Formats of comparisons that differ from those of C.
    infix_choice : bool
        Whether the format of a choice needs parentheses within an expression.
    power : str
        Format of a power; by default it is a function.
    """

    choice: str
    function: Callable[[Op], str]
    logic: Mapping[Op, str]
    number: Callable[[float], str]
    relations: Mapping[Op, str] = MappingProxyType({})
    infix_choice: bool = True
    power: str = ""

    def text(self, expression: Expression) -> str:
        """Return an expression as text."""
        return self._write(expression)[0]

    def term(self, expression: Expression) -> str:
        """Return an expression as text that other terms may follow."""
        return self._within(expression, _SUM)

    def _write(self, e: Expression) -> tuple[str, int]:
        """Return the text of an expression, and how tightly it binds."""
        if isinstance(e, Variable):
            return e.name, _ATOM
        if isinstance(e, Constant):
            text = self.number(e.value)
            return text, _SUM if text.startswith("-") else _ATOM
        op, operands = e
        if op in _INFIX:
            sign, level = _INFIX[op]
            left = self._within(operands[0], level)
            # a - (b - c) and a + (b + c) differ from those without parentheses
            return f"{left} {sign} {self._within(operands[1], level + 1)}", level
        if op is Op.NEG:
            return f"-{self._within(operands[0], _ATOM)}", _SUM
        if op is Op.SELECT:
            # in Python, a choice within the first value would take the second for its own
            values = self._within(operands[1], _SUM), self.text(operands[2])
            return self._chosen(self.condition(operands[0]), *values)
        if op in _RELATIONS or op in self.logic:
            return self._chosen(self.condition(e), self.number(1.0), self.number(0.0))
        if op is Op.POW and self.power:
            base, exponent = (self._within(x, _ATOM) for x in operands)
            return self.power.format(base, exponent), _PRODUCT
        name = _helper(op) or self.function(op)
        return f"{name}({', '.join(map(self.text, operands))})", _ATOM

    def _chosen(self, condition: str, yes: str, no: str) -> tuple[str, int]:
        text = self.choice.format(condition, yes, no)
        return text, _CHOICE if self.infix_choice else _ATOM

    def _within(self, e: Expression, level: int) -> str:
        text, own = self._write(e)
        return text if own >= level else f"({text})"

    def condition(self, e: Expression) -> str:
        """Return an expression that is 0 or 1 as a condition."""
        if isinstance(e, AppliedOperation):
            if e.op in _RELATIONS:
                return self._related(e.op, *e.operands)
            if e.op in self.logic:
                return self.logic[e.op].format(*map(self.condition, e.operands))
        return self._related(Op.NE, e, Constant(0.0))

    def _related(self, op: Op, a: Expression, b: Expression) -> str:
        form = self.relations.get(op) or f"{{0}} {_RELATIONS[op]} {{1}}"
        return form.format(self._within(a, _SUM), self._within(b, _SUM))


def _helper(op: Op) -> str:
    """Return the name of the function of code that evaluates an operation; empty if it has none."""
    if op is Op.CLIP:
        return "clipped"
    rounded = op.function is not None and op.function.domain.rounded
    return f"bounded_{op.name.lower()}" if rounded else ""


#: The names that functions of code can have.
HELPERS = frozenset(filter(None, map(_helper, Op)))


class Helper(NamedTuple):
    """A function that code defines.

    Parameters
    ----------
    name : str
    parameters : tuple of str
    value : str
    comment : str
    """

    name: str
    parameters: tuple[str, ...]
    value: str
    comment: str


def helpers(used: frozenset[Op], syntax: Syntax) -> list[Helper]:
    """Return the functions that code defines for operations that no language has."""
    defined = []
    for op in sorted(op for op in used if _helper(op)):
        if op is Op.CLIP:
            comment = "a, or 0 where it is negative by rounding of terms whose squares add up to b."
            value = syntax.text(_CLIPPED)
        else:
            assert op.function is not None
            own = op.name.lower()
            comment = f"{own}, also of arguments that are beyond its domain by rounding."
            inner = syntax.text(_bounded(op.function.domain))
            value = f"{syntax.function(op)}({inner})"
        names = ("a", "b") if op is Op.CLIP else ("x",)
        defined.append(Helper(_helper(op), names, value, comment))
    return defined


def _operation(op: Op, *operands: Expression) -> AppliedOperation:
    return AppliedOperation(op, operands)


def _bounded(domain: Domain) -> Expression:
    """Return `lagcli.engine.tape.operations.bounded` of x as an expression."""
    x = Variable("x")
    result: Expression = x
    if math.isfinite(domain.low):
        low, beyond = Constant(domain.low), Constant(domain.low - ROUNDING)
        outside = _operation(Op.AND, _operation(Op.LE, beyond, x), _operation(Op.LT, x, low))
        result = _operation(Op.SELECT, outside, low, result)
    if math.isfinite(domain.high):
        high, beyond = Constant(domain.high), Constant(domain.high + ROUNDING)
        outside = _operation(Op.AND, _operation(Op.LT, high, x), _operation(Op.LE, x, beyond))
        result = _operation(Op.SELECT, outside, high, result)
    return result


_A, _SQUARE = Variable("a"), _operation(Op.MUL, Variable("a"), Variable("a"))
#: `lagcli.engine.tape.operations.clipped` of a and b.
_CLIPPED = _operation(
    Op.SELECT,
    _operation(
        Op.AND,
        _operation(Op.LT, _A, Constant(0.0)),
        _operation(
            Op.LE, _SQUARE, _operation(Op.MUL, Constant(ROUNDING * ROUNDING), Variable("b"))
        ),
    ),
    Constant(0.0),
    _A,
)
