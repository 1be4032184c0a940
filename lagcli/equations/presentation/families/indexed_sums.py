"""Sums with an index that are written as one, and common factors of their terms."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lagcli.equations.presentation.typeset import (
    IndexedSum,
    Node,
    Number,
    Product,
    Sum,
    product_of,
    sum_of,
)

Term = tuple[int, Node]


def merged(terms: Sequence[Term]) -> list[Term]:
    """Return the terms of a sum with sums over the same range as one, and without common numbers.

    a Σ x_j + a Σ y_j becomes a Σ (x_j + y_j), and 2 x + 2 Σ y_j becomes 2 (x + Σ y_j).
    """
    alike: dict[object, list[int]] = {}
    for i, (_, term) in enumerate(terms):
        before, last = _split(term)
        key: object = i
        if isinstance(last, IndexedSum):
            key = before, last.index, last.first, last.last
        alike.setdefault(key, []).append(i)
    return _without_numbers([_joined([terms[i] for i in found]) for found in alike.values()])


def _split(term: Node) -> tuple[tuple[Node, ...], Node]:
    """Return the factors of a term before the last, and the last."""
    factors = term.factors if isinstance(term, Product) else (term,)
    return factors[:-1], factors[-1]


def _joined(terms: Sequence[Term]) -> Term:
    """Return sums over one range with the same factors as one sum."""
    (sign, first), *others = terms
    before, last = _split(first)
    if not others or not isinstance(last, IndexedSum):
        return sign, first
    inner = []
    for s, term in terms:
        whole = _split(term)[1]
        if isinstance(whole, IndexedSum):
            inner.append((s * sign, whole.term))
    joined = IndexedSum(_factored(inner), last.index, last.first, last.last)
    return sign, product_of([*before, joined])


def _factored(terms: Sequence[Term]) -> Node:
    """Return a sum with the factors in front that all terms have."""
    listed = [x.factors if isinstance(x, Product) else (x,) for _, x in terms]
    common = [x for x in listed[0] if all(x in others for others in listed[1:])]
    rest = [(s, _without(x, common)) for (s, _), x in zip(terms, listed, strict=True)]
    return product_of([*common, sum_of(rest)])


def _without(factors: Iterable[Node], common: Iterable[Node]) -> Node:
    left = list(factors)
    for x in common:
        left.remove(x)
    return product_of(left)


def _without_numbers(terms: list[Term]) -> list[Term]:
    """Return the terms with a number in front of a Σ and of other terms that have it."""
    found: list[Term] = []
    used: set[int] = set()
    for i, (sign, term) in enumerate(terms):
        number = _number(term)
        same = [j for j in range(i, len(terms)) if number and _number(terms[j][1]) == number]
        same = [j for j in same if j not in used]
        if i in used:
            continue
        if number is None or len(same) < 2 or not any(_sums(terms[j][1]) for j in same):
            found.append((sign, term))
            continue
        used.update(same)
        inside = [(sign * terms[j][0], product_of(_factors(terms[j][1])[1:])) for j in same]
        found.append((sign, Product((number, Sum(tuple(inside))))))
    return found


def _factors(term: Node) -> tuple[Node, ...]:
    return term.factors if isinstance(term, Product) else (term,)


def _number(term: Node) -> Number | None:
    """Return the number in front of a product."""
    first = _factors(term)[0]
    return first if isinstance(first, Number) and isinstance(term, Product) else None


def _sums(term: Node) -> bool:
    return isinstance(_factors(term)[-1], IndexedSum)
