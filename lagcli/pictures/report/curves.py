"""The curves of a report: which there are, and their values, thinned without losing a peak."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lagcli.equations.render.names import Notation
from lagcli.pictures.plots.thinning import thin
from lagcli.pictures.report.writing import chosen, force_unit, rate_unit, unit
from lagcli.pictures.run_file import RunFile
from lagcli.trajectory.extremes import Extreme, widen
from lagcli.trajectory.samples import Array

#: Curves in one plot, and constraints whose forces are drawn: more cannot be told apart.
_CURVES, _CONSTRAINTS = 24, 12
#: Terms λ_β b_βi of a sample above which they are not looked at: they are n_c n_q.
_FORCES = 4096
#: Numbers of all curves, 8 bytes each and a third more as text: 4.1 MB.
_NUMBERS = 380_000
#: The plot whose curves are noise where they should be 0.
POWERS = "Powers"

#: Numbers of one plot.
_OF_PLOT = 40_000


class ReportCurve(NamedTuple):
    """One curve: where its values are, and what it is called.

    Parameters
    ----------
    name : str
        As in result files, e.g. ``phi_dot``.
    label : str
        As people write it; an underscore begins a subscript.
    field : str
        Of `Samples`, or ``outputs/NAME``.
    place : tuple of int
        Of the values in a sample of that field.
    scale : float
        By which the values are divided.
    """

    name: str
    label: str
    field: str
    place: tuple[int, ...] = ()
    scale: float = 1.0

    def of(self, block: Mapping[str, Array]) -> Array:
        """Return the values in a block of samples."""
        values: Array = np.moveaxis(block[self.field], 0, -1)[self.place]
        return values if self.scale == 1 else values / self.scale


@dataclass
class Plot:
    """Curves that are drawn together, with their thinned values once they are gathered.

    Parameters
    ----------
    title, unit, note : str
        The title is empty where the section has no other plot.
    curves : list of Curve
    log : bool
        Whether magnitudes are drawn on a logarithmic scale.
    least : float, optional
        Curves that nowhere exceed it in magnitude are left out.
    """

    title: str
    unit: str
    curves: list[ReportCurve]
    log: bool = False
    least: float | None = None
    note: str = ""
    time: Array = field(default_factory=lambda: np.empty(0))
    values: Array = field(default_factory=lambda: np.empty((0, 0)))

    def notable(self) -> bool:
        """Leave out the curves that are small all along; return whether there are others."""
        if self.least is not None:
            largest = np.fmax.reduce(np.abs(self.values), axis=0, initial=0.0)
            kept = np.flatnonzero(largest > self.least)
            self.curves = [self.curves[i] for i in kept]
            self.values = self.values[:, kept]
        return bool(self.curves)


class Section(NamedTuple):
    """Plots under one heading."""

    title: str
    about: str
    plots: list[Plot]


def sections(run: RunFile, names: Notation) -> list[Section]:
    """Return the plots of a run, without values as yet.

    Parameters
    ----------
    run : Run
    names : Names
        Of its model.

    Returns
    -------
    list of Section
        Without those that have nothing to show.
    """
    found = [
        Section("Coordinates", "", _by_coordinate(run, names, "q", 0)),
        Section("Velocities", "", _by_coordinate(run, names, "v", 1)),
        Section(
            "Multipliers",
            "λ of each constraint, in joules (or watts) by the unit of the constraint.",
            _multipliers(run, names),
        ),
        _forces(run, names),
        Section("Outputs", "", _outputs(run, names)),
        Section(
            "Energy",
            "The energies as the model states T and V, and the powers that change their sum; a"
            " power that is rounding alone is left out.",
            _energies(),
        ),
        Section(
            "Residuals",
            "How well the written numbers satisfy constraints, equations and energy balance:"
            " magnitudes, on a logarithmic scale.",
            _residuals(run, names),
        ),
    ]
    return [section for section in found if section.plots]


def gather(run: RunFile, plots: Sequence[Plot], extremes: Mapping[ReportCurve, Extreme]) -> None:
    """Read the run once, in blocks: thin the plots' values, and find extremes among all samples.

    Parameters
    ----------
    run : Run
    plots : sequence of Plot
        Get their ``time`` and ``values``.
    extremes : mapping of Curve to Extreme
        Are widened.
    """
    fields = {"time"} | {c.field for p in plots for c in p.curves} | {c.field for c in extremes}
    of_plot = min(_OF_PLOT, _NUMBERS // max(1, len(plots)))
    pieces: list[list[tuple[Array, Array]]] = [[] for _ in plots]
    for block in run.blocks(sorted(fields)):
        time = block["time"]
        for plot, kept in zip(plots, pieces, strict=True):
            values = np.stack([curve.of(block) for curve in plot.curves], axis=1)
            kept.append(_thinned(time, values, of_plot * len(time) / run.count))
        for curve, extreme in extremes.items():
            widen(extreme, time, curve.of(block))
    for plot, kept in zip(plots, pieces, strict=True):
        time = np.concatenate([time for time, _ in kept] or [np.empty(0)])
        empty = np.empty((0, len(plot.curves)))
        values = np.concatenate([values for _, values in kept] or [empty])
        # of short blocks more was kept than their share
        plot.time, plot.values = _thinned(time, values, of_plot)


def to_json(plot: Plot, packed: Packed) -> dict[str, Any]:
    """Return a plot for plots.js, its numbers packed."""
    return {
        "title": plot.title,
        "unit": plot.unit,
        "log": plot.log,
        "time": packed.add(plot.time),
        "series": [
            {"name": c.name, "label": c.label, "values": packed.add(plot.values[:, i])}
            for i, c in enumerate(plot.curves)
        ],
    }


class Packed:
    """Arrays of doubles as text, each once: plots share their times."""

    def __init__(self) -> None:
        self.texts: dict[str, int] = {}

    def add(self, values: Array) -> int:
        """Return the place of an array among `texts`."""
        from base64 import b64encode

        text = b64encode(np.ascontiguousarray(values, dtype="<f8").tobytes()).decode()
        return self.texts.setdefault(text, len(self.texts))


def _thinned(time: Array, values: Array, numbers: float) -> tuple[Array, Array]:
    """Return the samples of some curves that a plot keeps: about so many numbers, times included.

    What was thinned before is thinned again without loss: the extremes of its columns are there.
    """
    width = values.shape[1]
    if len(time) * (width + 1) <= numbers:
        return time, values
    columns = max(1, int(numbers / ((width + 1) * (2 + 2 * width))))
    kept: NDArray[np.intp] = thin(time, values, columns)
    return time[kept], values[kept]


def _by_coordinate(run: RunFile, names: Notation, field: str, dots: int) -> list[Plot]:
    """Return the plots of coordinates or of their rates, one for each unit."""
    suffix = ("", "_dot")[dots]
    groups: dict[str | None, list[ReportCurve]] = {}
    for j, q in enumerate(run.coordinates):
        symbol = run.record.units.get(q)
        curve = ReportCurve(q + suffix, names.text(q, dots), field, (j,))
        groups.setdefault(rate_unit(symbol) if dots else symbol, []).append(curve)
    # beside other units it must be said that there is none
    none = "1" if len(groups) > 1 else ""
    return [_abridged(Plot("", unit(symbol) or none, c)) for symbol, c in groups.items()]


def _multipliers(run: RunFile, names: Notation) -> list[Plot]:
    curves = [
        ReportCurve(f"lambda.{c}", names.multiplier(c), "multipliers", (i,))
        for i, c in enumerate(run.constraints)
    ]
    return [_abridged(Plot("", "", curves))] if curves else []


def _forces(run: RunFile, names: Notation) -> Section:
    title = "Constraint forces"
    nq = len(run.coordinates)
    if len(run.constraints) * nq > _FORCES:
        about = (
            "The generalized force Σ λ b of all constraints on each coordinate. Those of single"
            f" constraints are {len(run.constraints)} times as many, too many to be drawn."
        )
        curves = _grouped(run, names, "Qc.", "constraint_force", {j: j for j in range(nq)})
        return Section(title, about, [_abridged(p) for p in _by_unit("", curves)])
    places = chosen(run.constraints, _CONSTRAINTS)
    plots = []
    for i in places:
        constraint = run.constraints[i]
        acting = run.terms.acting(i)
        curves = _grouped(run, names, f"Qc.{constraint}.", "constraint_force_by", acting)
        plots += _by_unit(f"Force of {constraint}", curves)
    if len(places) < len(run.constraints):
        plots[0].note = f"{len(places)} of {len(run.constraints)} constraints are drawn."
    about = "What each constraint exerts on each coordinate: the generalized force λ b."
    return Section(title, about, plots)


def _grouped(
    run: RunFile, names: Notation, prefix: str, field: str, places: Mapping[int, int]
) -> dict[str, list[ReportCurve]]:
    """Return the curves of forces on coordinates, whose places in the field are given, by unit."""
    groups: dict[str, list[ReportCurve]] = {}
    for j, place in places.items():
        q = run.coordinates[j]
        curve = ReportCurve(f"{prefix}{q}", names.text(q), field, (place,))
        groups.setdefault(unit(force_unit(run.record.units.get(q))), []).append(curve)
    return groups


def _by_unit(title: str, groups: Mapping[str, list[ReportCurve]]) -> list[Plot]:
    return [Plot(title, symbol, curves, least=0.0) for symbol, curves in groups.items()]


def _outputs(run: RunFile, names: Notation) -> list[Plot]:
    groups: dict[str | None, list[ReportCurve]] = {}
    for name in run.outputs:
        curve = ReportCurve(name, names.text(name), f"outputs/{name}")
        groups.setdefault(run.record.units.get(name), []).append(curve)
    if None in groups and len(groups[None]) <= 6 and not run.record.units:
        # without units, one may be a length and another a force
        return [Plot(curve.name, "", [curve]) for curve in groups[None]]
    return [_abridged(Plot("", unit(symbol), curves)) for symbol, curves in groups.items()]


def _energies() -> list[Plot]:
    energies = {"kinetic": "T", "potential": "V", "total": "E"}
    powers = {"applied": "applied forces", "constraint": "constraints", "time": "explicit time"}
    e, p = (
        [ReportCurve(f"{field}_{name}", label, f"{field}_{name}") for name, label in labels.items()]
        for field, labels in (("energy", energies), ("power", powers))
    )
    return [Plot("Energies", "J", e), Plot(POWERS, "W", p)]


def _residuals(run: RunFile, names: Notation) -> list[Plot]:
    plots = []
    for what in ("position", "velocity"):
        scales = getattr(run.record, f"scale_{what}")
        curves = [
            ReportCurve(f"residual_{what}.{c}", c, f"residual_{what}", (i,), _usable(scales[i]))
            for i, c in enumerate(run.constraints)
            if what == "velocity" or np.isfinite(scales[i])
        ]
        if curves:
            title = f"Constraints, {what} (relative to each one's terms)"
            plots.append(_abridged(Plot(title, "", curves, log=True)))
    plots.append(
        Plot(
            "Equations of motion and energy balance",
            "",
            [
                ReportCurve("residual_equation", "equations", "residual_equation"),
                ReportCurve("energy_balance", "energy balance [J]", "energy_balance"),
            ],
            log=True,
        )
    )
    return plots


def _usable(scale: float) -> float:
    return float(scale) if scale > 0 else 1.0


def _abridged(plot: Plot) -> Plot:
    """Return a plot of no more curves than can be told apart."""
    count = len(plot.curves)
    if count > _CURVES:
        plot.curves = [plot.curves[round(i)] for i in np.linspace(0, count - 1, 12)]
        plot.note = f"12 of {count} curves are drawn."
    return plot
