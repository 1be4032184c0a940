"""Names of varied quantities, and factors to SI."""

from __future__ import annotations

from fractions import Fraction

import pytest

import lagcli
from lagcli.errors import UsageError
from lagcli.sweeps.plan.vary import si_factor, varied_name

MODEL = lagcli.load_text("""
coordinates: [x, "p[1..2]"]
parameters: {m: 2, l: {value: 3, unit: cm}, g: {value: 9.81, unit: m/s^2}, x_dot0: 1}
T: m*x'^2/2 + sum(p[i]'^2, i = 1..2)
V: g*l*x*x_dot0
initial: {x: 0, "x'": 0, "p[i = 1..2]": i, "p[i = 1..2]'": 0}
""")


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("m", "m"),
        (" x ' ", "x'"),
        ("x_dot", "x'"),
        ("x", "x"),
        ("p[ 2 ]", "p[2]"),
        ("p[2]'", "p[2]'"),
        ("p_dot[2]", "p[2]'"),
        ("p[2]_dot", "p[2]'"),
        ("x_dot0", "x_dot0"),
    ],
)
def test_names_are_read_as_people_write_them(text: str, name: str) -> None:
    assert varied_name(MODEL, text) == name


@pytest.mark.parametrize("text", ["q", "p", "p[3]", "m'", "p_dot", "x''", ""])
def test_other_names_are_errors(text: str) -> None:
    with pytest.raises(UsageError, match="no parameter or initial value"):
        varied_name(MODEL, text)


def test_factors_are_exact_and_units_must_be_given_where_the_file_has_another() -> None:
    assert si_factor(MODEL, "l", "mm") == Fraction(1, 1000)
    assert si_factor(MODEL, "m", None) == si_factor(MODEL, "g", None) == 1
    assert si_factor(MODEL, "x", None) == 1
    with pytest.raises(UsageError, match="`l` is given in cm in the file"):
        si_factor(MODEL, "l", None)


@pytest.mark.parametrize(("name", "unit"), [("g", "m"), ("l", "kg"), ("g", "1/s^2"), ("l", "Nm")])
def test_units_have_the_dimension_of_the_file(name: str, unit: str) -> None:
    with pytest.raises(UsageError, match=f"`{name}` is in .* in the file, and in "):
        si_factor(MODEL, name, unit)


def test_initial_values_have_the_dimension_of_their_coordinate() -> None:
    model = lagcli.load_text("coordinates: {x: m}\nT: x'^2/2\nV: 0\ninitial: {x: 0, x': 0}\n")
    assert si_factor(model, "x", "cm") == Fraction(1, 100)
    assert si_factor(model, "x'", "km/h") == Fraction(5, 18)
    for name, unit in (("x", "m/s"), ("x'", "m")):
        with pytest.raises(UsageError, match="in the file, and in"):
            si_factor(model, name, unit)
