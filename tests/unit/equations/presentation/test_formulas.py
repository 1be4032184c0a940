"""Symbols of the theory beside the names of a model, and total derivatives."""

from __future__ import annotations

import pytest
import symengine as se

import lagcli
from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.presentation.formulas import FORCE, Signs, coefficients, law, total_rate
from lagcli.equations.typesetting.nodes import Sum

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
    assert [term for _, term in right.terms] == [FORCE, Signs(made).reaction]


def test_without_constraints_the_law_has_no_reactions() -> None:
    free = lagcli.load_text("coordinates: [x]\nT: x'^2\ninitial: {x: 0, x': 0}\n")
    assert law(free)[1] is FORCE
    assert coefficients(derive(free)) == {}
