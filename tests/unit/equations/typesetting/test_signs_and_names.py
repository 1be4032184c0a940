"""Signs made of names, such as Q_x and δx, and names of the model that look like them."""

from __future__ import annotations

import re

import pytest

import lagcli
from lagcli.equations.presentation.conserved import conserved_step
from lagcli.equations.presentation.formulas import Formulas, Signs
from lagcli.equations.typesetting import nodes as t
from lagcli.equations.typesetting.latex import LatexFormula
from lagcli.equations.typesetting.mathml import MathmlFormula
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.text import TextFormula
from lagcli.model.loader import load_text
from lagcli.model.model import Model

WRITERS = {
    "text": lambda names: TextFormula(names).text,
    "latex": lambda names: LatexFormula(names).latex,
    "mathml": lambda names: MathmlFormula(names).mathml,
}


def model(coordinates: str, parameters: str = "m", rest: str = "") -> Model:
    names = coordinates.split()
    kinetic = " + ".join(f"{q}'^2/2" for q in names)
    initial = ", ".join(f"{q}: 0.1, {q}': {{guess: 0}}" for q in names)
    values = ", ".join(f"{p}: 2" for p in parameters.split())
    return load_text(
        f"coordinates: [{', '.join(names)}]\nparameters: {{{values}}}\n{rest}T: {kinetic}\n"
        f"initial: {{{initial}}}\n"
    )


def seen(formula: str) -> str:
    """Return what is seen of a formula, without fonts and groups."""
    plain = re.sub(r"<[^>]*>", "", formula)
    return re.sub(r"\\math(it|rm)|[{}\s]", "", plain)


CASES = {
    "component": ("x y", "r_x", t.Component(t.Symbol("r"), "x"), "r_x", "(r)_x"),
    "rate of a component": ("x r_x", "m", t.Component(t.Symbol("r", 1), "x"), "r_x", "(ṙ)_x"),
    "numbered component": ("x y", "r_1", t.Component(t.Symbol("r"), "1"), "r_1", "r[1]"),
    "force": ("x Q_x", "m", t.Symbol("x", kind="force"), "Q_x", "𝒬_x"),
    "force by a Greek letter": ("phi y", "Q_phi", t.Symbol("phi", kind="force"), "Q_phi", "𝒬_φ"),
    "displacement beside a product": (
        *("x delta", "m", t.VirtualDisplacement(t.Symbol("x"))),
        *(t.Product((t.Symbol("delta"), t.Symbol("x"))), "δx"),
    ),
    "displacement": ("x y", "δx", t.VirtualDisplacement(t.Symbol("x")), "δx", "δ(x)"),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("writer", WRITERS)
def test_a_sign_does_not_look_like_a_name(case: str, writer: str) -> None:
    coordinates, parameters, sign, other, text = CASES[case]
    other = t.Symbol(other) if isinstance(other, str) else other
    rest = "definitions: {r: [x, 2, 3]}\n" if isinstance(sign, t.Component) else ""
    names = Notation(model(coordinates, parameters, rest))
    write = WRITERS[writer](names)
    if writer == "text":
        assert write(sign) == text != write(other)
    else:
        assert seen(write(sign)) != seen(write(other))
    plain = Notation(model("phi x y", "m", rest))
    assert "(" not in WRITERS[writer](plain)(sign)  # no brackets without need
    assert "𝒬" not in WRITERS[writer](plain)(sign)


def test_a_letter_with_two_dots_is_no_acceleration() -> None:
    names = Notation(model("a b", "ä"))
    assert [names.text("a", n) for n in range(3)] == ["a", "ȧ", "a''"]
    assert (names.text("ä"), names.text("b", 2)) == ("ä", "b̈")
    assert names.latex("ä") != names.latex("a")
    assert names.latex("ä") == r"\mathit{\text{ä}}"


def test_words_with_greek_letters_are_latex() -> None:
    names = Notation(model("x y", "δx αβ2"))
    assert names.latex("δx") == r"\mathit{{\delta}x}"
    assert names.latex("αβ2") == r"\mathit{{\alpha}{\beta}2}"


def test_labels_of_equations_have_no_accents() -> None:
    document = lagcli.render(lagcli.derive(model("höhe y")), "latex")
    assert r"\label{eq:equations-of-motion-hohe}" in document
    assert r"\mathit{h\text{ö}he}" in document


SOLVED = """\
coordinates: [Delta1, y]
parameters: {a: 2, b: 3}
T: (1 + a*y^2)*Delta1'^2/2 + y'^2/2*(b + Delta1^2)
constraints: {c: Delta1^3 + y^3 + a*Delta1*y = 1}
initial: {Delta1: 0.5, Delta1': 1, y: {guess: 0.5}, y': {guess: 0}}
"""


def test_divisors_of_closed_forms_are_not_named_as_coordinates() -> None:
    equations = lagcli.derive(load_text(SOLVED))
    partition = lagcli.partition(equations)
    text = lagcli.render(equations, partition=partition, solve=True)
    assert "  D₁ = " in text
    assert "(1/D₁)" in text
    other = lagcli.derive(load_text(SOLVED.replace("Delta1", "x")))
    text = lagcli.render(other, partition=lagcli.partition(other), solve=True)
    assert "  Δ₁ = " in text


def test_implicit_functions_are_not_named_as_parameters() -> None:
    text = """\
coordinates: [x, y]
parameters: {NAME: 2}
T: (x'^2 + y'^2)/2
V: NAME*(x + 7)
constraints: {c: x^5 + x + y = 2}
initial: {y: 0, y': 0, x: {guess: 1}, x': {guess: 0}}
"""
    for name, function in (("R_x", "F_x"), ("R", "R_x")):
        equations = lagcli.derive(load_text(text.replace("NAME", name)))
        partition = lagcli.partition(equations)
        shown = lagcli.render(equations, kinds=("second",), partition=partition)
        assert f"  x = {function}(y) " in shown


CONSERVED = """\
coordinates: [phi, x]
parameters: {{{h}: 2, {p}: 0.3, w: 0.5, {T}: 1}}
T: {h}*(phi'^2 + sin(phi)^2*w^2)/2 + x'^2/2
V: {h}*{p}*{T}*cos(phi)
initial: {{phi: 0.3, phi': 0.1, x: 0, x': 1}}
"""


def test_conserved_quantities_are_not_named_as_parameters() -> None:
    def shown(model: Model) -> str:
        found = lagcli.check(model)
        steps = [conserved_step(Formulas(found.equations), q) for q in found.conserved.quantities]
        write = TextFormula(Notation(model)).text
        lines = [" = ".join(map(write, line.sides)) for s in steps for line in s.lines]
        return "\n".join([*(s.title for s in steps), *lines])

    plain = lagcli.check(load_text(CONSERVED.format(h="j", p="c", T="d")))
    assert [q.in_momenta for q in plain.conserved.quantities] == ["p_x", "h"]
    text = shown(plain.equations.model)
    assert "Conserved: Jacobi's integral h\n" in text
    assert "\nh = " in text
    found = lagcli.check(load_text(CONSERVED.format(h="h", p="p_x", T="T")))
    assert [q.in_momenta for q in found.conserved.quantities] == ["P_x", "H"]
    text = shown(found.equations.model)
    assert "Conserved: Jacobi's integral ℋ\n" in text
    assert "\nℋ = " in text
    still = load_text(CONSERVED.format(h="h", p="p_x", T="T").replace(" + sin(phi)^2*w^2", ""))
    assert "Conserved: energy, ℋ = 𝒯 + V\n" in shown(still)


def test_inputs_are_names() -> None:
    text = "inputs: {T: {times: [0, 1], values: [1, 2], interpolation: cubic}}\n"
    signs = Signs(model("x y", "m", text))
    assert (signs.kinetic.text, signs.potential.text) == ("𝒯", "V")


def test_capitals_of_the_theory_have_their_own_letters_in_mathml() -> None:
    made = model("x y", "T V L M B J Q h")
    write = MathmlFormula(Notation(made)).mathml
    signs = Signs(made)
    for sign in (
        signs.kinetic,
        signs.lagrangian,
        signs.mass_matrix,
        signs.null_space,
        signs.jacobi,
    ):
        letter = re.sub("<[^>]*>", "", write(sign))
        assert letter not in "TVLMBJQh"
