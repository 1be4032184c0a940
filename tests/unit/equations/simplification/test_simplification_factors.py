"""Fractions, tangents, squares of differences, and prescribed motions, as a person writes them."""

from __future__ import annotations

import re

import pytest
import symengine as se
from formula_values import MODELS, equations_of, model_of

from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.render import render
from lagcli.equations.simplification.arrange import Arranger
from lagcli.equations.simplification.factors import ordered, oriented
from lagcli.equations.typesetting.nodes import (
    Call,
    Sum,
    Symbol,
    equal_except_for_order,
    product_of,
    sum_of,
)
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.text import TextFormula
from lagcli.model.loader import load_text

MODEL = model_of("x y", "m/2*(x'^2 + y'^2)")
X, Y = MODEL.q
U, V = MODEL.v
M, L = se.symbols("m l")


@pytest.mark.parametrize(
    ("expression", "shown"),
    [
        (M * X * (se.sqrt(X**2 + Y**2) - L) / Y, "m x [√(x² + y²) − l]/y"),
        (se.sin(X) * L / se.cos(X), "l tan x"),
        (se.sin(X) ** 3 / se.cos(X) ** 2, "sin x tan² x"),
        (se.sin(X) / se.cos(Y), "sin(x)/(cos y)"),
        (M * U + L * U / Y**2, "m ẋ + l ẋ/y²"),
        (M * U + L * U / M**2, "(m + l/m²) ẋ"),
        (-X / Y - 1 / Y, "−(1 + x)/y"),
        (X * U * U - 2 * X * U * V + X * V * V + M * U, "x (ẋ − ẏ)² + m ẋ"),
    ],
)
def test_expressions(expression, shown):
    text = TextFormula(Notation(MODEL.model)).text
    assert text(Arranger(MODEL.model).arrange(expression)) == shown


def page(name: str, **rest) -> str:
    return render(equations_of(next(p for p in MODELS if p.stem == name)), width=120, **rest)


def test_squares_of_differences_in_accelerations():
    text = page("double_pendulum_cartesian", steps=True)
    assert "(y₂ − y₁) (ÿ₂ − ÿ₁) + (ẋ₂ − ẋ₁)² + (ẏ₂ − ẏ₁)²] = 0" in text


def test_prescribed_motions_have_their_names():
    text = page("car_axis", steps=True)
    assert "x_b δx_l + y_b δy_l = 0" in text
    assert text.count("sin(w t)") == 1, "in its definition alone"
    inputs = load_text(
        "coordinates: [x]\nparameters: {A: 1, w: 2}\ndefinitions: {u: 'A*sin(w*t)', half: t/2}\n"
        "T: x'^2/2\nV: x*A^2*sin(w*t)^2\ninitial: {x: 0, x': 0}\n"
    )
    e = derive(inputs)
    text = TextFormula(Notation(inputs)).text
    assert text(Formulas(e).arrange(e.potential)) == "x u²"
    assert text(Formulas(e, numeric=True).arrange(e.potential)) == "x sin²(2 t)"


def test_formulas_that_differ_in_order_only_are_not_repeated():
    a, b = Symbol("a"), Call("sin", (Symbol("b"),))
    assert equal_except_for_order(
        sum_of([(1, a), (-1, product_of([a, b]))]), sum_of([(-1, product_of([b, a])), (1, a)])
    )
    assert not equal_except_for_order(sum_of([(1, a), (-1, b)]), sum_of([(-1, a), (1, b)]))
    text = page("chaplygin_sleigh", steps=True)
    assert text.count("½ m [(ẋ − a θ̇ sin θ)² + (ẏ + a θ̇ cos θ)²]") == 2  # T and L


def test_the_determinant_is_one_product():
    from lagcli.simulations.partition import partition

    e = equations_of(next(p for p in MODELS if p.stem == "parallelogram"))
    text = render(e, steps=True, partition=partition(e))
    assert "det b       = −l² d sin(α₂ − β) sin α₃" in text


def test_long_closed_forms_are_omitted():
    from lagcli.simulations.partition import partition

    for name, shown in (("double_pendulum_cartesian", False), ("slider_crank", True)):
        e = equations_of(next(p for p in MODELS if p.stem == name))
        text = render(e, solve=True, partition=partition(e))
        assert ("The closed form is omitted: it is long" in " ".join(text.split())) is not shown


def test_parameters_with_values_units_and_meaning():
    text = page("woodpecker")
    assert "  m_S = 4.5 g = 0.0045 kg   mass of the bird\n" in text
    assert re.search(r"  J_M = 5×10⁻⁹ kg·m² +J_S = 7×10⁻⁷ kg·m²", text)
    assert "m_S = 0.0045 kg" in page("woodpecker", numeric=True)
    latex = page("woodpecker", format="latex")
    assert r"$J_{M} = 5 \times 10^{-9} \, \mathrm{kg} \cdot \mathrm{m}^{2}$;" in latex
    assert r"$\mu = 0.3$ (coefficient of friction);" in latex
    assert "$e = 0.5$ (restitution of the beak);" in page("woodpecker", format="markdown")
    steps = page("chain", steps=True)
    assert "mᵢ = 0.05 kg                 i = 1, …, N" in steps
    assert steps.index("1. Coordinates: k = 40") < steps.index("2. Parameters")


def test_many_parameters_are_in_columns_after_the_equations():
    e = equations_of(next(p for p in MODELS if p.stem == "andrews_squeezer"))
    for width in (60, 80, 120):
        text = render(e, width=width)
        assert text.index("Equations of motion") < text.index("Parameters")
        assert text.index("Parameters") < text.index("Sign convention")
        listed = text.split("Parameters\n")[1].split("\n\n")[0].splitlines()
        assert max(map(len, listed)) <= width
        # a value begins below a value, and each parameter is listed once
        rows = [x for x in listed if x.count("=") == listed[0].count("=")]
        places = {tuple(i for i, c in enumerate(x) if c == "=") for x in rows}
        assert len(places) == 1
        assert sum(x.count("=") for x in listed) == len(e.model.parameters)
    assert len(render(e, width=120).splitlines()) < len(render(e, width=60).splitlines())


def test_differences_with_and_without_a_square_are_treated_alike():
    disk = load_text(
        "coordinates: [x, y]\nparameters: {X: 0.2, R: 0.3}\nT: (x'^2 + y'^2)/2\n"
        "constraints: {rim: (x - X)^2 + (y - R)^2 = R^2}\n"
        "initial: {x: 0.2, y: 0, x': 0, y': 0}\n"
    )
    text = render(derive(disk), steps=True)
    assert "2 [(x − X) ẍ + (y − R) ÿ + ẋ² + ẏ²] = 0" in text


def test_unilateral_constraints_stay_inequalities_in_the_derivation():
    text = " ".join(page("rocking_block", steps=True).split())
    assert "left: y_L ≥ 0 unilateral, scleronomic" in text
    assert "left: δy + (h sin φ − b cos φ) δφ ≥ 0" in text
    assert "They hold while a contact is closed and while friction sticks." in text


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
