"""Printed notation is read where it can mean one thing only."""

import pytest

from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tokens import ExpressionError, tokenize, without_dots
from lagcli.model.loader import load_text


def texts(expression):
    return [token.text for token in tokenize(expression)[:-1]]


@pytest.mark.parametrize(
    ("printed", "plain"),
    [
        ("½*m*(ẋ² + ẏ²)", "(1/2)*m*(x'^2 + y'^2)"),
        ("m·g·y", "m*g*y"),
        ("a×b ÷ c ⋅ d", "a*b / c * d"),
        ("x − y – z", "x - y - z"),
        ("x² + x⁻³ + 2¹⁰", "x^2 + x^-3 + 2^10"),
        ("φ̇*l + θ̈", "φ'*l + θ''"),
        ("ẋ_A^2", "x_A'^2"),
        ("ẍ − y″ + z′ + w’", "x'' - y'' + z' + w'"),
        ("if(x ≤ 1, ⅓, x ≠ 2)", "if(x <= 1, (1/3), x != 2)"),
        ("x[1]² + x'²", "x[1]^2 + x'^2"),
        ("größe*Ä", "größe*Ä"),
    ],
)
def test_printed_notation(printed, plain):
    assert texts(printed) == texts(plain)


def test_positions_are_those_of_the_text():
    text = "φ̇·ẋ² − ½"
    tokens = tokenize(text)
    assert text[tokens[0].start : tokens[0].end] == "φ̇"
    assert [(t.text, t.start) for t in tokens if t.kind == "name"] == [("φ", 0), ("x", 3)]
    assert tokens[-1].start == len(text)


@pytest.mark.parametrize(
    ("text", "message", "help_"),
    [
        ("½m", "between `½` and `m`", "write a product as `½*m`"),
        ("2½", "`2½` is not a number", "write a mixed number as a sum, `(2 + ½)`"),
        ("2 x²", "between `2` and `x`", "`2*x`"),
        ("sin²(x)", "`sin^2(…)`", "`sin(…)^2`"),
        ("ẋ[1]", "an index must directly follow a name", "`x[1]'`"),
        ("²", "unexpected `^`", "operands"),
        ("x̋", "unexpected", ""),
        ("√x", "unexpected `√`", "`sqrt(x)`"),
    ],
)
def test_what_stays_an_error(text, message, help_):
    with pytest.raises(ExpressionError) as error:
        parse(text)
    assert message in error.value.message
    assert help_ in (error.value.help or "")


def test_dots_over_letters():
    assert without_dots("φ̇") == ("φ", 1)
    assert without_dots("ẍ_1") == ("x_1", 2)
    assert without_dots("löß") == ("löß", 0)


def test_a_model_in_printed_notation():
    printed = load_text(
        "coordinates: [φ]\nparameters: {m: 2, l: 3}\nT: ½·m·l²·φ̇²\nV: −m·9.81·l·cos(φ)\n"
        "initial: {φ: 0.1, φ̇: 1}"
    )
    plain = load_text(
        "coordinates: [φ]\nparameters: {m: 2, l: 3}\nT: 1/2*m*l^2*φ'^2\n"
        "V: -m*9.81*l*cos(φ)\ninitial: {φ: 0.1, φ': 1}"
    )
    assert printed.kinetic == plain.kinetic
    assert printed.potential == plain.potential
    assert printed.initial_velocities["φ"].value == 1
