"""Unit notation → factor to SI."""

from __future__ import annotations

import math
import subprocess
import sys
from fractions import Fraction

import pytest

from lagcli.model.expression.units import UnknownUnit, si_notation, to_si


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("kg", 1),
        ("g", Fraction(1, 1000)),
        ("mm", Fraction(1, 1000)),
        ("m/s^2", 1),
        ("m/s**2", 1),
        ("m s^-2", 1),
        ("m·s²", 1),
        ("kg*m^2/s^3", 1),
        ("1/s", 1),
        ("kN/mm", 1_000_000),
        ("N/(m*s)", 1),
        ("mm^2/(ms*g)", Fraction(1, 10**6) / (Fraction(1, 1000) * Fraction(1, 1000))),
        ("cm^3", Fraction(1, 10**6)),
        ("km/h", Fraction(1000, 3600)),
        ("µm", Fraction(1, 10**6)),
        ("μm", Fraction(1, 10**6)),
        ("um", Fraction(1, 10**6)),
        ("deg", math.pi / 180),
        ("°", math.pi / 180),
        ("deg/s", math.pi / 180),
        ("rad", 1),
        ("T", 1),
        ("mT", Fraction(1, 1000)),
        ("min", 60),
        ("m/ms*g", 1),  # (m/ms)·g, from the left
        ("inch", 0.0254),
        ("lbf*inch", 4.4482216152605 * 0.0254),
        ("rpm", math.pi / 30),
        ("metre", 1),
    ],
)
def test_factor(unit: str, factor: float) -> None:
    found = to_si(unit)
    if isinstance(factor, float):
        assert math.isclose(found, factor, rel_tol=1e-15)
    else:
        assert found == factor


@pytest.mark.parametrize(
    "unit",
    [
        *("", "kgg", "q", "m^^2", "kg^9^9", "kg^999", "(m", "m)", "m*", "/m", "*", "2", "m 2"),
        *("m^x", "m + m", "9^9^9", "1 9**9**9", "__import__('os')", "m;s", "m" * 1000, "°C·"),
        "kg^-",
    ],
)
def test_no_unit(unit: str) -> None:
    with pytest.raises(UnknownUnit, match="is not a unit"):
        to_si(unit)


def test_an_offset_is_rejected() -> None:
    with pytest.raises(UnknownUnit, match="has an offset"):
        to_si("degC")
    assert to_si("delta_degC") == 1


def test_what_no_double_holds_is_rejected() -> None:
    with pytest.raises(UnknownUnit, match="too large or too small"):
        to_si("GHz^99")


def test_pint_is_loaded_only_for_what_the_table_lacks() -> None:
    script = (
        "import sys; from lagcli.model.expression.units import to_si\n"
        "[to_si(u) for u in ('kg*m^2/s^2', 'deg', 'kN', 'mm', 'km/h')]\n"
        "print('pint' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "False"


@pytest.mark.parametrize(
    ("unit", "si"),
    [
        ("deg/s", "rad/s"),
        ("mm", "m"),
        ("kN/m", "N/m"),
        ("g*cm^2", "kg*m^2"),
        ("ft", "m"),
        ("L^2", "(m^3)^2"),
        ("1/min", "1/s"),
        ("kg*m^2/s^2", "kg*m^2/s^2"),
    ],
)
def test_si_notation_names_the_unit_of_the_converted_value(unit, si):
    assert si_notation(unit) == si
    assert to_si(si_notation(unit)) == 1
