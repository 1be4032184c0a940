"""Scope of an expression: derivatives of names that are not coordinates."""

from __future__ import annotations

import pytest
import symengine as se

import lagcli
from lagcli.errors import ModelError
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.trees import Name
from lagcli.model.names.namespace import Namespace
from lagcli.model.names.scope import Scope

INPUTS = {"cubic": 2, "line": 1, "step": 0, "sine": 5}
SCOPE = Scope(Namespace(inputs=INPUTS, parameters={"m": lambda: se.Symbol("m")}), "the expression")


@pytest.mark.parametrize(
    ("text", "primes"), [("cubic", 2), ("line", 1), ("step", 0), ("sine", 2), ("m", 0), ("t", 0)]
)
def test_derivatives_that_there_are(text: str, primes: int) -> None:
    SCOPE.check(Name(0, 1, text, primes))


@pytest.mark.parametrize(
    ("text", "primes", "message"),
    [
        ("t", 1, "`t` has no time derivative"),
        ("m", 1, "`m` is a parameter: its time derivative is zero"),
        ("sine", 3, "the highest derivative of an input is `sine''`"),
        ("line", 2, "`line` is linear between its rows: it has no derivative `line''`"),
        ("step", 1, "`step` is a step function"),
    ],
)
def test_derivatives_that_there_are_not(text: str, primes: int, message: str) -> None:
    with pytest.raises(ExpressionError) as error:
        SCOPE.check(Name(3, 9, text, primes))
    assert message in error.value.message
    assert (error.value.start, error.value.end) == (3, 9)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("simulation", "{t_end: 2*r}", "`t_end` cannot depend on definitions, but uses `r`"),
        ("simulation", "{t_end: x}", "`t_end` cannot depend on coordinates, but uses `x`"),
        ("constraints", '{"c[i = 1..r]": x = i}', "may use whole numbers and parameters; `r` is a"),
    ],
)
def test_a_number_depends_on_parameters_alone(key: str, value: str, message: str) -> None:
    text = "coordinates: [x]\nparameters: {m: 1}\ndefinitions: {r: 2*m}\nT: m*x'^2\n"
    with pytest.raises(ModelError) as error:
        lagcli.load_text(f"{text}{key}: {value}\ninitial: {{x: 0, x': 0}}\n")
    found = [d for d in error.value.diagnostics if message in d.message]
    assert found
    assert found[0].help or found[0].kind == "bad-index"


def test_kinks_of_numbers_leave_the_equations_smooth() -> None:
    text = (
        "coordinates: [x]\nparameters: {a: -1, m: abs(a)}\nT: m*x'^2\ninitial: {x: abs(a), x': 0}\n"
    )
    assert lagcli.load_text(text).names.smooth
    assert not lagcli.load_text(text.replace("m*x'^2", "abs(m)*x'^2")).names.smooth
