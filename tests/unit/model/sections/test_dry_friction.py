"""Forces with `sign`, and D with `abs`, as rows of dry friction; those that are none."""

from __future__ import annotations

import pytest
import symengine as se

import lagcli
from lagcli.model.model import Model


def model(forces: str, rest: str = "") -> Model:
    return lagcli.load_text(
        "coordinates: [x, y]\nparameters: {m: 1, F: 2, c: -3, w: 0.5}\n"
        f"T: m/2*(x'^2 + y'^2)\nQ: {{{forces}}}\n"
        f"initial: {{x: 0, y: 0, x': 1, y': 0}}\n{rest}"
    )


@pytest.mark.parametrize(
    ("forces", "row", "limit"),
    [
        ("x: -F*sign(x')", "x'", "F"),
        ("x: F*sign(-x')", "-x'", "F"),
        ("x: 3 - F*sign(x' - w*t)", "x' - w*t", "F"),
        ("x: -F*w*sign(x' - y'), y: F*w*sign(x' - y')", "x' - y'", "F*w"),
        ("x: -F*c^2*sign(x')", "x'", "F*c^2"),
        ("x: -(F + 2*x^2)*sign(x')", "x'", "F + 2*x^2"),
        ("x: -w*sign(2*x' + y'), y: -w/2*sign(2*x' + y')", "2*x' + y'", "w/2"),
        ("x: -F*exp(-y'^2)*sign(x')", "x'", "F*exp(-y'^2)"),
        ("x: '-max(c*y, w)*sign(x'')'", "x'", "max(c*y, w)"),
        ("x: -F*sqrt(x - 1)*sign(x')", "x'", "F*sqrt(x - 1)"),
        ("x: 2*y - (F + (F - c)*exp(-y))*sign(x')", "x'", "F + (F - c)*exp(-y)"),
    ],
)
def test_dissipative_signs_are_rows(forces: str, row: str, limit: str) -> None:
    found = model(forces)
    (constraint,) = found.constraints
    assert constraint.name == "x.sign"
    assert constraint.from_sign
    names = {s.name: s for s in constraint.expression.free_symbols}
    assert {x.rstrip("'") for x in names} <= {"x", "y", "w", "t"}
    text = str(constraint.expression).replace("**", "^")
    assert se.expand(constraint.expression - found_expression(found, row)) == 0, text
    assert constraint.limit is not None
    assert se.expand(constraint.limit.kinetic - found_expression(found, limit)) == 0
    assert constraint.limit.static == constraint.limit.kinetic
    assert not any("sign" in str(q) or "Piecewise" in str(q) for q in found.applied_forces.values())


def found_expression(found: Model, text: str) -> se.Basic:
    """Return an expression as an output of the model has it."""
    rest = f'outputs: {{o: "{text}"}}\n'
    return model("x: 0", rest).outputs["o"]


@pytest.mark.parametrize(
    "forces",
    [
        "x: F*sign(x')",  # it drives
        "x: -c*sign(x')",  # by its value
        "x: -F*sign(x)",  # of a position
        "x: -F*sign(x' - y')",  # with nothing on y
        "x: -F*x*sign(x')",  # may drive
        "x: -(w + (w - F)*exp(-x'^2))*sign(x')",  # drives while it is slow
        "x: '-max(c, x)*sign(x'')'",
        "x: -F*sign(x'^2 - 1)",  # not affine
        "x: -F*sign(abs(x') - 1)",
        "x: -F*sign(x')^2",
    ],
)
def test_other_signs_are_forces(forces: str) -> None:
    found = model(forces)
    assert found.constraints == ()
    assert "Piecewise" in str(found.applied_forces["x"])


@pytest.mark.parametrize(
    ("force", "static", "kinetic"),
    [
        ("-(w + (F - w)*exp(-(x'/0.1)^2))*sign(x')", "F", "w + (F - w)*exp(-(x'/0.1)^2)"),
        ("-(w + F*exp(-abs(x')))*sign(x')", "w + F", "w + F*exp(-abs(x'))"),
        ("-(w + abs(x' - 3))*sign(x' - w)", "w + abs(w - 3)", "w + abs(x' - 3)"),
        ("(1 + abs(2 - 2*x'))*sign(1 - x')", "1", "1 + abs(2 - 2*x')"),
    ],
)
def test_a_level_that_depends_on_the_slip_has_its_value_at_rest(
    force: str, static: str, kinetic: str
) -> None:
    (constraint,) = model(f"x: {force}").constraints
    assert constraint.limit is not None
    assert se.expand(constraint.limit.static - found_expression(model("x: 0"), static)) == 0
    assert se.expand(constraint.limit.kinetic - found_expression(model("x: 0"), kinetic)) == 0


def test_friction_of_a_constraint_is_proportional_to_its_multiplier() -> None:
    found = model("x: -w*abs(lambda.guide)*sign(x')", "constraints: {guide: y = 0}\n")
    row = found.constraints[1]
    assert (row.name, row.limit.normal) == ("x.sign", "guide")


def dissipative(energy: str) -> Model:
    return lagcli.load_text(
        "coordinates: [x, y]\nparameters: {m: 1, F: 2, c: -3, w: 0.5}\n"
        f"T: m/2*(x'^2 + y'^2)\nD: {energy}\ninitial: {{x: 0, y: 0, x': 1, y': 0}}\n"
    )


@pytest.mark.parametrize(
    ("energy", "name", "row", "limit"),
    [
        ("F*abs(x')", "x.sign", "x'", "F"),
        ("w*x'^2 + (F + x^2)*abs(y' - x')", "x.sign", "y' - x'", "F + x^2"),
        ("F*abs(2*y')", "y.sign", "2*y'", "F"),
    ],
)
def test_magnitudes_in_d_are_rows(energy: str, name: str, row: str, limit: str) -> None:
    found = dissipative(energy)
    (constraint,) = found.constraints
    assert (constraint.name, constraint.from_sign) == (name, True)
    of = model("x: 0")
    assert abs(constraint.expression) == abs(found_expression(of, row))
    assert constraint.limit.static == constraint.limit.kinetic == found_expression(of, limit)
    assert "Piecewise" not in str(found.dissipation)
    assert constraint.location.line == 4


@pytest.mark.parametrize(
    "energy", ["c*abs(x')", "F*abs(x)", "F*abs(x')^2/2 + w*abs(x' + y')^3", "abs(y')*abs(x')"]
)
def test_other_magnitudes_in_d_are_damping(energy: str) -> None:
    found = dissipative(energy)
    assert found.constraints == ()
    assert found.dissipation != 0


def test_two_signs_on_one_coordinate_are_two_rows() -> None:
    found = model("x: -F*sign(x') - w*sign(x' - y'), y: w*sign(x' - y')")
    assert {c.name for c in found.constraints} == {"x.sign", "x.sign2"}


def test_check_and_derive_report_it() -> None:
    from lagcli.equations.derivation.lagrange import derive
    from lagcli.equations.presentation.overview import kind_of

    equations = derive(model("x: -F*sign(x')"))
    said = kind_of(equations.constraints[0], equations)
    assert said == "dry friction, written as `sign` in Q: it sticks or slips"
