"""Numbers with units, in files whose parameters have the names of units."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.errors import ModelError
from lagcli.model.loader import load_text

FOUND = Path(__file__).parents[3] / "found"

MODEL = """
coordinates: [x]
parameters: {{N: 3, g: 9.81, m: 2, m2: 5, s: 4, p: {value}}}
T: m/2*x'^2
V: {potential}
initial: {{x: 0, x': 0}}
"""


def value(text: str) -> float:
    return load_text(MODEL.format(value=text, potential="p*x")).parameters["p"].value


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 N*m^2", 1.0),
        ("2 g*m^2", 2e-3),
        ("3 m/s", 3.0),
        ("3m/s", 3.0),
        ("4 g", 4e-3),
        ("5 m2", 5.0),
        ("5 N/m2", 5.0),
        ("6 s", 6.0),
        ("6 N s", 6.0),
        # products
        ("2*g", 19.62),
        ("2*g*m^2", 78.48),
        ("N*m2", 15.0),
        ("2*m2", 10.0),
    ],
)
def test_a_unit_after_a_number_is_one_whatever_parameters_are_called(
    text: str, expected: float
) -> None:
    assert value(text) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize("text", ["2 N*x", "2 m2*g*x", "2m2*kk", "7 N*m*kk"])
def test_what_is_no_unit_and_begins_with_a_name_is_a_product(text: str) -> None:
    with pytest.raises(ModelError, match=r"is not a number with a unit\n") as caught:
        value(text)
    number, product = text[0], text[1:].strip()
    assert f"write a product as `{number}*{product}`" in str(caught.value)


def test_in_an_expression_a_number_has_no_unit() -> None:
    with pytest.raises(ModelError, match="an operator is missing between `2` and `g`") as caught:
        load_text(MODEL.format(value="1", potential="2 g*m"))
    text = str(caught.value)
    assert "write 2 g*m as `0.002`" in text
    assert "if `g` is a name and not a unit, write a product as `2*g`" in text


def test_a_beam_beside_the_number_of_its_members() -> None:
    model = lagcli.load(FOUND / "unit_beside_parameter.yaml")
    assert model.parameters["EI"].value == 1.0
    assert model.parameters["EI"].unit == "N*m^2"
    assert model.units.of("EI") == "N*m^2"
    run = lagcli.simulate(model, t_end=1.0, samples=11, rtol=1e-10)
    # each member alone: w^2 = 3 EI N^4/(M L^3)
    expected = 0.1 * np.cos(np.sqrt(3 * 3**4) * run.time)
    np.testing.assert_allclose(run.q, np.column_stack([expected] * 3), atol=1e-8)


@pytest.mark.parametrize(
    ("text", "meters", "power"),
    [
        ("ms^-2", 1.0, 1e6),
        ("ms^-1", 1.0, 1e3),
        ("ms2", 1.0, 1e-6),
        ("ms^3", 1.0, 1e-9),
        ("mN^-1", 1.0, 1e3),
        ("mrad^-2", 1.0, 1e6),
        ("kg ms^-2", 1.0, 1e6),
        ("kg/ms^2", 1.0, 1e6),
        ("m/ms^3", 1.0, 1e9),
        ("N/ms^-1", 1.0, 1e-3),
        ("1/ms^2", 1.0, 1e6),
    ],
)
def test_both_ways_to_write_a_doubtful_power_are_accepted(
    text: str, meters: float, power: float
) -> None:
    with pytest.raises(ModelError, match="is ambiguous: write ") as caught:
        value(f"3 {text}")
    ways = re.search("write (.*?) with meters, (.*?) for a power", str(caught.value))
    assert ways is not None
    for way, factor in zip(ways.groups(), (meters, power), strict=True):
        written = re.sub(r"m(s|N|rad)\^?-?[0-9]", way, text)
        assert value(f"3 {written}") == pytest.approx(3 * factor, rel=1e-15), written


def test_a_power_of_a_doubtful_unit_is_refused_with_its_place() -> None:
    with pytest.raises(ModelError) as caught:
        lagcli.load(FOUND / "ms_power.yaml")
    text = str(caught.value)
    assert (
        "ms_power.yaml:3:28: error[unknown-unit]: the parameter `g`: `ms^-2` is ambiguous" in text
    )
    assert "help: units are written as `kg`" in text
    assert "write m*s^-2 with meters, 1/(ms)^2 for a power of ms" in text
    written = (FOUND / "ms_power.yaml").read_text(encoding="utf-8")
    for unit, factor in (("m*s^-2", 1.0), ("1/(ms)^2", 1e6), ("m s^-2", 1.0)):
        model = load_text(written.replace("ms^-2", unit))
        assert model.parameters["g"].value == pytest.approx(9.81 * factor, rel=1e-15)
