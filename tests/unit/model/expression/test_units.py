"""Unit notation → factor to SI."""

from __future__ import annotations

import math
from fractions import Fraction

import pint
import pytest

from lagcli.model.expression.dimension import Dimension, same
from lagcli.model.expression.unit_table import REFUSED, compounds, units
from lagcli.model.expression.units import (
    UnknownUnit,
    commensurable,
    plain_notation,
    read_unit,
    remedy,
    si_notation,
    to_si,
)
from tests.support.written_units import REFUSED as REFUSED_TEXTS
from tests.support.written_units import WRITTEN


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
        *("m^x", "m + m", "9^9^9", "1 9**9**9", "__import__('os')", "m;s", "m" * 1000, "m1", "m10"),
        *("kg^-", "s-1", "Nmx", "KN", "NM", "PSi", "°°", "% "),
    ],
)
def test_no_unit(unit: str) -> None:
    with pytest.raises(UnknownUnit, match="is not a unit"):
        to_si(unit)


@pytest.mark.parametrize(("unit", "factor", "si"), WRITTEN)
def test_what_engineers_write_is_what_they_mean(unit: str, factor: float, si: str) -> None:
    found = read_unit(unit)
    assert math.isclose(found.factor, factor, rel_tol=1e-15)
    assert same(found.dimension, read_unit(si).dimension)


@pytest.mark.parametrize(
    ("unit", "reason"),
    REFUSED_TEXTS,
)
def test_what_has_several_readings_is_refused_with_the_reason(unit: str, reason: str) -> None:
    with pytest.raises(UnknownUnit, match=reason):
        read_unit(unit)


@pytest.mark.parametrize("unit", ["Nm", "N*m", "kN mm", "lbf*ft", "Nm/rad", "N·m", "N.m", "J/rad"])
def test_a_torque_is_an_energy_per_angle(unit: str) -> None:
    assert read_unit(unit).dimension.rad == -1 - unit.count("/rad") * (unit[0] == "N")


@pytest.mark.parametrize(("unit", "dimension"), [("m^0", Dimension()), ("s*m^0", Dimension(s=1))])
def test_a_power_of_zero_is_no_unit(unit: str, dimension: Dimension) -> None:
    assert same(read_unit(unit).dimension, dimension)


def test_a_table_marks_numbers_by_a_dash() -> None:
    assert to_si("-") == to_si("–") == to_si("1") == 1
    assert read_unit("-").dimension == read_unit("1").dimension


@pytest.mark.parametrize(
    ("unit", "other", "fits"),
    [
        ("Hz", "1/s", True),
        ("kHz", "Hz", True),
        ("1/s", "rad/s", True),
        ("deg*Hz", "rad/s", True),
        ("N/(m*Hz)", "N*s/m", True),
        ("Hz", "rad/s", False),
        ("megahertz", "rpm", False),
        ("Hz^2", "rad/s^2", False),
        ("Hz/s", "deg/s^2", False),
        ("rev/s", "Hz", False),
        ("m*Hz", "m/s", True),
    ],
)
def test_hertz_are_no_unit_of_rates_of_rotation(unit: str, other: str, fits: bool) -> None:
    assert commensurable(unit, other) == commensurable(other, unit) == fits
    assert ("rev/s" in remedy(other, unit)) == (not fits and "z" in unit)


@pytest.mark.parametrize("unit", ["N*m/Hz", "Nm/kHz", "kNm/hertz", "N/Hz*m", "Hz/(N*m)"])
def test_a_torque_per_hertz_is_refused(unit: str) -> None:
    with pytest.raises(UnknownUnit, match=r"1 rad/s or a turn per second; write N\*m\*s/rad"):
        read_unit(unit)


@pytest.mark.parametrize(
    ("unit", "plain"),
    [("N/mm²", "N/mm^2"), ("s⁻¹", "s^-1"), ("kg·m2", "kg*m^2"), ("º/s", "°/s"), ("m^2", "m^2")],
)
def test_plain_notation(unit: str, plain: str) -> None:
    assert plain_notation(unit) == plain
    assert read_unit(plain)[:2] == read_unit(unit)[:2]


def test_what_no_double_holds_is_rejected() -> None:
    with pytest.raises(UnknownUnit, match="too large or too small"):
        to_si("GHz^99")


@pytest.mark.parametrize(
    ("unit", "si"),
    [
        ("deg/s", "rad/s"),
        ("mm", "m"),
        ("kN/m", "N/m"),
        ("g*cm^2", "kg*m^2"),
        ("ft", "m"),
        ("L^2", "m^6"),
        ("m/min", "m/s"),
        ("kNm/deg", "N*m/rad"),
        ("1/kNm^2", "1/(N*m^2)"),
        ("MPa*mm^(1/2)", "Pa*m^(1/2)"),
        ("rpm", "rad/s"),
        ("Nm", "N*m"),
        ("kgm²", "kg*m^2"),
        ("m·s⁻²", "m/s^2"),
        ("-", "1"),
        ("mm/cm", "1"),
        ("kg*m^2/s^2", "kg*m^2/s^2"),
        ("kg*(m/s)^2", "kg*(m/s)^2"),  # as it is written
        ("s^-2*kg", "s^-2*kg"),
    ],
)
def test_si_notation_names_the_unit_of_the_converted_value(unit, si):
    assert si_notation(unit) == si
    assert to_si(si_notation(unit)) == 1


#: What Pint calls the units whose symbols mean something else there, or nothing.
ELSEWHERE = {
    **{"PS": "metric_horsepower", "U": "turn", "rev": "turn", "revolution": "turn"},
    **{"revolutions": "turn", "kp": "kgf", "lbm": "lb", "Å": "angstrom", "rps": "turn/second"},
}
_BASES = {
    **{"kilogram": "kg", "meter": "m", "second": "s", "ampere": "A", "kelvin": "K"},
    **{"mole": "mol", "candela": "cd", "radian": "rad"},
}


@pytest.fixture(scope="module")
def registry() -> pint.UnitRegistry:
    return pint.UnitRegistry(cache_folder=None)


def of_pint(registry: pint.UnitRegistry, text: str) -> tuple[float, Dimension]:
    quantity = registry.Quantity(1.0, registry.parse_units(text)).to_base_units()
    exponents = {_BASES[name]: round(x) for name, x in quantity.unit_items()}
    return quantity.magnitude, Dimension(**{**exponents, "rad": 0})


def test_factors_and_dimensions_are_those_of_pint(registry: pint.UnitRegistry) -> None:
    for name, unit in units().items():
        if name == "1":
            continue
        text = ELSEWHERE.get(name, name)
        if name.endswith("Ws"):  # watt-seconds
            text = f"{name[:-1]}*s"
        factor, dimension = of_pint(registry, text)
        assert math.isclose(unit.factor, factor, rel_tol=1e-12), name
        assert unit.dimension._replace(rad=0) == dimension, name


#: Powers and products as people write them, and as Pint does.
POWERS = [
    *(("Nm^-1", "N/m"), ("kNm^-1", "kN/m"), ("Nm⁻²", "N/m**2"), ("kNm^2", "kN*m**2")),
    *(("Nmm^2", "N*mm**2"), ("Nms^-1", "N*m/s"), ("Nms^2", "N*m*s**2"), ("kgm^-3", "kg/m**3")),
    *(("Ns m^-1", "N*s/m"), ("N s m^-1", "N*s/m"), ("N.s.m^-1", "N*s/m"), ("kgm2", "kg*m**2")),
    *(("kg m s^-2", "kg*m/s**2"), ("kg·m⁻¹·s⁻²", "kg/m/s**2"), ("mm s^-2", "mm/s**2")),
    *(("m s^-2", "m/s**2"), ("m.s^-2", "m/s**2"), ("cm s⁻²", "cm/s**2"), ("km s^-1", "km/s")),
    *(("mm^-1", "1/mm"), ("mm^-2", "mm**-2"), ("rad s^-1", "rad/s"), ("deg s^-2", "deg/s**2")),
    *(("(ms)^-2", "ms**-2"), ("m/(ms)^2", "m/ms**2"), ("kg/(ms)", "kg/ms"), ("1/ms", "1/ms")),
    *(("(mN)^-1", "1/mN"), ("m*N^-1", "m/N"), ("m N^-1", "m/N"), ("N/ms", "N/ms")),
    *(("W m^-2 K^-1", "W/m**2/K"), ("W/(m*K)", "W/m/K"), ("J kg^-1 K^-1", "J/kg/K")),
    *(("in s^-2", "inch/s**2"), ("lbf s/ft", "lbf*s/ft"), ("lbf·in^-2", "lbf/inch**2")),
]


@pytest.mark.parametrize(("text", "plain"), POWERS)
def test_powers_are_those_of_pint(registry: pint.UnitRegistry, text: str, plain: str) -> None:
    factor, dimension = of_pint(registry, plain)
    found = read_unit(text)
    assert math.isclose(found.factor, factor, rel_tol=1e-12)
    assert found.dimension._replace(rad=0) == dimension


def test_si_units_are_those_of_the_dimensions() -> None:
    for name, unit in units().items():
        text = "*".join(f"{x}^{n}" for x, n in unit.si) or "1"
        assert read_unit(text).factor == 1, name
        assert read_unit(text).dimension == unit.dimension, name


def test_compounds_are_products_of_units_and_no_other_units() -> None:
    assert not set(compounds()) & set(units())
    for name, parts in compounds().items():
        assert set(parts) <= set(units()), name
    assert compounds()["kNms"] == ("kN", "m", "s")
    assert compounds()["mNmm"] == ("mN", "mm")


@pytest.mark.parametrize("name", REFUSED)
def test_refused_names_are_no_units(name: str) -> None:
    assert name not in units()
    assert name not in compounds()
    with pytest.raises(UnknownUnit, match="not accepted"):
        read_unit(name)


def test_names_have_a_plural_but_hertz() -> None:
    long = {"meter": "m", "metre": "m", "second": "s", "gram": "g", "newton": "N", "joule": "J"}
    long |= {"watt": "W", "pascal": "Pa", "kelvin": "K", "volt": "V", "tesla": "T"}
    for name, short in long.items():
        assert to_si(name) == to_si(f"{name}s") == to_si(short)
        assert to_si(f"milli{name}s") == to_si(f"milli{name}") == to_si(f"m{short}")
    assert to_si("hertz") == to_si("Hz")
    for name in (
        *[f"{x}hertz" + "s" for x in ("", "kilo")],
        "kkg",
        "msr",
        "krad",
        "kcd",
        "Tm",
        "hN",
        "daPa",
    ):
        with pytest.raises(UnknownUnit):
            read_unit(name)


def test_what_stands_in_parentheses_is_a_unit_of_its_own() -> None:
    for text, same_as in [
        ("N/(m*(s*kg))", "N/(m*s*kg)"), ("(m/(s*(kg/A)))^2*V", "m^2*A^2*V/(s^2*kg^2)"),
        ("1/(m/s)", "s/m"), ("(N*(m/(s)))/(kg)", "N*m/(s*kg)"),
    ]:  # fmt: skip
        one, other = read_unit(text), read_unit(same_as)
        assert one.dimension[:7] == other.dimension[:7]
        assert one.factor == other.factor
    for text in ("(m", "m)", "(m))", "()", "(m*)", "m*()", "((m)", "m(s)"):
        with pytest.raises(UnknownUnit, match="is not a unit"):
            read_unit(text)
