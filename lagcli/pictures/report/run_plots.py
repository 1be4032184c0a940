"""The plots of a report, thinned without losing a peak."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.columns import PANELS, RESIDUALS, SCALARS
from lagcli.pictures.curves import Catalogue, Curve
from lagcli.pictures.jumps import Jumps
from lagcli.pictures.page import axis_unit
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.selection import ROUNDING, by_family, chosen, drawn, evenly, scale_groups, thin
from lagcli.pictures.style import PALETTE, family_colors
from lagcli.trajectory.extremes import Extreme, widen

#: Largest number of constraints whose forces are drawn.
_CONSTRAINTS = 12
#: Number of terms λ_β b_βi of a sample above which they are omitted: they are nc nq.
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
#: Largest and smallest number of evenly spaced samples that all plots contain.
_INSTANTS, _FEWEST_INSTANTS = 3000, 100


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
    curves: list[Curve]
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


def sections(catalogue: Catalogue) -> list[Section]:
    """Return the plots of a run, without values, and without sections that have nothing to show."""
    every = [
        Section(
            "Multipliers",
            "λ of each constraint, in J (or W) per unit of the constraint.",
            _plots(catalogue.of("multipliers")),
        ),
        _forces(catalogue),
        Section("Coordinates", "", _plots(catalogue.of("q"), unknown="1")),
        Section("Velocities", "", _plots(catalogue.of("v"), unknown="1")),
        Section(
            "Energy",
            "T and V as in the model, and the powers that change their sum; powers that are zero"
            " except for rounding are omitted.",
            _scalars(catalogue),
        ),
        Section("Outputs", "", _outputs(catalogue)),
        Section(
            "Derivatives",
            "Of coordinates and multipliers with respect to parameters and initial values, SI.",
            _derivatives(catalogue),
        ),
        Section(
            "Conserved quantities",
            "Quantities that are constant during the motion; for their formulas, see System.",
            _plots(catalogue.of("conserved")),
        ),
        Section(
            RESIDUALS_TITLE,
            "Residuals of the constraints, the equations and the energy balance, computed from the"
            " written values: magnitudes, on a logarithmic scale.",
            _residuals(catalogue),
        ),
    ]
    return [section for section in every if section.plots]


class Instants(NamedTuple):
    """Samples that all plots of a page contain.

    Parameters
    ----------
    samples : (m,) array of int
        Their indices, increasing.
    time : (m,) array
        s.
    """

    samples: Indices
    time: Array


class _Choice:
    """The choice of these samples: some evenly spaced ones, and those of extremes.

    Parameters
    ----------
    even : (m,) array of int
        Indices of the evenly spaced ones.
    extremes : iterable of Extreme
        Their samples change while the run is read.
    """

    def __init__(self, even: Indices, extremes: Iterable[Extreme]):
        self._even, self._extremes = even, list(extremes)
        self._found: dict[int, float] = {}  # times by index

    def take(self, time: Array, first: int) -> Array:
        """Return the times of those in a block, whose first sample has the index ``first``."""
        inside = self._even[slice(*np.searchsorted(self._even, (first, first + len(time))))]
        extreme = np.flatnonzero(np.isin(time, self._extreme_times()))
        places = np.union1d(inside - first, extreme)
        self._found |= dict(zip((places + first).tolist(), time[places].tolist(), strict=True))
        return time[places]

    def made(self) -> Instants:
        """Return all of them, when the run has been read."""
        kept, even = set(self._extreme_times()), set(self._even.tolist())
        found = {i: t for i, t in self._found.items() if i in even or t in kept}
        samples = np.array(sorted(found), dtype=np.intp)
        return Instants(samples, np.array([found[i] for i in samples.tolist()]))

    def _extreme_times(self) -> list[float]:
        times = {t for x in self._extremes for t in (x.low_time, x.high_time)}
        return [t for t in times if t == t]


def gather(run: RunFile, plots: Sequence[Plot], extremes: Mapping[Curve, Extreme]) -> Instants:
    """Read the run once, in blocks: thin the values of the plots, and find extremes of all samples.

    Parameters
    ----------
    run : RunFile
    plots : sequence of Plot
        Plots whose ``time`` and ``values`` are set.
    extremes : mapping of Curve to Extreme
        Updated in place.

    Returns
    -------
    Instants
        The samples that all plots contain, those of the extremes among them.
    """
    fields = {"time"} | {c.field for p in plots for c in p.curves} | {c.field for c in extremes}
    of_plot = min(_OF_PLOT, _NUMBERS // max(1, len(plots)))
    widest = max((len(plot.curves) for plot in plots), default=0)
    most = max(_FEWEST_INSTANTS, min(_INSTANTS, of_plot // (2 * (widest + 2))))
    choice, first = _Choice(evenly(run.count, most), extremes.values()), 0
    pieces: list[list[tuple[Array, Array]]] = [[] for _ in plots]
    jumps = Jumps(run)
    ends: list[tuple[Array, Array]] = []  # for each plot, the last sample of the previous block
    for block in run.blocks(sorted(fields)):
        time = block["time"]
        if not len(time):
            continue
        for curve, extreme in extremes.items():
            widen([extreme], time, curve.of(block)[:, None])
        shared = choice.take(time, first)
        first += len(time)
        before, ends = ends, []
        for i, (plot, kept) in enumerate(zip(plots, pieces, strict=True)):
            values = np.stack([curve.of(block) for curve in plot.curves], axis=1)
            ends.append((time[-1:], values[-1:]))
            joined = [*before[i : i + 1], (time, values)]
            times, curves = jumps.inserted(
                np.concatenate([t for t, _ in joined]),
                [curve.name for curve in plot.curves],
                np.concatenate([x for _, x in joined]),
                carried=len(joined) > 1,
            )
            new = len(joined) - 1
            share = of_plot * len(time) / run.count
            kept.append(_thinned(times[new:], curves[new:], share, shared))
    instants = choice.made()
    for plot, kept in zip(plots, pieces, strict=True):
        time = np.concatenate([time for time, _ in kept] or [np.empty(0)])
        empty = np.empty((0, len(plot.curves)))
        values = np.concatenate([values for _, values in kept] or [empty])
        # short blocks kept more than their share
        plot.time, plot.values = _thinned(time, values, of_plot, instants.time)
    return instants


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
    # powers belong to the energies that a run changes in its time
    spans = [float(np.ptp(plot.time)) for plot in plots if len(plot.time)]
    if "J" in sizes and max(spans, default=0.0) > 0:
        sizes["W"] = max(sizes.get("W", 0.0), sizes["J"] / max(spans))
    for plot in plots:
        if plot.least is not None:
            plot.least = max(plot.least, ROUNDING * sizes[plot.unit])
    return [plot for plot in plots if plot.notable()]


def to_json(plot: Plot, packed: Packed) -> dict[str, Any]:
    """Return a plot for plots.js, with packed numbers."""
    colors = family_colors([c.name for c in plot.curves])
    return {
        "title": plot.title,
        # λ is drawn in the colour of its constraint
        "by_constraint": all(c.field == "multipliers" for c in plot.curves),
        "unit": plot.unit,
        "symbol": plot.symbol,
        "log": plot.log,
        "height": 130 if plot.log else 220,
        "time": packed.add(plot.time),
        "series": [
            {**_described(c, colors), "values": packed.add(plot.values[:, i])}
            for i, c in enumerate(plot.curves)
        ],
    }


def _described(curve: Curve, colors: Mapping[str, str]) -> dict[str, Any]:
    """Return name, label and colour of a curve, and the constraint that it belongs to."""
    described = {"name": curve.name, "label": curve.label}
    if curve.name in colors:
        described["color"] = colors[curve.name]
    return {**described, "constraint": curve.constraint} if curve.constraint else described


class Packed:
    """Arrays of doubles as text without duplicates: plots share their times."""

    def __init__(self) -> None:
        self.texts: dict[str, int] = {}

    def add(self, values: Array) -> int:
        """Return the index of an array in `texts`."""
        from base64 import b64encode

        text = b64encode(np.ascontiguousarray(values, dtype="<f8").tobytes()).decode()
        return self.texts.setdefault(text, len(self.texts))


def _thinned(time: Array, values: Array, numbers: float, shared: Array) -> tuple[Array, Array]:
    """Return thinned samples of curves, with about a given number of values including times.

    Samples at the times ``shared`` are kept. Thinning thinned values loses nothing: the extremes of
    their columns are included.
    """
    width = values.shape[1]
    if len(time) * (width + 1) <= numbers:
        return time, values
    columns = max(1, int((numbers / (width + 1) - len(shared)) / (2 + 2 * width)))
    kept: Indices = np.union1d(thin(time, values, columns), np.flatnonzero(np.isin(time, shared)))
    return time[kept], values[kept]


def _by_unit(curves: Iterable[Curve]) -> dict[str, list[Curve]]:
    """Return curves by their unit on an axis."""
    groups: dict[str, list[Curve]] = {}
    for curve in curves:
        groups.setdefault(axis_unit(curve.unit), []).append(curve)
    return groups


def _plots(curves: Sequence[Curve], unknown: str = "") -> list[Plot]:
    """Return plots of curves, one for each unit.

    ``unknown`` is stated for a missing unit next to others.
    """
    groups = _by_unit(curves)
    missing = unknown if len(groups) > 1 else ""
    return [
        _abridged(Plot("", unit or missing, [group[i] for i in family]))
        for unit, group in groups.items()
        for family in by_family([curve.name for curve in group], len(PALETTE))
    ]


def _forces(catalogue: Catalogue) -> Section:
    title, run = "Constraint forces", catalogue.run
    if len(run.constraints) * len(run.coordinates) > _FORCES:
        about = (
            "The generalized force Σ λ b of all constraints on each coordinate. The forces of the"
            f" {len(run.constraints)} single constraints are omitted."
        )
        plots = _force_plots("", ALL_FORCES, catalogue.of("constraint_force"))
        return Section(title, about, [_abridged(p) for p in plots])
    places = chosen(run.constraints, _CONSTRAINTS)
    plots = []
    for i in places:
        columns = [(run.constraints[i], run.coordinates[j]) for j in run.terms.acting(i)]
        curves = catalogue.forces(columns)
        plots += _force_plots(f"Force of {run.constraints[i]}", "λ b", curves)
    if len(places) < len(run.constraints):
        plots[0].note = f"{len(places)} of {len(run.constraints)} constraints are drawn."
    about = "The generalized force λ b of each constraint on each coordinate."
    return Section(title, about, plots)


def _force_plots(title: str, symbol: str, curves: Sequence[Curve]) -> list[Plot]:
    """Return plots of forces; if there are several, titles state the coordinates."""
    plots, groups = [], _by_unit(curves)
    for unit, group in groups.items():
        along = f" on {', '.join(c.label for c in group)}" if title and len(groups) > 1 else ""
        plots.append(Plot(title + along, unit, group, least=0.0, symbol=symbol))
    return plots


def _outputs(catalogue: Catalogue) -> list[Plot]:
    curves, units = catalogue.outputs(), catalogue.run.record.units
    if not units and len(curves) <= 6:
        # without units, one may be a length and another a force
        return [Plot(curve.name, "", [curve]) for curve in curves]
    return _plots(curves)


def _derivatives(catalogue: Catalogue) -> list[Plot]:
    """Return the plots of ∂q/∂p and ∂λ/∂p for each p, those of one unit together."""
    plots = []
    columns = [*catalogue.of("q"), *catalogue.of("multipliers")]
    for parameter in catalogue.run.sensitivity:
        groups: dict[tuple[str, str], list[Curve]] = {}
        for column in columns:
            (derivative,) = catalogue.find(f"d{column.name}/d{parameter}")
            groups.setdefault((column.field, column.unit), []).append(derivative)
        for curves in groups.values():
            plots.append(_abridged(Plot(f"With respect to {parameter}", "", curves, least=0.0)))
    return plots


def _scalars(catalogue: Catalogue) -> list[Plot]:
    """Return a plot for each panel of quantities that are not errors."""
    plots = []
    for panel in dict.fromkeys(q.panel for q in SCALARS if not q.role):
        curves = [curve for q in PANELS[panel] for curve in catalogue.of(q.name)]
        plots.append(Plot(panel.capitalize(), PANELS[panel][0].unit, curves))
    return plots


def _residuals(catalogue: Catalogue) -> list[Plot]:
    plots = []
    for quantity in RESIDUALS:
        scales = getattr(catalogue.run.record, quantity.scale).tolist()
        curves = [
            curve._replace(scale=scale if scale > 0 else 1.0)
            for curve, scale in zip(catalogue.of(quantity.name), scales, strict=True)
            if quantity.label == "velocity" or np.isfinite(scale)
        ]
        if curves:
            title = f"Constraints, {quantity.label} (relative to each one's terms)"
            plots.append(_abridged(Plot(title, "", curves, log=True)))
    errors = []
    for quantity in SCALARS:
        if quantity.role:
            stated = f" [{quantity.unit}]" if "{u}" not in quantity.unit else ""
            errors += [c._replace(label=c.label + stated) for c in catalogue.of(quantity.name)]
    plots.append(Plot("Equations of motion and energy balance", "", errors, log=True))
    return plots


def _abridged(plot: Plot) -> Plot:
    """Return a plot with at most as many curves as can be distinguished."""
    places, count = drawn(len(plot.curves)), len(plot.curves)
    if len(places) < count:
        plot.curves = [plot.curves[i] for i in places]
        plot.note = f"{len(places)} of {count} curves are drawn, evenly spaced."
    return plot
