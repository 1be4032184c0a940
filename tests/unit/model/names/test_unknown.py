"""Errors of names that are not declared: what is meant, by the similar names of the model."""

import pytest

import lagcli
from lagcli.errors import ModelError
from lagcli.model.diagnostics import Broken
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.trees import Name
from lagcli.model.names.namespace import Allowed
from lagcli.model.names.scope import Scope
from lagcli.model.names.unknown import meant_derivative, unknown, unknown_index, unknown_part

MODEL = """
coordinates: [phi, "x[1..2]"]
parameters: {mass: 1, length: 2}
T: mass/2*(phi'^2 + x[1]'^2 + x[2]'^2)
constraints: {guide: x[1] = length}
initial: {phi: 0, phi': 0, "x[1]": 2, "x[2]": 0, "x[1..2]'": 0}
"""


@pytest.fixture(name="scope")
def scope_of_the_model() -> Scope:
    return Scope(lagcli.load_text(MODEL).names, "the expression")


def named(text: str) -> Name:
    tree = parse(text)
    assert isinstance(tree, Name)
    return tree


def said(error: ExpressionError) -> tuple[str, str, str]:
    return error.kind, str(error), error.help or ""


@pytest.mark.parametrize(
    ("text", "kind", "help_"),
    [
        ("mas", "unknown-name", "`mass` (parameter"),
        ("phidot", "unknown-name", "`phi'`"),
        ("sin", "unknown-name", "`sin(x)`"),
        ("e", "unknown-name", "`exp(1)`"),
        ("lambda", "unknown-name", "`lambda.NAME`"),
        ("nan", "unknown-name", "numbers are finite"),
        ("zzzzzz", "unknown-name", "`zzzzzz: 1`"),
        ("zzzzzz'", "unknown-name", "declare it under `coordinates`"),
        ("x", "a-family", "`x[1]`"),
    ],
)
def test_unknown_names(scope: Scope, text: str, kind: str, help_: str) -> None:
    found = said(unknown(scope, named(text)))
    assert found[0] == kind
    assert found[1].startswith("the expression uses `")
    assert help_ in found[2]


def test_a_context_without_coordinates_suggests_parameters_alone(scope: Scope) -> None:
    here = Scope(scope.names, "the parameter", Allowed.PARAMETERS)
    assert "phi" not in said(unknown(here, named("phix")))[2]
    assert "declare it under `parameters`" in said(unknown(here, named("zzzzzz")))[2]


def test_what_may_have_been_declared_in_error_is_not_reported(scope: Scope) -> None:
    scope.names.suspects.add("stick")
    with pytest.raises(Broken):
        unknown(scope, named("stick"))
    with pytest.raises(Broken):
        unknown_index(scope, named("stick"))
    with pytest.raises(Broken):
        unknown_part(scope, named("lambda.stick"), ("lambda.stick", "stick"), "constraint")


def test_unknown_names_in_indices(scope: Scope) -> None:
    assert "name[k = 1..N]" in said(unknown_index(scope, named("k")))[2]
    assert "`mass` (parameter" in said(unknown_index(scope, named("mas")))[2]


@pytest.mark.parametrize(
    ("part", "what", "message", "help_"),
    [
        ("guid", "constraint", "there is no constraint `guid`", "guide"),
        ("x[3]", "coordinate", "there is no coordinate `x[3]`", "the members are x[1..2]"),
    ],
)
def test_unknown_parts(scope: Scope, part: str, what: str, message: str, help_: str) -> None:
    text = f"lambda.{part}"
    found = said(unknown_part(scope, named("mass"), (text, part), what))
    assert message in found[1]
    assert help_ in found[2].replace("`", "")


@pytest.mark.parametrize(
    ("text", "meant"),
    [("phidot", "phi'"), ("phiddot", "phi''"), ("xdot[1]", "x[1]'"), ("ydot", None), ("phi", None)],
)
def test_derivatives_that_are_meant(scope: Scope, text: str, meant: str | None) -> None:
    assert meant_derivative(scope.names, text) == meant


VECTOR = """
coordinates: {x: m, y: m, phi: rad}
parameters: {m: 1 kg, l: 1 UNIT}
definitions: {A: "[x, y]", B: "[l*cos(phi), l*sin(phi)]"}
T: m/2*(x'^2 + y'^2 + l^2*phi'^2)
constraints: {D: A = B, E: phi = 0}
initial: {x: {guess: 1}, y: {guess: 0}, phi: 0, x': 0, y': 0, phi': 0}
outputs: {f: lambda.D.x, h: USED}
"""


def test_components_of_a_constraint_with_an_error_are_not_reported() -> None:
    with pytest.raises(ModelError) as caught:
        lagcli.load_text(VECTOR.replace("UNIT", "foo").replace("USED", "lambda.D.y"))
    (found,) = caught.value.diagnostics
    assert found.kind == "unknown-unit"
    assert lagcli.load_text(VECTOR.replace("UNIT", "m").replace("USED", "lambda.D.y"))
    with pytest.raises(ModelError) as caught:
        lagcli.load_text(VECTOR.replace("UNIT", "foo").replace("USED", "lambda.E.x"))
    assert any("no constraint `E.x`" in d.message for d in caught.value.diagnostics)
