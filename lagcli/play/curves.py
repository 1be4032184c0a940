"""Curves: what the plots of the page show of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from lagcli.equations.render.names import Notation
from lagcli.model.model import Model
from lagcli.pictures.report.writing import chosen, force_unit, rate_unit, unit
from lagcli.trajectory.samples import Array, Samples

#: Curves that a plot can show and a reader tell apart.
MOST = 12


class LiveCurve(NamedTuple):
    """One curve: a name that result files know, how it is printed, its unit and values."""

    name: str
    label: str
    unit: str
    values: Array


#: What can be plotted, in the order in which the page offers it.
TITLES = {
    "coordinates": "Coordinates",
    "velocities": "Velocities",
    "accelerations": "Accelerations",
    "multipliers": "Multipliers λ",
    "forces": "Constraint forces Σ λ b",
    "energy": "Energy",
    "balance": "Energy balance",
    "power": "Power",
    "outputs": "Outputs",
    "residuals": "Residuals of the constraints",
}
LOGARITHMIC = ("residuals",)


class Curves:
    """Chooses and names the curves of one model.

    Parameters
    ----------
    model : Model
    """

    def __init__(self, model: Model):
        self._model, self._names = model, Notation(model)
        self._units = {c.name: c.unit for c in model.coordinates}
        stated = any(self._units.values()) or any(p.unit for p in model.parameters.values())
        self._joule, self._watt = ("J", "W") if stated else ("", "")

    def groups(self) -> dict[str, str]:
        """Return the groups that have curves, with their titles."""
        empty = set() if self._model.constraints else {"multipliers", "forces", "residuals"}
        if not self._model.outputs:
            empty.add("outputs")
        return {group: title for group, title in TITLES.items() if group not in empty}

    def plot(self, group: str, samples: Samples) -> dict[str, Any]:
        """Return a plot as ``plots.js`` takes it, with arrays.

        Parameters
        ----------
        group : str
            One of `groups`.
        samples : Samples
        """
        makers: Mapping[str, Callable[[Samples], list[LiveCurve]]] = {
            "coordinates": lambda s: self._by_coordinate(s.q, 0),
            "velocities": lambda s: self._by_coordinate(s.v, 1),
            "accelerations": lambda s: self._by_coordinate(s.a, 2),
            "multipliers": self._multipliers,
            "forces": self._forces,
            "energy": self._energy,
            "balance": self._balance,
            "power": self._power,
            "outputs": self._outputs,
            "residuals": self._residuals,
        }
        curves = makers[group](samples)
        shown = [curves[i] for i in chosen([c.name for c in curves], MOST)]
        units = {c.unit for c in shown}
        common = units.pop() if len(units) == 1 else ""
        return {
            "title": TITLES[group],
            "unit": common,
            "log": group in LOGARITHMIC,
            "time": samples.time,
            "series": [
                {
                    "name": c.name,
                    "label": c.label if common or not c.unit else f"{c.label} [{c.unit}]",
                    "unit": c.unit,
                    "values": c.values,
                }
                for c in shown
            ],
            "of": len(curves),
        }

    def _by_coordinate(self, values: Array, dots: int) -> list[LiveCurve]:
        ending = ("", "_dot", "_ddot")[dots]
        found = []
        for i, (q, symbol) in enumerate(self._units.items()):
            if symbol and dots:
                symbol = f"{rate_unit(symbol)}{'^2' if dots == 2 else ''}"
            found.append(
                LiveCurve(q + ending, self._names.text(q, dots), unit(symbol), values[:, i])
            )
        return found

    def _multipliers(self, s: Samples) -> list[LiveCurve]:
        return [
            LiveCurve(f"lambda.{c}", self._names.multiplier(c), "", s.multipliers[:, i])
            for i, c in enumerate(s.constraints)
        ]

    def _forces(self, s: Samples) -> list[LiveCurve]:
        total = s.constraint_force
        return [
            LiveCurve(f"Qc.{q}", f"Q_{self._names.text(q)}", unit(force_unit(symbol)), total[:, i])
            for i, (q, symbol) in enumerate(self._units.items())
        ]

    def _energy(self, s: Samples) -> list[LiveCurve]:
        parts = [
            ("energy_kinetic", "T", s.energy_kinetic),
            ("energy_potential", "V", s.energy_potential),
            ("energy_total", "E", s.energy_total),
        ]
        if self._model.kinetic is None:  # written with L
            parts = parts[2:]
        return [LiveCurve(name, label, self._joule, values) for name, label, values in parts]

    def _balance(self, s: Samples) -> list[LiveCurve]:
        return [LiveCurve("energy_balance", "ΔE − W", self._joule, s.energy_balance)]

    def _power(self, s: Samples) -> list[LiveCurve]:
        return [
            LiveCurve("power_applied", "applied", self._watt, s.power_applied),
            LiveCurve("power_constraint", "constraints", self._watt, s.power_constraint),
            LiveCurve("power_time", "explicit time", self._watt, s.power_time),
        ]

    def _outputs(self, s: Samples) -> list[LiveCurve]:
        units = self._model.output_units
        return [
            LiveCurve(name, self._names.text(name), unit(units.get(name)), np.asarray(values))
            for name, values in s.outputs.items()
        ]

    def _residuals(self, s: Samples) -> list[LiveCurve]:
        found = []
        for i, c in enumerate(s.constraints):
            for name, symbol, table in (
                ("residual_position", "φ", s.residual_position),
                ("residual_velocity", "ψ", s.residual_velocity),
            ):
                if not np.isnan(table[:, i]).all():
                    found.append(LiveCurve(f"{name}.{c}", f"{symbol}_{c}", "", table[:, i]))
        return found
