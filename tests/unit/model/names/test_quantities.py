"""Numbers with units are exact until the last step."""

from __future__ import annotations

import math

import pytest
import symengine as se

from lagcli.errors import ModelError
from lagcli.model.expression.constants import constant
from lagcli.model.loader import load_text


def parameter(text: str) -> float:
    given = f"coordinates: [x]\nparameters: {{n: 2, n2: 2, p: {text}}}"
    model = f"{given}\nT: p*x'^2\ninitial: {{x: 0, x': 0}}"
    return load_text(model).parameter_values["p"]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("7 mm", 0.007),  # 7 · 0.001 is 0.007 in doubles by luck only
        ("3.3 cm", 0.033),
        ("1.1e3 mm", 1.1),
        ("{value: 3*n, unit: mm}", 0.006),
        ("-0.3 km", -300.0),
        ("−0.3 km", -300.0),
        ("180 deg", math.pi),
        ("72 km/h", 20.0),
        (".5e-3 kg", 0.0005),
    ],
)
def test_quantities_are_the_nearest_doubles(text: str, value: float) -> None:
    assert parameter(text) == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0x1F", "is not a number"),
        ("2 n", "write a product as `2*n`"),
        ("2 smoot", "smoot"),
        ("2 n2", "write a product as `2*n2`"),  # a parameter, not a power of a unit
        ("2 N-m", "write a product of units as `N*m`"),
        ("20 °C", "293.15 K"),
        ("{value: 2 m, unit: m}", "two units"),
        ("1e308 km", "not a real, finite number"),
        ("{value: sqrt(-n), unit: m}", "not a real number"),
    ],
)
def test_what_is_no_quantity_is_rejected(text: str, message: str) -> None:
    with pytest.raises(ModelError) as caught:
        parameter(text)
    assert message in str(caught.value.diagnostics[0].render())


def test_whole_numbers_stay_whole() -> None:
    assert constant(3.0) == se.Integer(3)
    assert constant(0.5) == se.RealDouble(0.5)
    assert isinstance(constant(1e300), se.RealDouble)
