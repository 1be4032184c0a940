"""The declarations of columns: their names, units and panels, and that all derived ones exist."""

from __future__ import annotations

import re
from dataclasses import fields
from inspect import getdoc
from pathlib import Path

import pytest
from symengine import Basic

from lagcli.columns import (
    BY_NAME,
    PANELS,
    QUANTITIES,
    SAMPLED,
    SCALARS,
    ColumnName,
    Columns,
    column_names,
    read_column_name,
    read_dotted_name,
    unit_quotient,
)
from lagcli.equations.derivation.column_expressions import (
    FROM_ENTRIES,
    REPORTED,
    column_expression,
)
from lagcli.equations.derivation.lagrange import derive
from lagcli.model.loader import load

MODELS = Path(__file__).parents[2] / "models"
COORDINATES = ("phi", "x[3]", "x_dot", "energy", "r.x", "q[1].y", "u[1,2]")
CONSTRAINTS = ("guide", "rod[2]", "pin.x", "next[2].z", "e.unit")
CONSERVED = ("p_phi",)
TERMS = (("guide", "phi"), ("rod[2]", "x[3]"), ("pin.x", "r.x"), ("next[2].z", "phi"))
NAMES = {
    "t": ColumnName("time"),
    "phi": ColumnName("q", "", "phi"),
    "x_dot": ColumnName("q", "", "x_dot"),
    "x_dot_dot": ColumnName("v", "", "x_dot"),
    "x[3]_ddot": ColumnName("a", "", "x[3]"),
    "lambda.rod[2]": ColumnName("multipliers", "rod[2]"),
    "Qc.phi": ColumnName("constraint_force", "", "phi"),
    "Qc.guide.x[3]": ColumnName("constraint_force_by", "guide", "x[3]"),
    "lambda.pin.x": ColumnName("multipliers", "pin.x"),
    "r.x_dot": ColumnName("v", "", "r.x"),
    "u[1,2]": ColumnName("q", "", "u[1,2]"),
    "Qc.r.x": ColumnName("constraint_force", "", "r.x"),
    "Qc.pin.x.r.x": ColumnName("constraint_force_by", "pin.x", "r.x"),
    "Qc.pin.x.phi": ColumnName("constraint_force_by", "pin.x", "phi"),
    "Qc.guide.q[1].y": ColumnName("constraint_force_by", "guide", "q[1].y"),
    "residual_position.next[2].z": ColumnName("residual_position", "next[2].z"),
    "energy_total": ColumnName("energy_total"),
    "residual_velocity.guide": ColumnName("residual_velocity", "guide"),
}


@pytest.mark.parametrize("text", NAMES)
def test_names_are_written_and_read(text: str) -> None:
    assert str(NAMES[text]) == text
    assert read_column_name(text, COORDINATES, CONSTRAINTS) == NAMES[text]


@pytest.mark.parametrize("text", NAMES)
def test_first_part_of_a_name_says_that_it_is_no_coordinate(text: str) -> None:
    found = read_dotted_name(text)
    if text.startswith("Qc."):  # which constraint and coordinate it names is another question
        assert found is not None
        assert found.quantity.startswith("constraint_force")
    elif text.partition(".")[0] in ("lambda", "residual_position", "residual_velocity"):
        assert found == NAMES[text]
    else:
        assert found is None


@pytest.mark.parametrize(
    "text", ["psi", "phi_dddot", "lambda.pin", "Qc.guide", "Qc.a.phi", "q", ""]
)
def test_other_texts_are_no_columns(text: str) -> None:
    assert read_column_name(text, COORDINATES, CONSTRAINTS) is None


def test_every_column_has_a_name_of_its_own() -> None:
    axes = COORDINATES, CONSTRAINTS, TERMS, CONSERVED
    names = [n for q in SAMPLED for n in column_names(q, *axes)]
    assert len(set(map(str, names))) == len(names)
    assert [read_column_name(str(n), COORDINATES, CONSTRAINTS, CONSERVED) for n in names] == names


@pytest.mark.parametrize(
    ("name", "units"),
    [
        ("q", {"rad": "rad", "1": "1", "kg*m^2": "kg*m^2"}),
        ("v", {"m": "m/s", "1": "1/s", "kg*m^2": "kg*m^2/s", "m/s": "(m/s)/s"}),
        ("a", {"m": "m/s^2"}),
        ("constraint_force", {"m": "N", "rad": "N*m", "1": "J", "kg*m^2": "J/(kg*m^2)"}),
        ("energy_total", {"m": "J"}),
    ],
)
def test_units_follow_from_those_of_the_coordinates(name: str, units: dict[str, str]) -> None:
    assert {u: BY_NAME[name].unit_at(u) for u in units} == units
    assert BY_NAME[name].unit_at(None) == ("J" if name == "energy_total" else None)


@pytest.mark.parametrize(
    ("unit", "by", "quotient"),
    [
        ("m", "s", "m/s"),
        ("m/s", "s", "(m/s)/s"),
        ("kg*m^2/s", "kg", "(kg*m^2/s)/kg"),
        ("J", "kg*m", "J/(kg*m)"),
        ("N", "rad/s", "N/(rad/s)"),
        ("m", "s^2", "m/s^2"),
        ("N*m", "m", "N*m/m"),
        ("1", "s", "1/s"),
        ("", "kg", "1/kg"),
        ("N", "1", "N"),
    ],
)
def test_the_unit_of_a_quotient(unit: str, by: str, quotient: str) -> None:
    assert unit_quotient(unit, by) == quotient


def test_files_have_the_columns_that_the_documentation_names() -> None:
    header = (
        "t phi phi_dot phi_ddot lambda.guide Qc.phi Qc.guide.phi energy_kinetic energy_potential"
        " energy_total power_applied power_constraint power_time power_friction energy_balance"
        " residual_position.guide residual_velocity.guide residual_equation conserved.p_phi"
    )
    named = [column_names(q, ["phi"], ["guide"], [("guide", "phi")], ["p_phi"]) for q in SAMPLED]
    assert " ".join(str(name) for names in named for name in names) == header


def test_declarations_are_complete() -> None:
    stored = [q.name for q in SAMPLED if q.name != "constraint_force"]
    assert stored == [f.name for f in fields(Columns)]
    # Python 3.13 removes the indentation of docstrings
    documented = re.findall(r"^(\w[\w, ]*) : \(", getdoc(Columns) or "", re.MULTILINE)
    assert ", ".join(documented).split(", ") == stored
    assert len({q.name for q in QUANTITIES}) == len(QUANTITIES)
    assert {q.name for panel in PANELS.values() for q in panel} == {q.name for q in SAMPLED[1:]}


def test_scalars_are_expressions_of_the_sample() -> None:
    equations = derive(load(MODELS / "slider_crank.yaml"))
    for quantity in SCALARS:
        assert isinstance(column_expression(equations, quantity.name), Basic)
    assert {*REPORTED, *FROM_ENTRIES} == {quantity.name for quantity in SCALARS}
