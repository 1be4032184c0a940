"""Values of formulas for comparison, with expanded indexed sums and independent of arrangement."""

from __future__ import annotations

import re
from collections.abc import Mapping

import symengine as se
from symengine import Basic

from lagcli.equations.presentation.typeset import (
    Call,
    IndexedSum,
    Node,
    Number,
    Power,
    Product,
    Quotient,
    Root,
    Sum,
    Symbol,
)

#: Matches the indices of a member: j, N−1, 3.
_INDICES = re.compile(r"\[([^\]]*)\]")
_INDEX = re.compile(r"([A-Za-z]\w*)(?:([+−-])(\d+))?")


class NotCompared(ValueError):
    """A formula contains a part that cannot be compared."""


def are_equal(one: Node, two: Node, numbers: Mapping[str, int]) -> bool:
    """Return whether two formulas are known to be equal; see `formula_value`."""
    try:
        return bool(se.expand(formula_value(one, numbers) - formula_value(two, numbers)) == 0)
    except NotCompared:
        return False


def formula_value(node: Node, numbers: Mapping[str, int]) -> Basic:
    """Return a formula as an expression.

    Parameters
    ----------
    node : Node
    numbers : mapping of str to int
        Numbers of members by name, and the index if it has a value: N = 10, i = 3.

    Raises
    ------
    NotCompared
        The formula contains more than sums, products, powers and functions of names.
    """

    def value(inner: Node) -> Basic:
        return formula_value(inner, numbers)

    match node:
        case Number():
            return se.Rational(node.value.numerator, node.value.denominator)
        case Symbol():
            if node.name in numbers and not node.dots:
                return se.Integer(numbers[node.name])
            indexed = _INDICES.sub(lambda m: f"[{_written(m[1], numbers)}]", node.name)
            return se.Symbol(f"{node.kind} {indexed} {node.dots}")
        case Sum():
            return se.Add(*(sign * value(term) for sign, term in node.terms))
        case Product():
            return se.Mul(*map(value, node.factors))
        case Quotient():
            return value(node.numerator) / value(node.denominator)
        case Power():
            return value(node.base) ** value(node.exponent)
        case Root():
            return value(node.radicand) ** se.Rational(1, node.degree)
        case Call():
            return se.Function(node.function)(*map(value, node.arguments))
        case IndexedSum():
            first, last = _whole(value(node.first)), _whole(value(node.last))
            terms = (
                formula_value(node.term, {**numbers, node.index: at})
                for at in range(first, last + 1)
            )
            return se.Add(se.Integer(0), *terms)
    raise NotCompared(type(node).__name__)


def _whole(value: Basic) -> int:
    if not isinstance(value, se.Integer):
        raise NotCompared("a bound without a value")
    return int(value)


def _written(indices: str, numbers: Mapping[str, int]) -> str:
    """Return indices with values substituted."""
    return ",".join(_index(text, numbers) for text in indices.split(","))


def _index(text: str, numbers: Mapping[str, int]) -> str:
    found = _INDEX.fullmatch(text)
    if found is None or found[1] not in numbers:
        return text
    offset = int(found[3] or 0)
    return str(numbers[found[1]] + (offset if found[2] == "+" else -offset))
