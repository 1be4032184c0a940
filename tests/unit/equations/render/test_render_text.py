"""The derivation as text: names, numbers, widths, alignment."""

from __future__ import annotations

import unicodedata
from fractions import Fraction

import pytest
from formula_values import MODELS, equations_of, model_of

from lagcli.equations.presentation import typeset as t
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.presentation.overview import overview
from lagcli.equations.presentation.steps import steps as derivation
from lagcli.equations.render import render
from lagcli.equations.render.breaking import Break, lines
from lagcli.equations.render.formula_text import TextFormula
from lagcli.equations.render.names import Notation, display_width
from lagcli.equations.render.numbers import written_decimals
from lagcli.equations.render.text import render_text
from lagcli.equations.simplification.arrange import Arranger
from lagcli.errors import UsageError


@pytest.mark.parametrize(
    ("name", "dots", "shown"),
    [
        ("phi", 0, "φ"),
        ("phi", 1, "φ̇"),
        ("Phi", 2, "Φ̈"),
        ("psi_1", 0, "ψ₁"),
        ("theta0", 1, "θ̇₀"),
        ("x_A", 1, "ẋ_A"),
        ("x_1", 2, "ẍ₁"),
        ("y1", 0, "y₁"),
        ("x12", 0, "x₁₂"),
        ("xl", 1, "xl'"),
        ("rr", 2, "rr''"),
        ("rod_12", 0, "rod₁₂"),
        ("a_b_c", 0, "a_b_c"),
        ("ψ", 1, "ψ̇"),
        ("alpha_max", 0, "α_max"),
    ],
)
def test_names(name, dots, shown):
    names = Notation(model_of(f"{name} z", f"m/2*({name}'^2 + z'^2)").model)
    assert names.text(name, dots) == unicodedata.normalize("NFC", shown)


def test_names_that_would_look_the_same_are_written_raw():
    names = Notation(model_of("y1 y_1 x", "m/2*(y1'^2 + y_1'^2 + x'^2)").model)
    assert [names.text(n) for n in ("y1", "y_1", "x")] == ["y1", "y_1", "x"]


def test_marks_take_no_columns():
    assert display_width("φ̈ + ẋ") == 5
    assert display_width("曲柄") == 4


@pytest.mark.parametrize(
    ("expression", "shown"),
    [
        ("m*x/2", "½ m x"),
        ("2*m*x/5", "⅖ m x"),
        ("0.1*m*x", "0.1 m x"),
        ("0.05*m*x", "0.05 m x"),
        ("m*x/24", "¹⁄₂₄ m x"),
        ("1.5*m*x", "³⁄₂ m x"),
        ("m*x*(1 - l)", "m (1 − l) x"),
        ("m*sqrt(x^2 + 1)^3", "m (1 + x²)^(3/2)"),
        ("m/(x*l)", "m/(l x)"),
        ("0.70446630527558*m*x", "0.704466 m x"),
        ("-0.70446630527558/3*m*x", "−0.234822 m x"),
        ("1234567*m*x", "1234567 m x"),
        ("1.2345678e-9*m*x", "1.23457×10⁻⁹ m x"),
    ],
)
def test_numbers(expression, shown):
    equations = model_of("x", "m/2*x'^2", f"{expression}")
    formula = TextFormula(Notation(equations.model), written_decimals(equations.model))
    assert formula.text(Arranger(equations.model).arrange(equations.potential)) == shown


def test_fifths_are_decimals_where_the_author_wrote_them():
    for text, shown in (("-0.2*m*x", "−0.2 m x"), ("-m*x/5", "−⅕ m x")):
        equations = model_of("x", "m/2*x'^2", text)
        formula = TextFormula(Notation(equations.model), written_decimals(equations.model))
        assert formula.text(Arranger(equations.model).arrange(equations.potential)) == shown


def test_brackets_alternate():
    x, y, z, w = (t.Symbol(n) for n in "xyzw")
    inner = t.Product((x, t.Sum(((1, y), (1, z)))))
    middle = t.Product((w, t.Sum(((1, x), (-1, inner)))))
    outer = t.Product((y, t.Sum(((1, z), (1, middle)))))
    formula = TextFormula(Notation(model_of("x y z w", "m/2*x'^2").model))
    assert formula.text(outer) == "y {z + w [x − x (y + z)]}"


@pytest.mark.parametrize("path", MODELS, ids=lambda p: p.stem)
@pytest.mark.parametrize("numeric", [False, True], ids=["symbols", "numbers"])
def test_lines_fit(path, numeric):
    f = Formulas(equations_of(path), numeric)
    formula = TextFormula(Notation(f.model), numeric=numeric)
    for shown in (overview(f), derivation(f)):
        for width in (40, 60, 80, 100, 120):
            text = render_text(f.model, shown, formula, width, numbered=True)
            assert text.endswith("\n")
            assert not text.endswith("\n\n")
            for line in text.splitlines():
                assert display_width(line) <= width, line
                assert line == line.rstrip()


def test_breaking_loses_nothing():
    pieces = ["aa", Break(0), "+ b [c", Break(1), "+ dddd", Break(1), "− e] f", Break(0), "+ gg"]
    whole = "".join(x.space if isinstance(x, Break) else x for x in pieces)
    for width in range(7, 40):
        found = lines(pieces, len, width, width - 2)
        assert " ".join(found) == whole
        assert len(found[0]) <= width
        assert all(len(x) <= max(width - 2, 6) for x in found[1:])


def test_a_break_outside_brackets_is_preferred():
    pieces = ["aaaaaaa", Break(0), "+ b [c", Break(1), "+ dddd]"]
    assert lines(pieces, len, 16, 16) == ["aaaaaaa", "+ b [c + dddd]"]


def test_lines_of_a_group_are_aligned():
    text = render(equations_of(next(p for p in MODELS if p.stem == "heavy_top")), "text", True)
    block = text.split("Partial derivatives with respect to the coordinates\n")[1].split("\n\n")[0]
    columns = {line.index("=") for line in block.splitlines() if line.startswith("  ∂")}
    assert len(columns) == 1


def test_parameters_by_value():
    equations = model_of("x", "m/2*x'^2", "m*g*x*sin(l)", parameters="m g l")
    text = render(equations, numeric=True)
    # m = 1.3, g = 1.4, l = 1.5; sin(1.5) = 0.997495
    assert "x:  1.3 ẍ + 1.81544 = 0" in text


def test_an_integrable_velocity_constraint_is_reported():
    def kinds(constraint: str) -> str:
        rest = {"constraints": f'  c: "{constraint}"'}
        return render(model_of("x y z", "m/2*(x'^2 + y'^2 + z'^2)", **rest))

    assert "nonholonomic in form, but integrable" in kinds("y*x' + x*y' = 0")
    assert "nonholonomic in form, but integrable" in kinds("cos(y)*x' - x*sin(y)*y' + t*0 = 2")
    assert "nonholonomic in form, but integrable" in kinds("z*y*x' + z*x*y' + exp(z)*z' = 0")
    for factor in ("1", "exp(x*z)"):  # an integrating factor changes nothing
        product = f"({factor})*(y*z*x' + x*z*y' + x*y*z') = 0"
        assert "nonholonomic in form, but integrable" in kinds(product)
    assert "but integrable" not in kinds("z*x' = y'")
    assert "but integrable" not in kinds("x' + y*sin(t) = 0")


def test_a_model_without_constraints():
    text = render(model_of("x", "m/2*x'^2"), steps=True)
    assert "m ẍ = 0" in text
    assert "λ" not in text


def test_energies_give_way_to_names_of_the_model():
    text = render(model_of("x", "L*x'^2/2", parameters="L T"), steps=True)
    assert "ℒ = 𝒯 − V" in text
    assert "𝒯 = ½ L ẋ²" in text


def test_wrong_arguments():
    equations = model_of("x", "m/2*x'^2")
    with pytest.raises(UsageError, match="40 or more"):
        render(equations, width=39)
    with pytest.raises(UsageError, match="latex"):
        render(equations, "pdf")


def test_multipliers_carry_names_where_there_are_several():
    formula = TextFormula(Notation(equations_of(MODELS[0]).model))
    assert formula.text(t.Symbol("p3_x", kind="multiplier")) == "λ_p3_x"


def test_number_signs():
    formula = TextFormula(Notation(model_of("x", "m/2*x'^2").model), numeric=True)
    assert formula.number(Fraction("0.000012345678")) == "1.23457×10⁻⁵"
    assert formula.number(Fraction(1, 3)) == "0.333333"
    assert formula.number(Fraction(-3)) == "−3"
