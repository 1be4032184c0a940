"""Components, functions and bodies mean the same as the expressions that they stand for."""

from __future__ import annotations

import random
import re
import time
from pathlib import Path

import pytest

import lagcli
from lagcli.errors import ModelError
from lagcli.functions import FUNCTIONS

MODEL = """
coordinates: [x, y, z, phi]
parameters: {{m: 2, J: 3, k: 5}}
{functions}
definitions:
  r: [x, y^2, z*phi]
  R: rot_z(phi)*rot_x(x)
  P[i = 1..2]: [i*x, y, 0]
  A: {value}
T: m/2*(x'^2 + y'^2 + z'^2) + J/2*phi'^2
initial: {{x: 0, y: 0, z: 0, phi: 0, x': 0, y': 0, z': 0, phi': 0}}
outputs: {{out: {output}}}
"""


def value(text: str, functions: str = "", output: str = "0"):
    model = lagcli.load_text(MODEL.format(value=text, functions=functions, output=output))
    return model.definitions["A"].value


def entries(text: str, functions: str = ""):
    return value(text, functions).entries


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("r.x", "x"),
        ("r[2]", "y^2"),
        ("r.y'", "2*y*y'"),
        ("r'.y", "2*y*y'"),
        ("r.y_dot", "2*y*y'"),
        ("r_dot.y", "2*y*y'"),
        ("P[2].x", "2*x"),
        ("P[1 + 1][1]", "2*x"),
        ("R[1, 2]", "0 - sin(phi)*cos(x)"),
        ("(R*r).z", "dot([0, 0, 1], R*r)"),
        ("cross(r, P[1])[3]", "x*y - y^2*x"),
        ("[x, y].y", "y"),
        ("sum(P[i].x*r[i], i = 1..2)", "x*x + 2*x*y^2"),
        ("omega(R).x", "x'"),
        ("(rot_z(phi)).0", "cos(phi/2)"),
        ("(rot_z(phi)*rot_z(x)).3", "cos(phi/2)*sin(x/2) + sin(phi/2)*cos(x/2)"),
        ("sin(30 deg)", "1/2"),
        ("cos(x + 90 deg)", "0 - sin(x)"),
        ("diag(x, y, z)[2, 2]", "y"),
    ],
)
def test_component_is_that_of_the_vector(text: str, meaning: str) -> None:
    assert (value(text) - value(meaning)).expand() == 0


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("if(x > 0, r, P[1])", "[if(x > 0, x, x), if(x > 0, y^2, y), if(x > 0, z*phi, 0)]"),
        ("if(x > 0, R, R)", "R"),
        ("diag(1, x, 2)*r", "[x, x*y^2, 2*z*phi]"),
        ("[x, y] + [1, 2]*z", "[x + z, y + 2*z]"),
    ],
)
def test_vectors(text: str, meaning: str) -> None:
    assert entries(text) == entries(meaning)


@pytest.mark.parametrize(
    ("functions", "text", "meaning"),
    [
        ("f(u): u^2 + m", "f(x)", "x^2 + m"),
        ("f(u, v): u - v", "f(y, x)", "y - x"),
        ("f(u): m/2*u'^2", "f(x)", "m/2*x'^2"),
        ("f(u): u'", "f(x*y)", "x'*y + x*y'"),
        ("f(u): u'", "f(3)", "0"),
        ("f(u): u.y", "f(r)", "y^2"),
        ("f(u): u[2]'", "f(r)", "2*y*y'"),
        ("f(i): P[i].x", "f(2)", "2*x"),
        ("f(x): x + y", "f(z)", "z + y"),
        ("f(u): dot(u', u')", "f(r)", "dot(r', r')"),
        ("f(n): sum(P[i].x*n, i = 1..2)", "f(z)", "3*x*z"),
        ("f(u): g(u)^2\n  g(u): u + 1", "f(x)", "(x + 1)^2"),
        ("f(u): 2*u", "f(f(x))", "4*x"),
    ],
)
def test_function_is_expanded(functions: str, text: str, meaning: str) -> None:
    block = f"functions:\n  {functions}"
    assert (value(text, block) - value(meaning)).expand() == 0


def test_body_is_the_energy_of_translation_and_rotation() -> None:
    body = value("body(m, diag(1, 2, J), r, R)")
    meaning = "m/2*dot(r', r') + 1/2*dot(omega(R), diag(1, 2, J)*omega(R))"
    assert (body - value(meaning)).expand() == 0


def test_function_may_use_multipliers_where_outputs_do() -> None:
    text = MODEL.format(value="x", functions="functions: {f(u): u''}", output="f(x)")
    assert str(lagcli.load_text(text).outputs["out"]) == "x''"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("R.x", "row and column, as in `[2, 3]`"),
        ("r[4]", "a vector of 3 has no component number 4"),
        ("R[4, 1]", "a 3×3 matrix has no component number 4"),
        ("[x, y].z", "a vector of 2 has no component .z"),
        ("(x + y).x", "a scalar has no components"),
        ("(R*r).w", "the components of a vector are `.x`"),
        ("([[1, 0, 0], [0, 1, 0], [0, 0, 1]]).0", "the quaternion of a matrix is not known"),
        ("r.0", "`.0` belongs to the quaternion of a rotation"),
        ("if(x > 0, r, 0)", "the cases of if() must be of the same kind"),
        ("if(x > 0, r, [0, 0])", "the cases of if() must be of the same kind"),
        ("r[i]", "`i`"),
        ("r[1/2]", "whole number"),
        ("f(x)", "there is no function `f`"),
        ("body(m, J, r)", "write `body(m, J, r, R)`"),
        ("body(m, diag(1, 1, 1), r', R)", "cannot depend on accelerations"),
        ("omega(rot_x(x'))", "cannot depend on accelerations"),
    ],
)
def test_wrong_components(text: str, words: str) -> None:
    with pytest.raises(ModelError) as caught:
        value(text)
    assert words in str(caught.value)
    assert "A: " in str(caught.value)  # the line is shown


@pytest.mark.parametrize(
    ("functions", "text", "words"),
    [
        ("{f(u): g(u), g(u): f(u)}", "f(x)", "the function `f` calls itself: `f` → `g` → `f`"),
        ("{f(u): f(u)}", "x", "the function `f` calls itself"),
        ("{f(u): u + wrong}", "f(x)", "the function `f` uses `wrong`"),
        ("{f(u): u}", "f(x, y)", "`f` takes 1 argument, not 2"),
        ("{f(u): u}", "f", "`f`"),
        ("{f: u}", "x", "is not a function with its arguments"),
        ("{sin(u): u}", "x", "it is built in"),
        ("{body(u): u}", "x", "it is built in"),
        ("{m(u): u}", "x", "`m` is declared twice"),
        ("{f(2): 1}", "x", "`2` cannot be an argument"),
        ("{'f(u, u)': 1}", "x", "two arguments of the same name"),
        ("{f(u): }", "x", "is empty"),
    ],
)
def test_wrong_functions(functions: str, text: str, words: str) -> None:
    with pytest.raises(ModelError) as caught:
        value(text, f"functions: {functions}")
    assert words in str(caught.value)


def test_error_in_a_function_is_reported_once() -> None:
    with pytest.raises(ModelError) as caught:
        value("f(x) + f(y)", "functions: {f(u): u + wrong}")
    assert len(caught.value.diagnostics) == 1


def test_functions_that_double_are_bounded() -> None:
    block = "functions:\n  f0(u): u + u\n" + "".join(
        f"  f{i}(u): f{i - 1}(f{i - 1}(u))\n" for i in range(1, 8)
    )
    with pytest.raises(ModelError, match="parts"):
        value("f7(x)", block)


FOUND = Path(__file__).parents[3] / "found" / "nested_functions.yaml"


@pytest.mark.parametrize("backwards", [False, True])
def test_calls_are_counted_before_they_are_expanded(backwards: bool) -> None:
    text = FOUND.read_text()
    before, block, after = re.split(r"((?:  f\d+\(a\): .*\n)+)", text)
    lines = block.splitlines(keepends=True)
    text = before + "".join(reversed(lines) if backwards else lines) + after
    began = time.process_time()
    with pytest.raises(ModelError, match="more than 50,000 calls") as caught:
        lagcli.load_text(text)
    assert time.process_time() - began < 0.5  # 0.01 s alone
    (error,) = caught.value.diagnostics
    assert error.location is not None
    assert error.location.text.startswith("  f15(a):")  # 2 (2^15 − 1) calls
    assert error.location.column == 15


def chain(levels: int, body: str) -> str:
    lines = [f"  f{i}(u): {body.format(f'f{i - 1}(u)')}\n" for i in range(1, levels)]
    return "functions:\n  f0(u): u\n" + "".join(lines)


def test_functions_nest_as_deep_as_expressions() -> None:
    assert value("f199(x)", chain(200, "{} + 1")) == value("x + 199")
    assert value("f15(x)", chain(16, "f0({})")) == value("x")
    for body in ("{} + 1", "sin(2*{}) + 1"):
        with pytest.raises(ModelError, match="nested more than 200 levels") as caught:
            value("f1000(x)", chain(1001, body))
        assert len(caught.value.diagnostics) == 1


def test_an_error_in_a_function_has_the_place_of_the_call() -> None:
    functions = "functions:\n  f(u): u.w\n  g(u): 1 + f(u)\n  h(u): l(u)\n  l(u): 2*h(u)"
    with pytest.raises(ModelError) as caught:
        value("g(r) + h(x)", functions)
    places = {d.message: d.location for d in caught.value.diagnostics}
    component = places.pop("`u.w` is not a component")
    circular = places.pop("the function `h` calls itself: `h` → `l` → `h`")
    assert not places
    assert component is not None
    assert component.text[component.column - 1 :] == "f(u)"
    assert circular is not None
    assert circular.text[circular.column - 1 :] == "l(u)"


SAFE = {
    "asin": "0.3*sin({})",
    "acos": "0.3*sin({})",
    "atanh": "0.3*sin({})",
    "acosh": "2 + sin({})",
}
SAFE |= dict.fromkeys(("sqrt", "log", "log10", "log2", "pow"), "2 + sin({})")
SAFE |= dict.fromkeys(("exp", "exp2", "expm1", "log1p", "sinh", "cosh", "tan"), "sin({})")


@pytest.mark.parametrize("seed", range(20))
def test_functions_of_functions_are_what_they_stand_for(seed: int) -> None:
    draw = random.Random(seed)
    names = draw.sample(sorted(FUNCTIONS), 5)
    written, meaning = "functions:\n  f0(u): u\n", "x"
    for i, name in enumerate(names, 1):
        count = FUNCTIONS[name].fewest
        form = f"{name}({', '.join([SAFE.get(name, '{}')] * count)})/{i} + y"
        shown, plain = (form.replace("{}", part) for part in (f"f{i - 1}(u)", f"({meaning})"))
        written, meaning = f"{written}  f{i}(u): {shown}\n", plain
    assert value("f5(x)", written) == value(meaning)


def test_derivative_of_accelerations_is_rejected_in_outputs() -> None:
    with pytest.raises(ModelError, match="the highest derivative"):
        lagcli.load_text(MODEL.format(value="x", functions="", output="omega(rot_x(x''))[1]"))


def test_omega_of_an_angle_with_a_velocity_is_an_acceleration() -> None:
    model = lagcli.load_text(MODEL.format(value="x", functions="", output="omega(rot_x(x')).x"))
    assert str(model.outputs["out"]) == "x''"
