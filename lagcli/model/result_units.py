"""Data of a model in result files besides its text: units by column, and the view."""

from __future__ import annotations

from typing import Any

from symengine import Symbol

from lagcli.columns import ColumnName
from lagcli.model.given_units import given_units
from lagcli.model.model import TIME, Model, coordinate


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
    changed = {name for event in model.events for name in event.action.set}
    continuous = {TIME, *map(coordinate, model.coordinate_names)}
    continuous |= {Symbol(name) for name in model.parameters if name not in changed}
    return [name for name, value in model.outputs.items() if not value.free_symbols <= continuous]
