"""Names and units in the outputs."""

from __future__ import annotations

import pytest

from lagcli.equations.typesetting.notation import unit_text


@pytest.mark.parametrize(
    ("unit", "shown"),
    [
        ("N*m^2", "N·m²"),
        ("kg/m^4", "kg/m⁴"),
        ("m**3/s", "m³/s"),
        ("K^-12", "K⁻¹²"),
        ("rad/s", "rad/s"),
    ],
)
def test_exponents_are_raised(unit: str, shown: str) -> None:
    assert unit_text(unit) == shown
    assert unit_text(unit, " ") == shown.replace("·", " ")
