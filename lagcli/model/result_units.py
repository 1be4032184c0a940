"""Units of a model's quantities, by the names of columns in results."""

from __future__ import annotations

from lagcli.columns import ColumnName
from lagcli.model.model import Model


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
    found = {name: units.of(name) for name in (*model.coordinate_names, *model.parameters)}
    for c in model.constraints:
        holonomic = c.kind == "holonomic"
        found[str(ColumnName("multipliers", c.name))] = units.of_multiplier(c.name)
        for what in ("position", "velocity") if holonomic else ("velocity",):
            column = str(ColumnName(f"residual_{what}", c.name))
            found[column] = units.of_residual(c.name, holonomic, what == "velocity")
    found |= {name: units.of_output(name) for name in model.outputs}
    return {name: unit for name, unit in found.items() if unit is not None}
