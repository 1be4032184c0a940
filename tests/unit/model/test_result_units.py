"""Units by the names of columns."""

from __future__ import annotations

import lagcli
from lagcli.model.result_units import result_units

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
