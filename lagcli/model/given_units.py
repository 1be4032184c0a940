"""The units other than SI in which parameters and initial values are given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from lagcli.model.expression.units import to_si
from lagcli.model.model import Model


class GivenUnit(NamedTuple):
    """A unit of a model file that is not SI, and its value in SI."""

    unit: str
    factor: float

    def written(self, value: float) -> str:
        """Return a value in SI as it was given: ``1500 rpm``."""
        return f"{value / self.factor:.6g} {self.unit}"


def given_units(model: Model) -> Mapping[str, GivenUnit]:
    """Return the units of parameters and initial values that are given in others than SI."""
    stated = {name: x.unit for name, x in model.parameters.items()}
    stated |= {name: x.unit for name, x in model.initial.items()}
    factors = {name: (unit, float(to_si(unit))) for name, unit in stated.items() if unit}
    return {name: GivenUnit(*given) for name, given in factors.items() if given[1] != 1.0}


def stored_units(display: Mapping[str, Any]) -> Mapping[str, GivenUnit]:
    """Return the same from ``Record.display``, of a result file or a sweep."""
    given = display.get("given_units", {})
    return {name: GivenUnit(x["unit"], x["factor"]) for name, x in given.items()}
