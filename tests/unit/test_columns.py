"""The declarations of columns: their names, units and panels, and that all derived ones exist."""

from __future__ import annotations

import re
from dataclasses import fields
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
)
from lagcli.equations.derivation.column_expressions import (
    FROM_ENTRIES,
    REPORTED,
    column_expression,
)
from lagcli.equations.derivation.lagrange import derive
from lagcli.model.loader import load

MODELS = Path(__file__).parents[2] / "models"
COORDINATES = ("phi", "x[3]", "x_dot", "energy")
CONSTRAINTS = ("guide", "rod[2]")
TERMS = (("guide", "phi"), ("rod[2]", "x[3]"))
NAMES = {
    "t": ColumnName("time"),
    "phi": ColumnName("q", "", "phi"),
    "x_dot": ColumnName("q", "", "x_dot"),
    "x_dot_dot": ColumnName("v", "", "x_dot"),
    "x[3]_ddot": ColumnName("a", "", "x[3]"),
    "lambda.rod[2]": ColumnName("multipliers", "rod[2]"),
    "Qc.phi": ColumnName("constraint_force", "", "phi"),
    "Qc.guide.x[3]": ColumnName("constraint_force_by", "guide", "x[3]"),
    "energy_total": ColumnName("energy_total"),
    "residual_velocity.guide": ColumnName("residual_velocity", "guide"),
}


@pytest.mark.parametrize("text", NAMES)
def test_names_are_written_and_read(text: str) -> None:
    assert str(NAMES[text]) == text
    assert read_column_name(text, COORDINATES, CONSTRAINTS) == NAMES[text]
    dotted = NAMES[text] if "." in text else None
    assert read_dotted_name(text) == dotted


@pytest.mark.parametrize(
    "text", ["psi", "phi_dddot", "lambda.pin", "Qc.guide", "Qc.a.phi", "q", ""]
)
def test_other_texts_are_no_columns(text: str) -> None:
    assert read_column_name(text, COORDINATES, CONSTRAINTS) is None


def test_every_column_has_a_name_of_its_own() -> None:
    names = [n for q in SAMPLED for n in column_names(q, COORDINATES, CONSTRAINTS, TERMS)]
    assert len(set(map(str, names))) == len(names)
    assert [read_column_name(str(n), COORDINATES, CONSTRAINTS) for n in names] == names


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


def test_files_have_the_columns_that_the_documentation_names() -> None:
    header = (
        "t phi phi_dot phi_ddot lambda.guide Qc.phi Qc.guide.phi energy_kinetic energy_potential"
        " energy_total power_applied power_constraint power_time energy_balance"
        " residual_position.guide residual_velocity.guide residual_equation"
    )
    named = [column_names(q, ["phi"], ["guide"], [("guide", "phi")]) for q in SAMPLED]
    assert " ".join(str(name) for names in named for name in names) == header


def test_declarations_are_complete() -> None:
    stored = [q.name for q in SAMPLED if q.name != "constraint_force"]
    assert stored == [f.name for f in fields(Columns)]
    documented = re.findall(r"^    (\w[\w, ]*) : \(", Columns.__doc__ or "", re.MULTILINE)
    assert ", ".join(documented).split(", ") == stored
    assert len({q.name for q in QUANTITIES}) == len(QUANTITIES)
    assert {q.name for panel in PANELS.values() for q in panel} == {q.name for q in SAMPLED[1:]}


def test_scalars_are_expressions_of_the_sample() -> None:
    equations = derive(load(MODELS / "slider_crank.yaml"))
    for quantity in SCALARS:
        assert isinstance(column_expression(equations, quantity.name), Basic)
    assert {*REPORTED, *FROM_ENTRIES} == {quantity.name for quantity in SCALARS}
