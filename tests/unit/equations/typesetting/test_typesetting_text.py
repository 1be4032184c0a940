"""The derivation as text: names, numbers, widths, alignment."""

from __future__ import annotations

import re
import unicodedata
from fractions import Fraction

import pytest
from formula_values import MODELS, equations_of, model_of, pages_of, steps_of
from random_cases import some
from shipped import PATHS, WRITTEN, every_model

from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.presentation.written import scope_of, written
from lagcli.equations.render import render
from lagcli.equations.simplification.arrange import Arranger
from lagcli.equations.typesetting import nodes as t
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.text import TextFormula, render_text
from lagcli.equations.typesetting.writer import Break, lines, written_decimals
from lagcli.errors import UsageError, display_width
from lagcli.model.expression.grammar import parse
from lagcli.model.loader import load_text
from lagcli.model.names.expansion import expand


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


def test_names_that_would_look_like_latin_letters_or_multipliers_are_written_raw():
    two = {"constraints": "  rod: x = 2*y\n  bar: y = 0"}
    parameters = "lambda_rod lambda_x Nu N Beta λ"
    names = Notation(model_of("x y", "x'^2 + y'^2", parameters=parameters, **two).model)
    shown = {name: names.text(name) for name in parameters.split()}
    assert shown == {
        "lambda_rod": "lambda_rod",
        "lambda_x": "λ_x",
        "Nu": "Nu",
        "N": "N",
        "Beta": "Β",
        "λ": "λ",
    }
    assert names.multiplier("rod") == "λ_rod"
    assert names.latex("lambda_rod") == r"\mathit{lambda\_rod}"
    assert names.latex("Nu", 1) == r"\dot{\mathit{Nu}}"
    assert names.mathml("lambda_rod")[1] == ""
    one = {"constraints": "  rod: x = 2*y"}
    alone = Notation(model_of("x y", "x'^2 + y'^2", parameters="λ", **one).model)
    assert alone.multiplier("rod") == "λ_rod"


def test_magnitudes_within_a_magnitude_have_a_name():
    """|a |b| − c| would be read as |a| b |−c|."""
    equations = model_of("x", "m/2*x'^2", "abs(m*abs(x) - l)")
    formula = TextFormula(Notation(equations.model), written_decimals(equations.model))
    assert formula.text(Arranger(equations.model).arrange(equations.potential)) == "abs(m |x| − l)"


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


@pytest.mark.parametrize("numeric", some([False, True], 1), ids=["symbols", "numbers"])
@pytest.mark.parametrize("name", every_model(few=WRITTEN))
def test_lines_fit(name, numeric):
    path = PATHS[name]
    model = equations_of(path).model
    formula = TextFormula(Notation(model), numeric=numeric)
    for shown in (steps_of(path, False, numeric), steps_of(path, True, numeric)):
        for width in (40, 80, 120):
            text = render_text(model, shown, formula, width, numbered=True)
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


def test_descriptions_of_coordinates_are_aligned():
    text = (
        "coordinates: {y1: {unit: m, description: height}, phi: {description: angle}, psi_lid: rad}"
        "\nT: y1'^2 + phi'^2 + psi_lid'^2\n"
        "initial: {y1: 0, phi: 0, psi_lid: 0, y1': 0, phi': 0, psi_lid': 0}\n"
    )
    block = render(derive(load_text(text))).split("k = 3\n")[1].split("\n\n")[0]
    assert block.splitlines() == ["  y₁      height [m]", "  φ       angle", "  ψ_lid   [rad]"]


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


def brackets_of(text: str) -> list[tuple[int, int]]:
    """Return where brackets open and close."""
    found, stack = [], []
    for i, char in enumerate(text):
        if char in "([{":
            stack.append(i)
        elif char in ")]}":
            found.append((stack.pop(), i))
    assert not stack
    return found


#: A sum sign or a number, which stays with its bracket.
FRONT = re.compile(r"(?:Σ\([^)]*\)|(?:^|[ (\[{−])[½⅓⅔¼¾⅙⅛\d]+) $")


def attached(text: str, first: int, last: int) -> str:
    """Return a bracket with what stands before and behind it without a space."""
    ends = dict(brackets_of(text))
    begins = {b: a for a, b in ends.items()}
    while first and not text[first - 1].isspace() and text[first - 1] not in "([{":
        first = begins.get(first - 1, first - 1)
    while last + 1 < len(text) and not text[last + 1].isspace() and text[last + 1] not in ")]}":
        last = ends.get(last + 1, last + 1)
    front = FRONT.search(text[:first])
    return text[front.start() if front else first : last + 1]


def assert_whole_factors(text: str, width: int) -> None:
    """A bracket that contains a line break is longer than the lines; none is left open."""
    for block in text.split("\n\n"):
        rows = block.split("\n")
        for first, last in brackets_of(block):
            inside = block[first : last + 1]
            if "\n" not in inside or " " not in inside or not {"=", "−", "+"} & set(inside):
                continue
            begun = block[:first].count("\n")
            margin = min(
                len(x) - len(x.lstrip()) for x in rows[begun + 1 : begun + 1 + inside.count("\n")]
            )
            whole = " ".join(attached(block, first, last).split())
            assert display_width(whole) > width - margin - 2, inside
    # lines begin with the sign of a term, an equality sign, a bracket or a whole formula
    for line in text.splitlines()[3:]:  # below title and description
        assert not line.rstrip().endswith(("+", "−", "=", "(", "[", "{")), line


@pytest.mark.parametrize("name", every_model(few=WRITTEN))
def test_factors_that_fit_on_a_line_are_not_broken(name):
    path = PATHS[name]
    model = equations_of(path).model
    formula = TextFormula(Notation(model), written_decimals(model))
    for steps in (False, True):
        for width in (80, 100, 120):
            text = render_text(model, steps_of(path, steps), formula, width, numbered=steps)
            assert_whole_factors(text, width)


@pytest.mark.parametrize(
    "widths", [(60, 100), pytest.param((70, 80, 90, 110, 120, 130, 140), marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("name", every_model(few=WRITTEN))
def test_every_page_at_every_width(name, widths):
    """Both kinds, Maggi's equations, closed forms and the derivation, at 60 to 140 columns."""
    path = PATHS[name]
    model = equations_of(path).model
    formula = TextFormula(Notation(model), written_decimals(model))
    for steps in pages_of(path):
        for side in (x for step in steps for line in step.lines for x in line.sides):
            if isinstance(side, t.Sign):
                continue
            text = formula.text(side)
            assert not re.search(r"[+−] [+−]|^[+]", text), text
            assert not re.search(r"(?:^|[ (\[{])1 [^+−=≤≥)\]}]", text), text  # a factor 1
            assert "{{" not in text, text
        for width in widths:
            text = render_text(model, steps, formula, width, numbered=True)
            assert max(map(display_width, text.splitlines())) <= width
            assert_whole_factors(text, width)


def test_functions_above_a_fraction_have_parentheses():
    formula = TextFormula(Notation(model_of("x", "m/2*x'^2").model))
    sine, m, cosine = (
        t.Call("sin", (t.Symbol("x"),)),
        t.Symbol("m"),
        t.Call("cos", (t.Symbol("x"),)),
    )
    two = t.Number(Fraction(2))
    assert formula.text(t.Quotient(sine, m)) == "sin(x)/m"
    assert formula.text(t.Quotient(t.Product((m, sine)), m)) == "m sin(x)/m"
    assert formula.text(t.Quotient(t.Power(cosine, two), m)) == "cos²(x)/m"
    assert formula.text(t.Quotient(t.ONE, t.Power(m, two))) == "1/m²"
    assert formula.text(t.Quotient(t.ONE, t.Power(sine, two))) == "1/(sin² x)"


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("theta[1]", "θ₁"),
        ("x[i−1]", "xᵢ₋₁"),
        ("x[12]", "x₁₂"),
        ("x[N]", "x_N"),
        ("x[N−1]", "x_(N−1)"),
        ("x_A[2]", "x_A₂"),
        ("x[1,2]", "x[1,2]"),
    ],
)
def test_indices_are_subscripts(name, shown):
    names = Notation(model_of("z", "m/2*z'^2").model)
    assert names.text(name) == shown


def test_a_member_and_a_name_that_would_look_the_same_are_distinguished():
    text = "coordinates: ['x[1..2]', x1]\nT: (x[1]'^2 + x[2]'^2 + x1'^2)/2\n"
    text += "initial: {'x[1..2]': 0, \"x[1..2]'\": 0, x1: 0, x1': 0}\n"
    names = Notation(load_text(text))
    assert (names.text("x[1]"), names.text("x1")) == ("x[1]", "x1")


def test_symbols_of_the_theory_give_way_to_names_of_the_model():
    rest = {"constraints": "  c: phi = b*beta"}
    equations = model_of("phi beta k", "(phi'^2 + beta'^2 + k'^2)/2", parameters="b r f", **rest)
    text = render(equations)
    assert "Coordinates: n = 3" in text
    assert "Constraints: s = 1" in text
    assert "n − s = 3 − 1 = 2" in text
    assert "a_iα = ∂h_α/∂qᵢ" in text
    assert "Σ_α λ_α a_iα" in text
    assert "constraint α as written" in text


def test_the_textbook_is_named_once():
    for steps in (False, True):
        text = render(equations_of(next(p for p in MODELS if p.stem == "four_bar")), steps=steps)
        assert text.count("textbook, §8") == 1


def test_virtual_displacements_are_factored_like_the_constraint():
    path = next(p for p in MODELS if p.stem == "double_pendulum_cartesian")
    assert "2 [(x₂ − x₁) (δx₂ − δx₁) + (y₂ − y₁) (δy₂ − δy₁)] = 0" in render(equations_of(path))


def test_a_wrapped_sum_breaks_before_its_right_side():
    text = render(equations_of(next(p for p in MODELS if p.stem == "heavy_top")), width=80)
    (block,) = [x for x in text.split("\n\n") if x.startswith("Equations of motion")]
    for line in block.splitlines()[4:]:
        assert " = " not in line.strip(), line


def test_the_heading_is_the_title():
    path = next(p for p in MODELS if p.stem == "andrews_squeezer")
    for form, heading in (
        ("text", "Andrews' squeezing mechanism\n"),
        ("latex", r"\section*{Andrews' squeezing mechanism}"),
        ("markdown", "# Andrews' squeezing mechanism\n"),
    ):
        assert heading in render(equations_of(path), form)
    assert model_of("x", "x'^2/2").model.title == "<text>"
    named = "name: four_bar_2\ncoordinates: [x]\nT: x'^2/2\ninitial: {x: 0, x': 0}\n"
    assert load_text(named).title == "Four bar 2"


def test_no_line_ends_in_the_number_of_a_bracket():
    path = next(x for x in MODELS if x.stem == "heavy_top")
    for width in (80, 100, 120):
        text = render(equations_of(path), steps=True, width=width)
        assert not re.search(r"(?:^ *|[+−] )[½⅓¼\d]+$", text, re.MULTILINE)


@pytest.mark.parametrize(
    ("expression", "shown"),
    [
        ("sin(x)*m", "sin(x) m"),
        ("sin(x)^2*m^2*l", "sin²(x) m² l"),
        ("sin(x)*cos(x)*m", "sin x cos(x) m"),
        ("sin(x)*cos(x)", "sin x cos x"),
        ("m*sin(x)*(m + l)", "m sin x (m + l)"),
        ("sin(x)*r.x", "sin(x) r_x"),
    ],
)
def test_functions_before_a_name_have_parentheses(expression, shown):
    model = load_text(
        "coordinates: [x]\nparameters: {m: 1, l: 1}\ndefinitions: {r: [x, 1]}\n"
        f"T: x'^2/2\noutputs: {{o: {expression}}}\ninitial: {{x: 0, x': 0}}\n"
    )
    tree = expand(parse(expression), scope_of(model).names)
    assert TextFormula(Notation(model)).text(written(tree, model)) == shown
