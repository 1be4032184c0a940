"""The table of units, compared with Pint's."""

from __future__ import annotations

import math

import pint
import pytest

from lagcli.model.expression.dimension import Dimension
from lagcli.model.expression.units import REFUSED, UnknownUnit, compounds, read_unit, units

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
