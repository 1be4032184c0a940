"""Steps by which sums are shortened: trigonometric identities, factors, groups of terms."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest
import symengine as se

from lagcli.equations.simplification.factors import (
    common_part,
    divide,
    groups,
    pairs,
    presentable_content,
    square_root,
)
from lagcli.equations.simplification.monomials import MonomialExpansion, Polynomial, shorten
from lagcli.model.expression.grammar import parse
from lagcli.model.loader import load_text
from lagcli.model.names.building import build
from lagcli.model.names.scope import Scope

MODEL = load_text(
    "coordinates: [a, b]\nparameters: {m: 1, M: 2, l: 1}\nT: M*l^2*a'^2/2 + m*b'^2/2\n"
    "initial: {a: 0, a': 0, b: 0, b': 0}\n"
)


def expansion() -> MonomialExpansion:
    return MonomialExpansion(MODEL, ("m", "M", "l"))


def expression(text: str) -> se.Basic:
    return build(parse(text), Scope(MODEL.names, "it")).value


def value(terms: Polynomial, made_of: MonomialExpansion, at: dict[str, float]) -> float:
    total = 0.0
    for monomial, coefficient in terms.items():
        factor = float(coefficient)
        for index, exponent in monomial:
            g = made_of.generators[index]
            if g.head == "symbol":
                base = at[g.name]
            else:
                angle = g.arguments[0].subs(at)
                base = float(getattr(se, g.name)(angle).n(real=True))
            factor *= base**exponent
        total += factor
    return total


@pytest.mark.parametrize(
    ("text", "terms"),
    [
        ("m*sin(a)^2 + m*cos(a)^2", 1),
        ("3*m*sin(a)^2 + m*cos(a)^2", 2),
        ("m - m*sin(a)^2", 1),
        ("cos(a)*cos(b) + sin(a)*sin(b)", 1),
        ("cos(a)*cos(b) - sin(a)*sin(b)", 1),
        ("sin(a)*sin(b) - cos(a)*cos(b)", 1),
        ("sin(a)*cos(b) + cos(a)*sin(b)", 1),
        ("sin(a)*cos(b) - cos(a)*sin(b)", 1),
        ("cos(a)*sin(b) - sin(a)*cos(b)", 1),
        ("l*sin(2*a)*cos(b) - l*cos(2*a)*sin(b)", 1),
        ("2*cos(a)*cos(b) + sin(a)*sin(b)", 2),  # not an identity
        ("sin(a)^2 - cos(a)^2", 2),
    ],
)
def test_identities_keep_the_value(text: str, terms: int) -> None:
    made_of = expansion()
    before = made_of.polynomial(expression(text))
    after = shorten(before, made_of)
    assert len(after) == terms
    source = random.Random(5)
    for _ in range(3):
        at = {name: source.uniform(0.2, 2.0) for name in ("a", "b", "m", "l")}
        assert value(after, made_of, at) == pytest.approx(value(before, made_of, at), abs=1e-14)


def test_perfect_squares_are_found_and_nothing_else() -> None:
    made_of = expansion()

    def root(text: str) -> Polynomial | None:
        return square_root(made_of.polynomial(expression(text)))

    found = root("4*a^2 - 4*a*b + b^2")
    assert found is not None
    assert {abs(c) for c in found.values()} == {1, 2}
    assert len({c > 0 for c in found.values()}) == 2
    assert root("a^2 + a*b + b^2") is None
    assert root("2*a^2 + 4*a*b + 2*b^2") is None  # its root is irrational
    assert root("4*a^2 - 4*a*b - b^2") is None


def test_common_factors() -> None:
    x2y, xy3, over = ((0, 2), (1, 1)), ((0, 1), (1, 3)), ((0, 1), (1, -1))
    assert common_part([x2y, xy3]) == ((0, 1), (1, 1))
    assert common_part([x2y, over]) == ((0, 1), (1, -1))  # of denominators too
    assert common_part([x2y, ()]) == ()
    assert divide(x2y, ((0, 1), (1, -1))) == ((0, 1), (1, 2))


@pytest.mark.parametrize(
    ("numbers", "style", "content"),
    [
        ([6, -6], "decimal", 6),
        ([12, 18], "whole", 6),
        ([12, 18], "decimal", 1),
        ([Fraction(589, 10000), Fraction(-76, 10000)], "shortest", 1),  # 0.0589 x − 0.0076 y
    ],
)
def test_numbers_taken_out_of_a_sum(numbers, style, content) -> None:
    assert presentable_content(numbers, style) == content


def test_terms_of_the_same_motion_share_their_parameters() -> None:
    # m l² a' + M l² a' is (m l² + M l²) · a'
    made_of = expansion()
    (group,) = groups(made_of.polynomial(expression("m*l^2*a' + M*l^2*a'")), made_of)
    assert (len(group.parameters), len(group.rest)) == (2, 1)
    two = groups(made_of.polynomial(expression("m*a' + M*b'")), made_of)
    assert [(len(g.parameters), len(g.rest)) for g in two] == [(1, 1), (1, 1)]


def test_functions_of_position_are_paired_with_what_moves() -> None:
    made_of = expansion()
    (pair,) = pairs(made_of.polynomial(expression("sin(a)*a'^2 + sin(a)*b'^2")), made_of)
    assert (len(pair.functions), len(pair.motion), pair.motion_class) == (1, 2, 1)
    (still,) = pairs(made_of.polynomial(expression("cos(a)")), made_of)
    assert still.motion_class == 2
