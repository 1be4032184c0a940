"""Substitution in display trees that preserves the structure of a formula."""

from __future__ import annotations

from collections.abc import Mapping

from lagcli.equations.presentation.typeset import (
    Call,
    Node,
    Number,
    Power,
    Product,
    Quotient,
    Root,
    Sum,
    children,
    product_of,
    quotient_of,
    sum_of,
)


def substituted(node: Node, values: Mapping[Node, Node]) -> Node | None:
    """Return a formula with some nodes replaced.

    Returns None if a factor would become a quotient next to other factors, because such products
    are better rearranged.

    Parameters
    ----------
    node : Node
        Replacement for sums, products, quotients, powers, roots, functions and symbols; other nodes
        are unchanged.
    values : mapping of Node to Node
    """
    try:
        return _replaced(node, values)
    except _ArrangedAnew:
        return None


class _ArrangedAnew(Exception):
    """Raised if a product would change its factors."""


def _replaced(node: Node, values: Mapping[Node, Node]) -> Node:
    if node in values:
        return values[node]

    def part(inner: Node) -> Node:
        return _replaced(inner, values)

    match node:
        case Sum():
            return sum_of((sign, part(term)) for sign, term in node.terms)
        case Product():
            for factor in node.factors:
                inner = factor.base if isinstance(factor, Power) else factor
                if inner in values and _has_quotient(values[inner]):
                    raise _ArrangedAnew
            return product_of(map(part, node.factors))
        case Quotient():
            return quotient_of(part(node.numerator), part(node.denominator))
        case Power():
            return _power(part(node.base), node.exponent)
        case Root():
            return Root(part(node.radicand), node.degree)
        case Call():
            return Call(node.function, tuple(map(part, node.arguments)))
    return node


def _has_quotient(node: Node) -> bool:
    return isinstance(node, Quotient) or any(map(_has_quotient, children(node)))


def _power(base: Node, exponent: Node) -> Node:
    """Return a power; numbers are evaluated, even powers lose the sign of the base."""
    if isinstance(exponent, Number) and exponent.value.denominator == 1:
        if isinstance(base, Number) and (base.value or exponent.value > 0):
            return Number(base.value ** int(exponent.value))
        negative = isinstance(base, Sum) and all(sign < 0 for sign, _ in base.terms)
        if exponent.value % 2 == 0 and negative:  # (−a)² is a²
            base = sum_of([(-1, base)])
    return Power(base, exponent)
