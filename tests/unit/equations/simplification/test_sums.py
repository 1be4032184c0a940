"""Sums of arranged terms."""

from __future__ import annotations

from lagcli.equations.presentation.typeset import Sum, Symbol, sum_of
from lagcli.equations.simplification.sums import ordered, oriented

A, B, C = (Symbol(x) for x in "abc")


def negative(node):
    return sum_of([(-1, node)])


def test_a_sum_begins_with_a_positive_term_of_its_class():
    assert ordered([((1,), negative(A)), ((1,), B)]) == Sum(((1, B), (-1, A)))
    assert ordered([((0,), negative(A)), ((1,), B)]) == Sum(((-1, A), (1, B)))


def test_a_sum_that_follows_other_terms_keeps_its_order():
    assert ordered([((1,), negative(A)), ((1,), B)], follows=True) == Sum(((-1, A), (1, B)))


def test_the_order_of_a_bracket_does_not_depend_on_signs():
    for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        terms = [((0,), sum_of([(signs[0], A)])), ((1,), sum_of([(signs[1], B)]))]
        sign, bracket = oriented(terms)
        assert sign == signs[0]
        assert bracket == Sum(((1, A), (signs[0] * signs[1], B)))


def test_the_terms_of_a_sum_within_a_sum_are_placed_one_by_one():
    inner = Sum(((-1, A), (-1, B)))
    assert ordered([((1,), inner), ((2,), C)]) == Sum(((1, C), (-1, A), (-1, B)))
