"""Units of a model's quantities, and what else of a model result files store besides its text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from symengine import Symbol

from lagcli.columns import ColumnName
from lagcli.model.expression.units import to_si
from lagcli.model.model import TIME, Model, coordinate


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


def result_units(model: Model) -> dict[str, str]:
    """Return the known SI units of the quantities in a result.

    Parameters
    ----------
    model : Model

    Returns
    -------
    dict of str to str
        Units of coordinates, parameters and outputs by name; of λ and of the residuals by column,
        such as ``lambda.guide`` and ``residual_velocity.guide``.
    """
    units = model.units
    known = {name: units.of(name) for name in (*model.coordinate_names, *model.parameters)}
    for c in model.constraints:
        holonomic = c.kind == "holonomic"
        known[str(ColumnName("multipliers", c.name))] = units.of_multiplier(c.name)
        for what in ("position", "velocity") if holonomic else ("velocity",):
            column = str(ColumnName(f"residual_{what}", c.name))
            known[column] = units.of_residual(c.name, holonomic, what == "velocity")
    known |= {name: units.of_output(name) for name in model.outputs}
    return {name: unit for name, unit in known.items() if unit is not None}


def result_display(model: Model) -> dict[str, Any]:
    """Return the data of a model for pictures and lists, as in ``Record.display``."""
    given = given_units(model)
    return {
        "latex": {c.name: c.latex for c in model.coordinates if c.latex},
        "definitions": [*model.definitions, *model.inputs],
        "jumping": _jumping_outputs(model) if model.switches else [],
        "given": {
            p.name: given[p.name].written(p.value)
            for p in model.parameters.values()
            if p.name in given
        },
        "given_units": {name: x._asdict() for name, x in given.items()},
    }


def _jumping_outputs(model: Model) -> list[str]:
    """Return the outputs that may jump: those that depend on more than q, t and parameters."""
    continuous = {TIME, *map(coordinate, model.coordinate_names)}
    continuous |= {Symbol(name) for name in model.parameters.keys() - model.changing_parameters}
    return [name for name, value in model.outputs.items() if not value.free_symbols <= continuous]
