"""Sums over one range are one sum."""

from __future__ import annotations

from lagcli.equations.presentation.families.indexed_sums import merged
from lagcli.equations.presentation.typeset import (
    IndexedSum,
    Node,
    Sum,
    Symbol,
    product_of,
    sum_of,
    whole,
)

A, X, Y = Symbol("a"), Symbol("x[j]"), Symbol("y[j]")


def over(term: Node, last: int = 5) -> IndexedSum:
    return IndexedSum(term, "j", whole(1), whole(last))


def test_sums_over_one_range_are_joined_with_common_factors_in_front() -> None:
    terms = [(1, over(product_of([A, X]))), (-1, over(product_of([A, Y])))]
    inside = product_of([A, sum_of([(1, X), (-1, Y)])])
    assert merged(terms) == [(1, over(inside))]
    assert merged([(-s, x) for s, x in terms]) == [(-1, over(inside))]


def test_other_ranges_and_factors_stay() -> None:
    terms = [(1, over(X)), (1, over(Y, 6)), (1, product_of([A, over(Y)])), (1, A)]
    assert merged(terms) == terms


def test_a_number_stands_before_a_sum_and_a_term_that_have_it() -> None:
    three = whole(3)
    terms = [(1, product_of([three, A])), (-1, product_of([three, over(X)]))]
    ((sign, product),) = merged(terms)
    assert sign == 1
    assert product == product_of([three, Sum(((1, A), (-1, over(X))))])
    assert merged([(1, product_of([three, A])), (1, product_of([three, X]))]) == [
        (1, product_of([three, A])),
        (1, product_of([three, X])),
    ]
