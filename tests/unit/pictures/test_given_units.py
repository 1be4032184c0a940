"""Units of parameters and initial values as the model file has them."""

from __future__ import annotations

import math

import pytest

import lagcli
from lagcli.model.given_units import given_units, stored_units

MODEL = """
coordinates: {phi: rad}
parameters: {J: 2 kg m^2, Omega: 3000 rpm, l: 30 cm, k: 1 N m/rad, m: 1 kg, g: 9.81 m/s^2}
T: J*(phi' + Omega)^2/2
V: k*phi^2/2 + m*g*l*cos(phi)
initial: {phi: 30 deg, phi': 0 rad/s}
"""


def test_units_other_than_si_have_their_factors() -> None:
    found = given_units(lagcli.load_text(MODEL))
    assert {name: x.unit for name, x in found.items()} == {
        "Omega": "rpm",
        "l": "cm",
        "phi": "deg",
    }
    assert found["Omega"].factor == pytest.approx(2 * math.pi / 60)
    assert found["phi"].factor == pytest.approx(math.pi / 180)


def test_results_have_them() -> None:
    model = lagcli.load_text(MODEL)
    display = lagcli.simulate(model, t_end=0.1).display
    assert stored_units(display) == given_units(model)
    assert stored_units({}) == {}
