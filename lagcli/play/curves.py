"""Curves in the plots of the page."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import BY_NAME, PANELS, ColumnName, ResultQuantity, column_names, unit_of_column
from lagcli.equations.render.names import Notation
from lagcli.model.model import Model
from lagcli.model.result_units import result_units
from lagcli.pictures.event_marks import Jumps, jumping_outputs, marks
from lagcli.pictures.report.curves import ALL_FORCES, label
from lagcli.pictures.report.writing import chosen, unit
from lagcli.pictures.scale_groups import scale_groups
from lagcli.trajectory.event_log import EventLog
from lagcli.trajectory.samples import Samples

#: Largest number of curves in a plot.
MOST = 12


class LiveCurve(NamedTuple):
    """A curve: its name in result files, its label, its unit and values."""

    name: str
    label: str
    unit: str
    values: Array


#: The group of the model's outputs.
_OUTPUTS = "outputs"


class Curves:
    """Selects and names the curves of one model.

    Parameters
    ----------
    model : Model
    """

    def __init__(self, model: Model):
        self._model, self._names = model, Notation(model)
        self._units = result_units(model)
        self._jumping = jumping_outputs(model)

    def groups(self) -> dict[str, str]:
        """Return the groups with curves, with their titles."""
        panels = [panel for panel in PANELS if any(map(self._exists, PANELS[panel]))]
        groups = [*panels, _OUTPUTS] if self._model.outputs else panels
        return {group: group.capitalize() for group in groups}

    def _exists(self, quantity: ResultQuantity) -> bool:
        """Return whether the model has columns of a quantity, and the page shows them."""
        if quantity.name in ("energy_kinetic", "energy_potential"):
            return self._model.kinetic is not None  # not if it is given by L
        if quantity.along == "term":  # too many
            return False
        if quantity.name == "residual_position":
            return any(c.kind == "holonomic" for c in self._model.constraints)
        if quantity.along == "conserved_quantity":  # computed again for each run
            return False
        of_constraints = quantity.along == "constraint" or quantity.name == "constraint_force"
        return bool(self._model.constraints) or not of_constraints

    def plot(self, group: str, samples: Samples, log: EventLog | None) -> dict[str, Any]:
        """Return a plot for ``plots.js``, with arrays; its series contain their panels.

        Parameters
        ----------
        group : str
            One of `groups`.
        samples : Samples
        log : EventLog or None
            The log, whose instants are marked and at which curves jump.
        """
        quantities = [q for q in PANELS.get(group, ()) if self._exists(q)]
        curves = [curve for q in quantities for curve in self._curves(q, samples)]
        if group == _OUTPUTS:
            curves = self._outputs(samples)
        shown = [curves[i] for i in chosen([c.name for c in curves], MOST)]
        jumps = Jumps(log, samples.coordinates, samples.constraints, self._jumping)
        table = np.array([c.values for c in shown]).reshape(len(shown), len(samples.time)).T
        time, table = jumps.inserted(samples.time, [c.name for c in shown], table)
        residuals = any(q.role == "residual" for q in quantities)
        panels = [0] * len(shown) if residuals else _panels(shown)
        return {
            "title": group.capitalize(),
            "symbol": ALL_FORCES if BY_NAME["constraint_force"] in quantities else "",
            "log": residuals,
            "time": time,
            "marks": marks(log),
            "series": [
                {
                    "name": c.name,
                    "label": f"{c.label} [{c.unit}]" if residuals and c.unit else c.label,
                    "unit": c.unit,
                    "panel": panel,
                    "values": values,
                }
                for c, panel, values in zip(shown, panels, table.T, strict=True)
            ],
            "of": len(curves),
        }

    def _curves(self, quantity: ResultQuantity, samples: Samples) -> list[LiveCurve]:
        """Return the curves of a quantity, without those that have no values."""
        values = np.asarray(getattr(samples, quantity.name))
        table = values if values.ndim == 2 else values[:, None]
        names = column_names(quantity, samples.coordinates, samples.constraints)
        return [
            LiveCurve(str(name), label(name, self._names), self._unit(name), column)
            for name, column in zip(names, table.T, strict=True)
            if not (name.constraint and np.isnan(column).all())
        ]

    def _unit(self, name: ColumnName) -> str:
        return unit(unit_of_column(name, self._units)) if self._model.units.stated else ""

    def _outputs(self, s: Samples) -> list[LiveCurve]:
        return [
            LiveCurve(name, self._names.text(name), unit(self._units.get(name)), np.asarray(values))
            for name, values in s.outputs.items()
        ]


def _panels(curves: list[LiveCurve]) -> list[int]:
    """Return the panel of each curve: curves of the same unit and similar size share one."""
    found: list[list[int]] = []
    for symbol in dict.fromkeys(c.unit for c in curves):
        places = [i for i, c in enumerate(curves) if c.unit == symbol]
        largest = [float(np.fmax.reduce(np.abs(curves[i].values), initial=0.0)) for i in places]
        found += [[places[k] for k in group] for group in scale_groups(largest)]
    panels = [0] * len(curves)
    for number, group in enumerate(sorted(found)):
        for i in group:
            panels[i] = number
    return panels
