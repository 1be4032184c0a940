"""The plots of a report, thinned without losing a peak."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.columns import BY_NAME, PANELS, RESIDUALS, SCALARS, ColumnName, unit_of_column
from lagcli.equations.render.names import Notation
from lagcli.pictures.jumps import jumps_of
from lagcli.pictures.page import axis_unit
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.selection import ROUNDING, chosen, scale_groups, thin
from lagcli.trajectory.extremes import Extreme, widen

#: Largest number of curves in a plot, and of constraints whose forces are drawn.
_CURVES, _CONSTRAINTS = 24, 12
#: Number of terms λ_β b_βi of a sample above which they are omitted: they are n_c n_q.
_FORCES = 4096
#: Largest number of values of all curves, 8 bytes each plus a third as text: 4.1 MB.
_NUMBERS = 380_000
#: The plot whose curves are noise if they should be 0.
POWERS = "Powers"
#: The section of the residuals.
RESIDUALS_TITLE = "Residuals"
#: Suffix of the constraint forces along coordinates.
ALL_FORCES = "Σ λ b"

#: Largest number of values of one plot.
_OF_PLOT = 40_000


class ReportCurve(NamedTuple):
    """A curve: the location of its values, and its labels.

    Parameters
    ----------
    name : str
        Name in result files, e.g. ``phi_dot``.
    label : str
        Displayed label; an underscore begins a subscript.
    field : str
        Field of `Samples`, or ``outputs/NAME``.
    place : tuple of int
        Index of the values in a sample of that field.
    scale : float
        Divisor of the values.
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
    """Curves that are drawn together, and their thinned values.

    Parameters
    ----------
    title, unit, note : str
        Empty if the section has no other plot.
    curves : list of Curve
    log : bool
        Whether magnitudes are drawn on a logarithmic scale.
    least : float, optional
        Curves below this magnitude everywhere are omitted.
    symbol : str
        Label of the vertical axis; by default the labels of the curves.
    """

    title: str
    unit: str
    curves: list[ReportCurve]
    log: bool = False
    least: float | None = None
    note: str = ""
    symbol: str = ""
    time: Array = field(default_factory=lambda: np.empty(0))
    values: Array = field(default_factory=lambda: np.empty((0, 0)))

    def largest(self) -> Array:
        """Return the largest magnitude of each curve."""
        return np.asarray(np.fmax.reduce(np.abs(self.values), axis=0, initial=0.0))

    def notable(self) -> bool:
        """Omit curves that are small everywhere; return whether any remain."""
        if self.least is not None:
            kept = np.flatnonzero(self.largest() > self.least)
            self.curves = [self.curves[i] for i in kept]
            self.values = self.values[:, kept]
        return bool(self.curves)


class Section(NamedTuple):
    """Plots under one heading."""

    title: str
    about: str
    plots: list[Plot]


def sections(run: RunFile, names: Notation) -> list[Section]:
    """Return the plots of a run, without values.

    Parameters
    ----------
    run : Run
    names : Names
        Names of its model.

    Returns
    -------
    list of Section
        Without sections that have nothing to show.
    """
    found = [
        Section(
            "Multipliers",
            "λ of each constraint, in J (or W) per unit of the constraint.",
            _multipliers(run, names),
        ),
        _forces(run, names),
        Section("Coordinates", "", _by_coordinate(run, names, "q")),
        Section("Velocities", "", _by_coordinate(run, names, "v")),
        Section(
            "Energy",
            "T and V as in the model, and the powers that change their sum; powers that are zero"
            " except for rounding are omitted.",
            _scalars(names),
        ),
        Section("Outputs", "", _outputs(run, names)),
        Section(
            "Derivatives",
            "Of coordinates and multipliers with respect to parameters and initial values, SI.",
            _derivatives(run, names),
        ),
        Section(
            "Conserved quantities",
            "Quantities that are constant during the motion; for their formulas, see System.",
            _conserved(run, names),
        ),
        Section(
            RESIDUALS_TITLE,
            "Residuals of the constraints, the equations and the energy balance, computed from the"
            " written values: magnitudes, on a logarithmic scale.",
            _residuals(run, names),
        ),
    ]
    return [section for section in found if section.plots]


def gather(run: RunFile, plots: Sequence[Plot], extremes: Mapping[ReportCurve, Extreme]) -> None:
    """Read the run once, in blocks: thin the values of the plots, and find extremes of all samples.

    Parameters
    ----------
    run : Run
    plots : sequence of Plot
        Plots whose ``time`` and ``values`` are set.
    extremes : mapping of Curve to Extreme
        Updated in place.
    """
    fields = {"time"} | {c.field for p in plots for c in p.curves} | {c.field for c in extremes}
    of_plot = min(_OF_PLOT, _NUMBERS // max(1, len(plots)))
    pieces: list[list[tuple[Array, Array]]] = [[] for _ in plots]
    jumps = jumps_of(run)
    ends: list[tuple[Array, Array]] = []  # for each plot, the last sample of the previous block
    for block in run.blocks(sorted(fields)):
        time = block["time"]
        if not len(time):
            continue
        before, ends = ends, []
        for i, (plot, kept) in enumerate(zip(plots, pieces, strict=True)):
            values = np.stack([curve.of(block) for curve in plot.curves], axis=1)
            ends.append((time[-1:], values[-1:]))
            joined = [*before[i : i + 1], (time, values)]
            times, drawn = jumps.inserted(
                np.concatenate([t for t, _ in joined]),
                [curve.name for curve in plot.curves],
                np.concatenate([x for _, x in joined]),
                carried=len(joined) > 1,
            )
            new = len(joined) - 1
            kept.append(_thinned(times[new:], drawn[new:], of_plot * len(time) / run.count))
        for curve, extreme in extremes.items():
            widen(extreme, time, curve.of(block))
    for plot, kept in zip(plots, pieces, strict=True):
        time = np.concatenate([time for time, _ in kept] or [np.empty(0)])
        empty = np.empty((0, len(plot.curves)))
        values = np.concatenate([values for _, values in kept] or [empty])
        # short blocks kept more than their share
        plot.time, plot.values = _thinned(time, values, of_plot)


def by_scale(plot: Plot) -> list[Plot]:
    """Return plots without curves that are too small to be visible next to the others."""
    if plot.log or not len(plot.time):
        return [plot]
    return [
        replace(plot, curves=[plot.curves[i] for i in group], values=plot.values[:, group])
        for group in scale_groups(plot.largest().tolist())
    ]


def without_errors(plots: Sequence[Plot]) -> list[Plot]:
    """Return plots without curves that are 0 except for errors, next to others of their unit.

    Applies to plots with a minimum magnitude.
    """
    sizes: dict[str, float] = {}
    for plot in plots:
        sizes[plot.unit] = max(sizes.get(plot.unit, 0.0), *plot.largest().tolist(), 0.0)
    for plot in plots:
        if plot.least is not None:
            plot.least = max(plot.least, ROUNDING * sizes[plot.unit])
    return [plot for plot in plots if plot.notable()]


def to_json(plot: Plot, packed: Packed) -> dict[str, Any]:
    """Return a plot for plots.js, with packed numbers."""
    return {
        "title": plot.title,
        "unit": plot.unit,
        "symbol": plot.symbol,
        "log": plot.log,
        "height": 130 if plot.log else 220,
        "time": packed.add(plot.time),
        "series": [
            {"name": c.name, "label": c.label, "values": packed.add(plot.values[:, i])}
            for i, c in enumerate(plot.curves)
        ],
    }


class Packed:
    """Arrays of doubles as text without duplicates: plots share their times."""

    def __init__(self) -> None:
        self.texts: dict[str, int] = {}

    def add(self, values: Array) -> int:
        """Return the index of an array in `texts`."""
        from base64 import b64encode

        text = b64encode(np.ascontiguousarray(values, dtype="<f8").tobytes()).decode()
        return self.texts.setdefault(text, len(self.texts))


def _thinned(time: Array, values: Array, numbers: float) -> tuple[Array, Array]:
    """Return thinned samples of curves, with about a given number of values including times.

    Thinning thinned values loses nothing: the extremes of their columns are included.
    """
    width = values.shape[1]
    if len(time) * (width + 1) <= numbers:
        return time, values
    columns = max(1, int(numbers / ((width + 1) * (2 + 2 * width))))
    kept: Indices = thin(time, values, columns)
    return time[kept], values[kept]


def label(name: ColumnName, names: Notation) -> str:
    """Return the label of a column in text, as in legends of pages."""
    match name.quantity:
        case "q" | "v" | "a":
            return names.text(name.coordinate, "qva".index(name.quantity))
        case "multipliers":
            return names.multiplier(name.constraint)
    if name.coordinate:
        return names.text(name.coordinate)
    return name.constraint or name.conserved or BY_NAME[name.quantity].label or str(name)


def curve_of(
    name: ColumnName, names: Notation, place: tuple[int, ...] = (), scale: float = 1.0
) -> ReportCurve:
    """Return the curve of a column, given its index in the field."""
    return ReportCurve(str(name), label(name, names), name.quantity, place, scale)


def _by_coordinate(run: RunFile, names: Notation, field: str) -> list[Plot]:
    """Return the plots of coordinates or of their rates, one for each unit."""
    groups: dict[str | None, list[ReportCurve]] = {}
    for j, q in enumerate(run.coordinates):
        curve = curve_of(ColumnName(field, "", q), names, (j,))
        stated = BY_NAME[field].unit_at(run.record.units.get(q))
        groups.setdefault(stated, []).append(curve)
    # next to other units, the missing unit must be stated
    none = "1" if len(groups) > 1 else ""
    return [_abridged(Plot("", axis_unit(symbol) or none, c)) for symbol, c in groups.items()]


def _multipliers(run: RunFile, names: Notation) -> list[Plot]:
    """Return the plots of λ, one for each unit."""
    groups: dict[str, list[ReportCurve]] = {}
    for i, c in enumerate(run.constraints):
        column = ColumnName("multipliers", c)
        stated = axis_unit(unit_of_column(column, run.record.units))
        groups.setdefault(stated, []).append(curve_of(column, names, (i,)))
    return [_abridged(Plot("", symbol, curves)) for symbol, curves in groups.items()]


def _forces(run: RunFile, names: Notation) -> Section:
    title = "Constraint forces"
    nq = len(run.coordinates)
    if len(run.constraints) * nq > _FORCES:
        about = (
            "The generalized force Σ λ b of all constraints on each coordinate. The forces of the"
            f" {len(run.constraints)} single constraints are omitted."
        )
        curves = _grouped(run, names, "", {j: j for j in range(nq)})
        plots = _by_unit("", ALL_FORCES, curves)
        return Section(title, about, [_abridged(p) for p in plots])
    places = chosen(run.constraints, _CONSTRAINTS)
    plots = []
    for i in places:
        constraint = run.constraints[i]
        acting = run.terms.acting(i)
        curves = _grouped(run, names, constraint, acting)
        plots += _by_unit(f"Force of {constraint}", "λ b", curves)
    if len(places) < len(run.constraints):
        plots[0].note = f"{len(places)} of {len(run.constraints)} constraints are drawn."
    about = "The generalized force λ b of each constraint on each coordinate."
    return Section(title, about, plots)


def _grouped(
    run: RunFile, names: Notation, constraint: str, places: Mapping[int, int]
) -> dict[str, list[ReportCurve]]:
    """Return the forces of a constraint, or of all, on coordinates with given indices, by unit."""
    quantity = BY_NAME["constraint_force_by" if constraint else "constraint_force"]
    groups: dict[str, list[ReportCurve]] = {}
    for j, place in places.items():
        q = run.coordinates[j]
        curve = curve_of(ColumnName(quantity.name, constraint, q), names, (place,))
        groups.setdefault(axis_unit(quantity.unit_at(run.record.units.get(q))), []).append(curve)
    return groups


def _by_unit(title: str, symbol: str, groups: Mapping[str, list[ReportCurve]]) -> list[Plot]:
    """Return plots of forces; if there are several, titles state the coordinates."""
    plots = []
    for stated, curves in groups.items():
        along = f" on {', '.join(c.label for c in curves)}" if title and len(groups) > 1 else ""
        plots.append(Plot(title + along, stated, curves, least=0.0, symbol=symbol))
    return plots


def _outputs(run: RunFile, names: Notation) -> list[Plot]:
    groups: dict[str | None, list[ReportCurve]] = {}
    for name in run.outputs:
        curve = ReportCurve(name, names.text(name), f"outputs/{name}")
        groups.setdefault(run.record.units.get(name), []).append(curve)
    if None in groups and len(groups[None]) <= 6 and not run.record.units:
        # without units, one may be a length and another a force
        return [Plot(curve.name, "", [curve]) for curve in groups[None]]
    return [_abridged(Plot("", axis_unit(symbol), curves)) for symbol, curves in groups.items()]


def _derivatives(run: RunFile, names: Notation) -> list[Plot]:
    """Return the plots of ∂q/∂p and ∂λ/∂p for each p, those of one unit together."""
    plots = []
    for place, parameter in enumerate(run.sensitivity):
        groups: dict[str | None, list[ReportCurve]] = {}
        columns = [ColumnName("q", "", q) for q in run.coordinates]
        columns += [ColumnName("multipliers", c) for c in run.constraints]
        for i, column in enumerate(columns):
            field, j = (
                ("dq", i) if column.coordinate else ("dmultipliers", i - len(run.coordinates))
            )
            name = f"d{column}/d{parameter}"
            curve = ReportCurve(name, f"∂{label(column, names)}/∂{parameter}", field, (j, place))
            stated = unit_of_column(column, run.record.units)
            groups.setdefault(f"{column.quantity} {stated}", []).append(curve)
        for curves in groups.values():
            plots.append(_abridged(Plot(f"With respect to {parameter}", "", curves, least=0.0)))
    return plots


def scalar_curves(panel: str, names: Notation) -> list[ReportCurve]:
    """Return the curves of a panel of quantities with one number per sample."""
    return [curve_of(ColumnName(q.name), names) for q in PANELS[panel]]


def _scalars(names: Notation) -> list[Plot]:
    """Return a plot for each panel of quantities that are not errors."""
    panels = dict.fromkeys(q.panel for q in SCALARS if not q.role)
    return [
        Plot(panel.capitalize(), PANELS[panel][0].unit, scalar_curves(panel, names))
        for panel in panels
    ]


def _conserved(run: RunFile, names: Notation) -> list[Plot]:
    groups: dict[str, list[ReportCurve]] = {}
    for i, name in enumerate(run.conserved_names):
        column = ColumnName("conserved", conserved=name)
        stated = axis_unit(unit_of_column(column, run.record.units))
        groups.setdefault(stated, []).append(curve_of(column, names, (i,)))
    return [_abridged(Plot("", symbol, curves)) for symbol, curves in groups.items()]


def _residuals(run: RunFile, names: Notation) -> list[Plot]:
    plots = []
    for quantity in RESIDUALS:
        scales = getattr(run.record, quantity.scale)
        curves = [
            curve_of(ColumnName(quantity.name, c), names, (i,), _usable(scales[i]))
            for i, c in enumerate(run.constraints)
            if quantity.label == "velocity" or np.isfinite(scales[i])
        ]
        if curves:
            title = f"Constraints, {quantity.label} (relative to each one's terms)"
            plots.append(_abridged(Plot(title, "", curves, log=True)))
    errors = []
    for quantity in SCALARS:
        if quantity.role:
            curve = curve_of(ColumnName(quantity.name), names)
            stated = f" [{quantity.unit}]" if "{u}" not in quantity.unit else ""
            errors.append(curve._replace(label=curve.label + stated))
    plots.append(Plot("Equations of motion and energy balance", "", errors, log=True))
    return plots


def _usable(scale: float) -> float:
    return float(scale) if scale > 0 else 1.0


def _abridged(plot: Plot) -> Plot:
    """Return a plot with at most as many curves as can be distinguished."""
    count = len(plot.curves)
    if count > _CURVES:
        plot.curves = [plot.curves[round(i)] for i in np.linspace(0, count - 1, 12)]
        plot.note = f"12 of {count} curves are drawn."
    return plot
