"""Symbols of the theory beside the names of a model, and total derivatives."""

from __future__ import annotations

import random

import pytest
import symengine as se
from random_cases import FUZZ_COUNT

import lagcli
from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.presentation.formulas import (
    Formulas,
    Signs,
    coefficients,
    law,
    total_rate,
)
from lagcli.equations.presentation.terms import equation_terms, term_expressions
from lagcli.equations.typesetting.nodes import Sum
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.text import TextFormula
from lagcli.errors import LagcliError
from lagcli.model.loader import load_text

HOOP = """
coordinates: [{names}]
parameters: {{{parameters}}}
T: 1/2*({first}'^2 + y'^2)
constraints: {constraints}
initial: {{{first}: 1, y: 0, {first}': 0, y': 0}}
"""


def model(first: str = "x", parameters: str = "l: 1", constraints: str = "{rod: x^2 + y^2 = l^2}"):
    names = f"{first}, y"
    text = HOOP.format(names=names, first=first, parameters=parameters, constraints=constraints)
    return lagcli.load_text(text)


def test_symbols_give_way_to_the_names_of_the_model() -> None:
    plain = Signs(model())
    assert (plain.holonomic.text, plain.multiplier.text) == ("φ_β", "λ_β")
    assert (plain.kinetic.text, plain.coordinate_count) == ("T", "k")
    taken = Signs(model("phi", "k: 1, beta: 1, T: 1", "{rod: phi = 1}"))
    assert taken.holonomic.text == "f_α"
    assert taken.multiplier.text == "λ_α"
    assert taken.kinetic.text == "𝒯"
    assert taken.coordinate_count == "n"
    # the forcing is not the letter that constraints have already
    assert taken.forcing.text == "p"


def test_the_total_derivative_follows_the_motion() -> None:
    equations = derive(model())
    (x, y), (u, w), (a, b), t = equations.q, equations.v, equations.a, se.Symbol("t")
    found = total_rate(x * w + t**2 * u, equations)
    assert se.expand(found - (u * w + x * b + 2 * t * u + t**2 * a)) == 0
    assert y not in found.free_symbols


@pytest.mark.parametrize(
    ("constraints", "kinds"),
    [
        ("{rod: x^2 + y^2 = l^2}", ["holonomic"]),
        ("{skate: x' = y*y'}", ["nonholonomic"]),
        ("{rod: x^2 + y^2 = l^2, skate: x' = y*y'}", ["holonomic", "nonholonomic"]),
    ],
)
def test_the_law_has_forces_of_the_constraints_that_there_are(
    constraints: str, kinds: list[str]
) -> None:
    made = model(constraints=constraints)
    assert list(coefficients(derive(made))) == kinds
    _, right = law(made)
    assert isinstance(right, Sum)
    assert [term for _, term in right.terms] == [Signs(made).force, Signs(made).reaction]


def test_without_constraints_the_law_has_no_reactions() -> None:
    free = lagcli.load_text("coordinates: [x]\nT: x'^2\ninitial: {x: 0, x': 0}\n")
    assert law(free)[1] == Signs(free).force
    assert coefficients(derive(free)) == {}


def test_multipliers_with_equal_long_factors_are_collected() -> None:
    text = """\
coordinates: [a, b]
parameters: {l: 1, d: 2}
T: a'^2/2 + b'^2/2
constraints:
  one: l*sin(a + b) + d*cos(a) = 1
  two: 1 - l*sin(a + b) - d*cos(a) = b
  three: l*sin(a + b) + d*cos(a) + b^2 = 0
  four: a = b
initial: {a: {guess: 1}, b: {guess: 1}, a': {guess: 0}, b': {guess: 0}}
"""
    f = Formulas(derive(load_text(text)))
    shown = TextFormula(Notation(f.model)).text(f.right_side(0))
    assert shown == "(λ_one − λ_two + λ_three) [l cos(a + b) − d sin a] + λ_four"


def test_collected_terms_have_the_values_of_the_multipliers_times_the_jacobian() -> None:
    assert sum(map(assert_collected, range(4))) > 1


@pytest.mark.fuzz
def test_collected_terms_of_many_systems() -> None:
    count = FUZZ_COUNT
    assert sum(map(assert_collected, range(count))) > count / 2


def assert_collected(seed: int) -> bool:
    """Compare right sides as printed with Q + Σ λ b, for constraints with common parts.

    Returns whether the random model is valid: parts may cancel.
    """
    draw = random.Random(seed)
    parts = ["l*sin(a + b)", "d*cos(a)*b", "sqrt(a^2 + b^2 + 3)", "a*b^2", "b", "c^2*a", "exp(c*b)"]
    sides = []
    for _ in range(draw.randint(3, 7)):
        terms = draw.sample(parts, draw.randint(1, 3))
        if sides and draw.random() < 0.6:
            terms = [f"({draw.choice(['-', '', '2*'])}({draw.choice(sides)}))", terms[0]]
        sides.append(" + ".join(terms))
    constraints = "\n".join(f"  r{k}: {side} = {k}" for k, side in enumerate(sides))
    text = f"""\
coordinates: [a, b, c]
parameters: {{l: 1.3, d: 0.7}}
T: (a'^2 + b'^2 + c'^2)/2
Q: {{a: 'd*a^2'}}
constraints:
{constraints}
initial: {{a: {{guess: 1}}, b: {{guess: 1}}, c: {{guess: 1}}, a': {{guess: 0}}, b': {{guess: 0}},
  c': {{guess: 0}}}}
"""
    try:
        e = derive(load_text(text))
    except LagcliError:
        return False
    f = Formulas(e)
    values = {x: draw.uniform(0.3, 1.5) for x in (*e.q, *e.v, *e.a, *e.multipliers)}
    values |= {se.Symbol(n): x for n, x in e.model.parameter_values.items()}
    for i in range(3):
        expected = float(e.applied_forces[i].subs(values))
        for symbol, c in zip(e.multipliers, e.constraints, strict=True):
            expected += float(values[symbol] * c.row.get(i, se.Integer(0)).subs(values))
        terms = [t for t in equation_terms(f.equation_line(i)) if t.side == 1]
        found = sum(float(x.subs(values)) for x in term_expressions(tuple(terms), e.model))
        assert found == pytest.approx(expected, rel=1e-12, abs=1e-12), text
    return True
