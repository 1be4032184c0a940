"""Sums of arranged terms: order, leading sign, common number."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from lagcli.equations.presentation.typeset import (
    Node,
    Number,
    Product,
    Sum,
    forward,
    product_of,
    signed,
    sum_of,
)
from lagcli.equations.simplification.factors import presentable_content

Key = tuple[object, ...]


def ordered(terms: Iterable[tuple[Key, Node]], follows: bool = False) -> Node:
    """Return a sorted sum.

    Parameters
    ----------
    terms : iterable of (key, node)
        The terms with their sort keys, whose first entry is the class of a term.
    follows : bool
        Whether the sum follows other terms. If not, a leading class with a positive term starts
        with it: b − a, not −a + b.
    """
    found = _sorted(terms)
    if found and found[0][1] < 0 and not follows:
        kind = found[0][0][0]
        for i, (key, sign, _) in enumerate(found):
            if sign > 0 and (key[0] == kind or kind != 0):
                found.insert(0, found.pop(i))
                break
    return sum_of((sign, term) for _, sign, term in found)


def oriented(terms: Iterable[tuple[Key, Node]]) -> tuple[int, Node]:
    """Return ±1 and ±sum, so that the first term is positive.

    The order does not depend on signs: sums that differ only in signs are arranged equally.
    """
    return forward(sum_of((sign, term) for _, sign, term in _sorted(terms)))


def _sorted(terms: Iterable[tuple[Key, Node]]) -> list[tuple[Key, int, Node]]:
    """Return the terms of a sum in order, with nested sums flattened."""
    return [
        (key, sign, term)
        for key, node in sorted(terms, key=lambda t: t[0])
        for sign, term in (node.terms if isinstance(node, Sum) else (signed(node),))
    ]


def without_content(node: Node) -> tuple[Fraction, Node]:
    """Factor a number out of a sum if all terms share it."""
    if not isinstance(node, Sum):
        return Fraction(1), node
    numbers = []
    for _, term in node.terms:
        first = term.factors[0] if isinstance(term, Product) else term
        numbers.append(first.value if isinstance(first, Number) else Fraction(1))
    content = presentable_content(numbers, "whole")
    if content == 1:
        return content, node
    scale = Number(1 / content)
    return content, sum_of((sign, product_of([scale, term])) for sign, term in node.terms)
