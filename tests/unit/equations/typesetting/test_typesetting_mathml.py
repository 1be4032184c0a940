"""Formulas in MathML: read back, they have the value of the tree that was written."""

from __future__ import annotations

import math
import random
import re
from fractions import Fraction
from xml.etree import ElementTree

import pytest
from formula_values import MODELS, equations_of, model_of, point, steps_of, value
from shipped import PATHS, WRITTEN, every_model

from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.typesetting.latex_symbol import InvalidLatex
from lagcli.equations.typesetting.mathml import MathmlFormula, equation, width
from lagcli.equations.typesetting.nodes import (
    Call,
    Line,
    Number,
    Power,
    Product,
    Quotient,
    Sum,
    Symbol,
    whole,
)
from lagcli.equations.typesetting.notation import Notation, symbol_mathml
from lagcli.equations.typesetting.text import TextFormula
from lagcli.equations.typesetting.writer import written_decimals

APPLY, TIMES = "\u2061", "\u2062"


class Reader:
    """Evaluates MathML, knowing the names of a model and nothing else of how it was written."""

    def __init__(self, equations, at):
        self.names = Notation(equations.model)
        self.at = {}
        for name in at:
            base = name.rstrip("'")
            if base.startswith("lambda."):
                node = Symbol(base.removeprefix("lambda."), kind="multiplier")
            else:
                node = Symbol(base, len(name) - len(base))
            written = MathmlFormula(self.names).mathml(node)
            self.at[self._key(ElementTree.fromstring(written))] = at[name]
        self.at["<mi>π</mi>"] = math.pi

    @staticmethod
    def _key(element):
        while element.tag in ("mrow", "mpadded") and len(element) == 1:
            element = element[0]
        return ElementTree.tostring(element, encoding="unicode")

    def value(self, mathml):
        items = self._flat(ElementTree.fromstring(f"<mrow>{mathml}</mrow>"))
        found, rest = self._sum(items, 0)
        assert rest == len(items), mathml
        return found

    def _flat(self, row):
        found = []
        for child in row:
            if child.tag == "mrow" and self._key(child) not in self.at:
                found += self._flat(child)
            elif child.tag != "mspace":
                found.append(child)
        return found

    def _sum(self, items, at):
        total, sign = 0.0, 1
        if self._operator(items, at) == "−":
            sign, at = -1, at + 1
        term, at = self._product(items, at)
        total = sign * term
        while self._operator(items, at) in ("+", "−"):
            sign = 1 if self._operator(items, at) == "+" else -1
            term, at = self._product(items, at + 1)
            total += sign * term
        return total, at

    def _product(self, items, at):
        found, at = self._factor(items, at)
        while at < len(items):
            if self._operator(items, at) in (TIMES, "⋅"):
                at += 1
            elif self._operator(items, at) not in (None, "(", "[", "|"):
                break
            elif items[at].tag == "msup" and items[at][0].tag == "mo":
                break  # the end of a bracket with its exponent
            factor, at = self._factor(items, at)
            found *= factor
        return found, at

    def _factor(self, items, at):
        opening = self._operator(items, at)
        if opening in ("(", "[", "|"):
            found, at = self._sum(items, at + 1)
            closing = {"(": ")", "[": "]", "|": "|"}[opening]
            item = items[at]
            if item.tag == "msup":  # the bracket carries the exponent
                assert item[0].text == closing
                return found ** self._alone(item[1]), at + 1
            assert item.text == closing
            return abs(found) if opening == "|" else found, at + 1
        item = items[at]
        if self._operator(items, at + 1) == APPLY:
            exponent = 1
            if item.tag == "msup":
                exponent, item = self._alone(item[1]), item[0]
            function = {"arctan": "atan", "arcsin": "asin", "arccos": "acos"}.get(item.text)
            arguments, at = self._arguments(items, at + 2)
            return getattr(math, function or item.text)(*arguments) ** exponent, at
        return self._alone(item), at + 1

    def _arguments(self, items, at):
        if self._operator(items, at) not in ("(", "["):
            found, at = self._factor(items, at)
            return [found], at
        found = []
        while self._operator(items, at) in ("(", "[", ","):
            argument, at = self._sum(items, at + 1)
            found.append(argument)
        assert items[at].text in (")", "]")
        return found, at + 1

    def _alone(self, item):
        if self._key(item) in self.at:
            return self.at[self._key(item)]
        match item.tag:
            case "mn":
                return float(item.text)
            case "mrow":
                items = self._flat(item)
                found, rest = self._sum(items, 0)
                assert rest == len(items)
                return found
            case "mstyle" | "mpadded":
                return self._alone(item[0])
            case "mfrac":
                return self._alone(item[0]) / self._alone(item[1])
            case "msup":
                return self._alone(item[0]) ** self._alone(item[1])
            case "msubsup":
                below = f"<msub>{self._key(item[0])}{self._text(item[1])}</msub>"
                return self.at[below] ** self._alone(item[2])
            case "msqrt":
                return math.sqrt(self._alone(item[0]))
            case "mroot":
                return self._alone(item[0]) ** (1 / self._alone(item[1]))
        if item.tag == "mi" and item.text == "e":
            return math.e
        raise AssertionError(self._text(item))

    def _text(self, item):
        return ElementTree.tostring(item, encoding="unicode")

    def _operator(self, items, at):
        return items[at].text if at < len(items) and items[at].tag == "mo" else None


def html(text):
    """Parse HTML that is XML but for its places of line breaks."""
    return ElementTree.fromstring(text.replace("<wbr>", ""))


def formula_of(equations, **options):
    return MathmlFormula(Notation(equations.model), written_decimals(equations.model), **options)


@pytest.mark.parametrize("name", every_model(few=WRITTEN))
def test_equations_read_back_have_their_values(name: str) -> None:
    e = equations_of(PATHS[name])
    f, formula = Formulas(e), formula_of(e)
    at = point(e, random.Random(7))
    reader = Reader(e, at)
    for i in range(min(8, len(e.q))):
        for side in f.equation_line(i).sides:
            expected = value(side, at)
            found = reader.value(formula.mathml(side))
            assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("name", every_model(few=WRITTEN))
def test_every_formula_is_well_formed_and_cut_into_whole_pieces(name: str) -> None:
    e = equations_of(PATHS[name])
    formula, text = formula_of(e), TextFormula(Notation(e.model))
    for step in steps_of(PATHS[name]):
        for line in step.lines:
            element = html(equation(line, formula, text))
            assert element.attrib["aria-label"] == " = ".join(map(text.text, line.sides))
            whole_line = [formula.mathml(side) for side in line.sides]
            shown = "".join(element.itertext())
            parts = ["".join(ElementTree.fromstring(x).itertext()) for x in whole_line]
            assert shown == "=".join(parts)  # nothing is lost between the pieces


def test_names_have_greek_letters_dots_and_subscripts() -> None:
    e = model_of("phi, x_A2, torque_1, b", "phi'^2 + x_A2'^2 + torque_1'^2 + b'^2")
    formula = formula_of(e)
    assert formula.mathml(Symbol("phi")) == "<mrow><mi>φ</mi></mrow>"
    dotted = formula.mathml(Symbol("phi", 2))
    assert ">..</mo>" in dotted
    assert "<mover><mi>φ</mi>" in dotted
    squared = formula.mathml(Power(Symbol("x_A2", 1), whole(2)))
    # the exponent stands beside the letter, not beside its dots
    assert squared.startswith('<mrow><msubsup><mpadded height="0.7em"><mover><mi>x</mi>')
    assert squared.endswith("<mi>A2</mi><mrow><mn>2</mn></mrow></msubsup></mrow>")
    assert formula.mathml(Symbol("torque_1")) == (
        "<mrow><msub><mi>torque</mi><mn>1</mn></msub></mrow>"
    )


def test_two_names_never_look_alike() -> None:
    e = model_of("x1, x_1", "x1'^2 + x_1'^2")
    formula = formula_of(e)
    assert formula.mathml(Symbol("x1")) != formula.mathml(Symbol("x_1"))


def test_numbers() -> None:
    e = model_of("x", "x'^2")
    assert formula_of(e).number(Fraction(-1, 20)).count("0.05") == 1
    assert "<mfrac><mn>1</mn><mn>3</mn></mfrac>" in formula_of(e).number(Fraction(1, 3))
    third = formula_of(e, numeric=True).number(Fraction(1, 3))
    assert third == "<mn>0.333333</mn>"
    small = formula_of(e, numeric=True).number(Fraction(1, 3 * 10**9))
    assert "<msup><mn>10</mn>" in small


def test_brackets_around_fractions_are_as_tall_as_they_are() -> None:
    e = model_of("x y", "x'^2 + y'^2")
    half = Quotient(Symbol("x"), Symbol("y"))
    tall = formula_of(e).mathml(Power(half, whole(2)))
    assert 'stretchy="true"' in tall
    flat = formula_of(e).mathml(Product((Symbol("x"), Sum(((1, Symbol("x")), (-1, Symbol("y")))))))
    assert 'stretchy="true"' not in flat


def test_functions_stand_apart_from_their_arguments() -> None:
    e = model_of("x", "x'^2")
    sine = formula_of(e).mathml(Power(Call("sin", (Symbol("x"),)), whole(2)))
    assert f"<mo>{APPLY}</mo><mspace" in sine
    absolute = formula_of(e).mathml(Call("abs", (Symbol("x"),)))
    assert absolute.count(">|</mo>") == 2


def test_long_sums_are_cut_between_terms_first() -> None:
    e = model_of("x y", "x'^2 + y'^2")
    term = Product((Symbol("x"), Call("sin", (Sum(((1, Symbol("x")), (1, Symbol("y")))),))))
    line = Line((Sum(tuple((1, term) for _ in range(6))), Number(Fraction(0))))
    shown = equation(line, formula_of(e), TextFormula(Notation(e.model)))
    root = html(shown)
    (group,) = [child for child in root if child.tag == "span"]
    assert [child.tag for child in group] == ["math"] * 6
    assert "".join(group[-1].itertext()).endswith("=0")  # not torn from the last term


@pytest.mark.parametrize(
    ("latex", "text", "tags"),
    [
        (r"\dot{q}_i", "q.i", ["msub", "mover"]),
        (r"\varphi", "φ", ["mi"]),
        (r"x_{\mathrm{rel}}^2", "xrel2", ["msubsup"]),
        (r"\hat{n}", "n^", ["mover"]),
        (r"\vartheta_{i,j}", "ϑi,j", ["msub"]),
    ],
)
def test_own_signs(latex: str, text: str, tags: list[str]) -> None:
    element = ElementTree.fromstring(symbol_mathml(latex))
    assert "".join(element.itertext()) == text
    found = {x.tag for x in element.iter()}
    assert set(tags) <= found


@pytest.mark.parametrize(
    "latex",
    [r"\href{x}{y}", r"\frac{a}{b}", "a}", "{a", r"x_1_2", "_", r"\mathrm{<b>}", "a" + "{" * 50],
)
def test_what_is_more_than_a_sign_is_rejected(latex: str) -> None:
    with pytest.raises(InvalidLatex):
        symbol_mathml(latex)


def test_a_coordinate_with_its_own_latex() -> None:
    from lagcli.equations.derivation.lagrange import derive
    from lagcli.model.loader import load_text

    text = r"""
coordinates: {a: {latex: '\vartheta'}, b: {latex: '\frac{1}{2}'}}
T: a'^2 + b'^2
V: 0
initial: {a: 0, a': 0, b: 0, b': 0}
"""
    formula = formula_of(derive(load_text(text)))
    assert "ϑ" in formula.mathml(Symbol("a", 1))
    assert formula.mathml(Symbol("b")) == "<mrow><mi>b</mi></mrow>"


def test_width_counts_letters_alone() -> None:
    assert width('<mover><mi>φ</mi><mstyle scriptlevel="0"><mo>..</mo></mstyle></mover>') == 1
    assert width("<mi>sin</mi><mo>\u2061</mo><mspace width='1em'/><mi>x</mi>") == 4


def test_a_bracket_is_not_set_apart_from_its_factors():
    """An inline block of several lines stands on its last one: 4 J would be beside that."""
    equations = equations_of(next(p for p in MODELS if p.stem == "heavy_top"))
    names = Notation(equations.model)
    f = Formulas(equations)
    mathml = MathmlFormula(names)
    text = equation(f.equation_line(3), mathml, TextFormula(names))
    assert '<span class="formula">' in text
    apart = (
        r'<span class="formula"><math[^>]*>(<mspace[^>]*/>|<mo>\u2062</mo>)+<mo form="prefix" fence'
    )
    assert not re.search(apart, text)
