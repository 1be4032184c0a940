"""Recognition of |x|, sign, min, max and step in piecewise expressions."""

from __future__ import annotations

from collections.abc import Callable

import symengine as se
from symengine import Basic

from lagcli.equations.presentation.typeset import (
    Call,
    Cases,
    Logical,
    Node,
    Number,
    Relation,
)

Arrange = Callable[[Basic], Node]

_RELATIONS = {
    "LessThan": "<=",
    "StrictLessThan": "<",
    "Equality": "==",
    "Unequality": "!=",
}
_MIRRORED = {"<=": ">=", "<": ">", "==": "==", "!=": "!="}


def cases_node(piecewise: Basic, arrange: Arrange) -> Node:
    """Return the function that a Piecewise represents (see `lagcli.model.expression.functions`)."""
    args = piecewise.args
    value, condition = args[0], args[1]
    rest = (
        args[2]
        if len(args) == 4 and args[3] == se.true
        else se.Piecewise(*zip(args[2::2], args[3::2], strict=True))
    )
    named = _named(value, condition, rest)
    if named is not None:
        name, arguments = named
        return Call(name, tuple(arrange(a) for a in arguments))
    return Cases(condition_node(condition, arrange), arrange(value), arrange(rest))


def _named(value: Basic, condition: Basic, rest: Basic) -> tuple[str, list[Basic]] | None:
    """Return the name and arguments of the function that a Piecewise represents."""
    if not isinstance(condition, se.LessThan | se.StrictLessThan):
        return None
    low, high = condition.args
    strict = isinstance(condition, se.StrictLessThan)
    if low == 0 and not strict and value == high and se.expand(value + rest) == 0:
        return "abs", [value]
    if low == 0 and strict and value == 1 and isinstance(rest, se.Piecewise):
        negative = se.Piecewise((se.Integer(-1), se.Lt(high, 0)), (se.Integer(0), se.true))
        if rest == negative:
            return "sign", [high]
    if strict:
        return None
    if (value, rest) == (low, high):
        return "min", [*_chain("min", low), *_chain("min", high)]
    if (value, rest) == (high, low):
        return "max", [*_chain("max", high), *_chain("max", low)]
    if low == 0 and value == 1 and rest == 0:
        return "step", [high]
    third = se.Rational(1, 3)
    if low == 0 and value == high**third and rest == -((-high) ** third):
        return "cbrt", [high]
    return None


def _chain(name: str, e: Basic) -> list[Basic]:
    """Return the arguments of min(min(a, b), c) as a flat list."""
    if isinstance(e, se.Piecewise) and len(e.args) == 4 and e.args[3] == se.true:
        named = _named(e.args[0], e.args[1], e.args[2])
        if named is not None and named[0] == name:
            return named[1]
    return [e]


def condition_node(condition: Basic, arrange: Arrange) -> Node:
    """Return a condition with its variable side on the left."""
    name = type(condition).__name__
    if name in ("And", "Or"):
        operands = sorted(condition.args, key=str)
        return Logical(name.lower(), tuple(condition_node(c, arrange) for c in operands))
    if name == "Not":
        return Logical("not", (condition_node(condition.args[0], arrange),))
    left, right = (arrange(side) for side in condition.args)
    operator = _RELATIONS[name]
    if isinstance(left, Number) and not isinstance(right, Number):
        return Relation(right, _MIRRORED[operator], left)
    return Relation(left, operator, right)
