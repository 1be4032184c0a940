"""Substitution in formulas, and arrangement of differentiated constraints."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from lagcli.equations.typesetting.nodes import (
    Call,
    Node,
    Number,
    Power,
    Product,
    Quotient,
    Root,
    Sum,
    Symbol,
    VirtualDisplacement,
    children,
    product_of,
    quotient_of,
    rebuilt,
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
    except _Rearranged:
        return None


class _Rearranged(Exception):
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
                    raise _Rearranged
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


def displaced(node: Node) -> Node | None:
    """Return a formula with δq instead of q̇, each at the end of its product.

    Returns None if a fraction or a root contains a velocity.
    """
    if isinstance(node, Symbol):
        moved = node.dots == 1 and node.kind == "name"
        return VirtualDisplacement(Symbol(node.name)) if moved else node
    if isinstance(node, Quotient | Root):
        return None if _moves(node) else node
    parts: list[Node | None] = [displaced(x) for x in children(node)]
    if None in parts:
        return None
    changed = iter(x for x in parts if x is not None)
    whole = rebuilt(node, lambda _: next(changed))
    if isinstance(whole, Product):
        whole = Product(tuple(sorted(whole.factors, key=_displaces)))
    return whole


def _moves(node: Node) -> bool:
    return (isinstance(node, Symbol) and node.dots > 0) or any(map(_moves, children(node)))


def _displaces(node: Node) -> bool:
    return isinstance(node, VirtualDisplacement) or any(map(_displaces, children(node)))


def differences(nodes: Iterable[Node]) -> frozenset[Node]:
    """Return the differences a − b in formulas."""
    sums: set[Node] = set()
    stack = list(nodes)
    while stack:
        node = stack.pop()
        if _is_difference(node):
            sums.add(node)
        stack.extend(children(node))
    return frozenset(sums)


def oriented(node: Node, written: frozenset[Node]) -> Node:
    """Return a formula whose products contain differences in their original order.

    (x₁ − x₂) (ẋ₁ − ẋ₂) becomes (x₂ − x₁) (ẋ₂ − ẋ₁) if the model contains x₂ − x₁.
    """
    if not written:
        return node
    node = rebuilt(node, lambda x: oriented(x, written))
    if isinstance(node, Power) and _is_even(node.exponent) and _is_difference(node.base):
        opposite = _turned(node.base)
        return Power(opposite, node.exponent) if _at_rest(opposite) in written else node
    if not isinstance(node, Product):
        return node
    factors = list(node.factors)
    turned = [i for i, x in enumerate(factors) if _is_difference(x) and _turned(x) in written]
    others = [
        i
        for i, x in enumerate(factors)
        if _is_difference(x) and i not in turned and x not in written
    ]
    for pair in zip(turned, others, strict=False):
        for i in pair:
            factors[i] = _turned(factors[i])
    return Product(tuple(factors))


def _is_even(exponent: Node) -> bool:
    return isinstance(exponent, Number) and exponent.value % 2 == 0


def _at_rest(node: Node) -> Node:
    """Return a formula with coordinates instead of their velocities."""
    if isinstance(node, Symbol):
        return Symbol(node.name, 0, node.kind)
    return rebuilt(node, _at_rest)


def _is_difference(node: Node) -> bool:
    return isinstance(node, Sum) and [sign for sign, _ in node.terms] == [1, -1]


def _turned(node: Node) -> Node:
    assert isinstance(node, Sum)
    return Sum(tuple((-sign, term) for sign, term in reversed(node.terms)))
