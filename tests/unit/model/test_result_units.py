"""Units by the names of columns, and units that are not SI."""

from __future__ import annotations

import math

import pytest

import lagcli
from lagcli.model.result_units import given_units, result_units, stored_units

MODEL = """
coordinates: {x: m, phi: rad, s: }
parameters: {m: {value: 1, unit: kg}, J: {value: 1, unit: kg*m^2}, r: {value: 5, unit: cm}}
T: m*x'^2/2 + J*phi'^2/2 + m*s'^2/2
constraints: {roll: x' = r*phi', stop: x = r}
outputs: {power: {expr: x'^2, unit: W}, ratio: phi}
initial: {x: {guess: 0}, phi: 0, s: 0, x': {guess: 0}, phi': {guess: 0}, s': 0}
"""


def test_units_are_si_and_by_the_columns_of_results() -> None:
    units = result_units(lagcli.load_text(MODEL))
    assert (units["x"], units["phi"]) == ("m", "rad")
    assert units["r"] == "m"  # whatever the file has it in
    assert units["lambda.stop"] == "N"
    assert units["residual_position.stop"] == "m"
    assert units["residual_velocity.stop"] == units["residual_velocity.roll"] == "m/s"
    assert units["power"] == "W"


def test_what_has_no_unit_or_no_column_is_not_there() -> None:
    units = result_units(lagcli.load_text(MODEL))
    assert "s" not in units
    assert "residual_position.roll" not in units  # nonholonomic


GIVEN = """
coordinates: {phi: rad}
parameters: {J: 2 kg m^2, Omega: 3000 rpm, l: 30 cm, k: 1 N m/rad, m: 1 kg, g: 9.81 m/s^2}
T: J*(phi' + Omega)^2/2
V: k*phi^2/2 + m*g*l*cos(phi)
initial: {phi: 30 deg, phi': 0 rad/s}
"""


def test_units_other_than_si_have_their_factors() -> None:
    found = given_units(lagcli.load_text(GIVEN))
    assert {name: x.unit for name, x in found.items()} == {
        "Omega": "rpm",
        "l": "cm",
        "phi": "deg",
    }
    assert found["Omega"].factor == pytest.approx(2 * math.pi / 60)
    assert found["phi"].factor == pytest.approx(math.pi / 180)


def test_results_have_them() -> None:
    model = lagcli.load_text(GIVEN)
    display = lagcli.simulate(model, t_end=0.1).display
    assert stored_units(display) == given_units(model)
    assert stored_units({}) == {}
