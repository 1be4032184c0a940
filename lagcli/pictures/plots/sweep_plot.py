"""Plots of sweeps: measures as curves, maps, histograms and tornado charts; their rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array, Flags, Indices
from lagcli.column_units import NOT_STATED
from lagcli.equations.typesetting.notation import Notation, unit_text
from lagcli.errors import UsageError
from lagcli.model.loader import load, load_text
from lagcli.model.model import Model
from lagcli.model.result_units import GivenUnit, result_units, stored_units
from lagcli.model.spelling import did_you_mean, nearest
from lagcli.pictures import style
from lagcli.pictures.curves import Curve, look_of_value, magnitudes
from lagcli.pictures.plots.bands import RowBands, band_quantiles
from lagcli.pictures.plots.figure import FigureTarget, plain_ticks
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.selection import drawable, evenly
from lagcli.simulations.inputs import input_data
from lagcli.sweeps.row_results import COMPLETED
from lagcli.trajectory.samples import Record, Terms

_WIDTH, _CURVE, _MAP = 6.0, 2.4, 4.0  # inches
_FAMILIES = 6  # largest number of values of a second quantity in a legend
_MARKED = 60  # largest number of points of a curve with markers
_DIGIT = 0.11  # width of a digit of a label and its share of the space between labels, inches
_TICKED = 12  # largest number of values along an axis of a map with a label each
_WIDE = 100  # ratio of values above which the colour scale is logarithmic
_EMPTY = "no value: the row failed, or the measure has none"
_USUAL = 6  # number of measures that are drawn by default
_NOTE = "#595959"
#: Prefixes of a tornado chart of a measure, and of a histogram.
TORNADO, HISTOGRAM = "tornado:", "hist:"
HISTOGRAM_QUANTILES = (0.05, 0.5, 0.95)
_BINS = 100  # largest number of bins of a histogram


class PlottedQuantity(NamedTuple):
    """A varied or measured quantity, one number per row."""

    name: str
    label: str
    values: Array
    measured: bool
    unit: str = ""

    def text_of(self, value: float) -> str:
        """Return a value as text: m = 2 kg."""
        return f"{self.symbol} = {value:.4g} {self.unit}".rstrip()

    @property
    def symbol(self) -> str:
        """The label without the unit."""
        return self.label.partition(" [")[0]

    @property
    def log(self) -> bool:
        """Whether the values form a geometric rather than an arithmetic sequence."""
        return _spaced_by_ratio(self.values)


class PlottedTable:
    """The values of a sweep's rows; measures of failed rows are NaN.

    Parameters
    ----------
    path : str
        A sweep file.

    Raises
    ------
    FileError
        As `lagcli.sweeps.file.store.open_sweep`.
    """

    def __init__(self, path: str):
        from lagcli.results.metadata import model_title
        from lagcli.sweeps.file.store import open_sweep

        self.path = path
        with open_sweep(path) as file:
            good = file.read("status") == COMPLETED
            self.kept = file.kept
            self.title = model_title(str(file.facts["model"])) or ""
            names = _notation(file.facts)
            columns = [(c, file.read(c.dataset)) for c in file.columns]
            given = stored_units(file.facts["display"])
            self.measures = [
                _quantity(c, np.where(good, file.read(c.dataset), np.nan), True)
                for c in file.measures
            ]
        self.varied = [_quantity(c, x, False, names, given.get(c.name)) for c, x in columns]
        self._every = {q.name: q for q in (*self.varied, *self.measures)}
        self._every |= {
            name.removesuffix("'") + "_dot": q
            for name, q in self._every.items()
            if name.endswith("'") and not q.measured
        }

    def knows(self, name: str) -> bool:
        """Whether a name, or a pair or triple of names, consists of columns of the file."""
        plain = name.removeprefix(TORNADO).removeprefix(HISTOGRAM)
        return plain in self._every or all(part.strip() in self._every for part in plain.split(":"))

    def find(self, name: str) -> PlottedQuantity:
        """Return a quantity.

        Raises
        ------
        UsageError
            There is no quantity of this name.
        """
        if name.strip() in self._every:
            return self._every[name.strip()]
        question = did_you_mean(nearest(name, list(self._every)))
        raise UsageError(
            f"{self.path} has no `{name}`"
            + (f"; {question}" if question else "")
            + f"\n   varied      {', '.join(q.name for q in self.varied)}"
            + f"\n   measures    {', '.join(q.name for q in self.measures) or 'none'}"
            + (
                ""
                if self.kept
                else "\n   no trajectories: lagcli sweep --keep trajectories has them"
            )
        )


def _notation(facts: Mapping[str, Any]) -> Notation | None:
    """Return the notation of the model of a sweep; None if the file does not describe it."""
    display = facts["display"]
    if not display:
        return None
    declared = (*display["coordinates"], *facts["parameters"], *display["definitions"])
    return Notation.of_names(declared, display["constraints"], display["latex"])


def _quantity(
    column: Any,
    values: Array,
    measured: bool,
    names: Notation | None = None,
    given: GivenUnit | None = None,
) -> PlottedQuantity:
    """Return a varied quantity in notation and unit of its model, or a measure under its name."""
    unit = "" if column.unit in (NOT_STATED, "1") else unit_text(column.unit)
    if given is not None:
        unit, values = unit_text(given.unit), values / given.factor
    name = look_of_value(names, column.name)
    label = f"{name} [{unit}]" if unit else name
    return PlottedQuantity(column.name, label, drawable(values), measured, unit)


class _Panel(NamedTuple):
    value: PlottedQuantity
    over: tuple[PlottedQuantity, ...]  # one: a curve; two: a map; none: a chart of its own
    rows: Flags | slice = slice(None)  # rows shown in a map
    description: str = ""  # of these rows
    histogram: bool = False

    @property
    def height(self) -> float:
        """Inches."""
        return _MAP if len(self.over) == 2 else _CURVE


def plot_table(
    table: PlottedTable, names: Sequence[str], target: FigureTarget, part: float | None = None
) -> None:
    """Plot measures of a sweep.

    Parameters
    ----------
    table : Table
    names : sequence of str
        Measures, as functions of the one or two varied quantities; or ``m:peak``, and ``m:l:peak``
        for a map over m and l; ``tornado:peak`` for the effects of all varied quantities;
        ``hist:peak`` for the distribution of a measure or a varied quantity. By
        default all measures, if they are few. A map contains rows with one value of the other
        varied quantities; if these have few values, there is a map for each.
    target : FigureTarget
    part : float, optional
        The part of the rows, of 1, between the ends of bands, which curves then have instead of
        those for each value of the other quantities, and between the quantiles of histograms.

    Raises
    ------
    UsageError
        A name is unknown, or the quantities to draw over must be chosen, because many were varied.
    FileError
        The file cannot be written.
    """
    wanted = names or [q.name for q in table.measures[:_USUAL]]
    panels = [panel for name in wanted for panel in _asked(table, name)]
    if not panels:
        raise UsageError(f"{table.path} contains no measures; sweep with --measure 'peak=max(…)'")
    heights = [panel.height for panel in panels]
    with target.figure((_WIDTH, sum(heights) + 0.4), table.title) as figure:
        grid = figure.add_gridspec(len(panels), 1, height_ratios=heights)
        for place, panel in enumerate(panels):
            ax = figure.add_subplot(grid[place])
            if panel.histogram:
                chosen = HISTOGRAM_QUANTILES if part is None else band_quantiles(part)
                draw_histogram(ax, panel.value, chosen)
            elif part is not None and len(panel.over) != 1:
                raise UsageError(
                    f"--band is not for {'maps' if panel.over else 'tornado charts'}; draw"
                    f" `{panel.value.name}` over one quantity, as in"
                    f" {table.varied[0].name}:{panel.value.name}, or {HISTOGRAM}{panel.value.name}"
                )
            elif part is not None:
                _draw_spread(ax, panel, part)
            elif not panel.over:
                varied = {q.label: q.values for q in table.varied}
                draw_tornado(ax, effects(varied, panel.value.values), panel.value.label)
            elif len(panel.over) == 2:
                _draw_map(figure, ax, panel)
            else:
                _draw_curve(ax, panel, table)


def _asked(table: PlottedTable, name: str) -> list[_Panel]:
    """Return the panels for a name."""
    if name.startswith(TORNADO):
        return [_Panel(table.find(name.removeprefix(TORNADO)), ())]
    if name.startswith(HISTOGRAM):
        return [_Panel(table.find(name.removeprefix(HISTOGRAM)), (), histogram=True)]
    parts = [name] if name in (q.name for q in table.measures) else name.split(":")
    *over, value = [table.find(part) for part in parts]
    if len(over) > 2:
        raise UsageError(f"{name!r} names more than a map shows; write m:peak, or m:l:peak")
    if not over:
        over = [q for q in table.varied if len(np.unique(q.values)) > 1] or table.varied[:1]
        most = sorted(over, key=lambda q: -_distinct(q))[:2]
        over = [q for q in over if any(q is x for x in most)]
    if len(over) < 2:
        return [_Panel(value, tuple(over))]
    others = _others(table, (*over, value))
    if not others or _is_function(
        over[0].values, np.unique(over[1].values, return_inverse=True)[1]
    ):
        return [_Panel(value, tuple(over))]
    texts, combinations = _combinations(others)
    if len(texts) > _FAMILIES:
        a, b = over
        listed = ", ".join(f"`{q.name}`" for q in others)
        raise UsageError(
            f"{table.path}: {listed} varied too, with {len(texts)} combinations of values: one map"
            f" does not show `{value.name}`; draw {a.name}:{value.name}, {b.name}:{value.name}, or"
            f" {TORNADO}{value.name}"
        )
    return [_Panel(value, tuple(over), combinations == i, text) for i, text in enumerate(texts)]


def _distinct(quantity: PlottedQuantity) -> int:
    return len(np.unique(quantity.values))


def _others(table: PlottedTable, drawn: Sequence[PlottedQuantity]) -> list[PlottedQuantity]:
    """Return the varied quantities that are not drawn."""
    names = {q.name for q in drawn}
    return [q for q in table.varied if q.name not in names and _distinct(q) > 1]


def _combinations(quantities: Sequence[PlottedQuantity]) -> tuple[list[str], Indices]:
    """Return the existing combinations of values, as text, and that of each row, (rows,)."""
    every = np.stack([q.values for q in quantities], axis=1)
    unique, places = np.unique(every, axis=0, return_inverse=True)
    texts = [
        ", ".join(q.text_of(x) for q, x in zip(quantities, row, strict=True)) for row in unique
    ]
    return texts, places.ravel()


def _draw_curve(ax: Any, panel: _Panel, table: PlottedTable) -> None:
    """Draw a measure over one quantity; one curve for each value of the others."""
    (over,), value = panel.over, panel.value
    others = _others(table, (over, value))
    texts, places = _combinations(others) if others else ([""], np.zeros(len(over.values), int))
    if over.measured or not _is_function(over.values, places):
        ax.plot(over.values, value.values, linestyle="none", marker=".", color=style.PALETTE[0])
    else:
        _draw_family(ax, over.values, value.values, places, texts, others)
    _mark_missing(ax, over.values[np.isnan(value.values)], value.values)
    ax.margins(x=0.02)
    _scale(ax, "x", over)
    plain_ticks(ax.yaxis)
    ax.set_xlabel(over.label)
    ax.set_ylabel(value.label)


def _draw_spread(ax: Any, panel: _Panel, part: float) -> None:
    """Draw the median of a measure over one quantity, and the band that contains a part of rows.

    Rows are taken together by the value of the quantity; where each row has its own, in groups of
    equal numbers of rows.
    """
    (over,), value = panel.over, panel.value
    groups = spread_groups(over.values)
    listed = [value.values[group][np.isfinite(value.values[group])] for group in groups]
    x = np.array([np.median(over.values[group]) for group in groups])
    low, middle, high = (
        np.array([np.quantile(y, end) if len(y) else np.nan for y in listed])
        for end in band_quantiles(part)
    )
    color = style.PALETTE[0]
    ax.fill_between(x, low, high, color=color, alpha=0.25, linewidth=0)
    ax.plot(x, middle, color=color, marker="." if len(x) <= _MARKED else None)
    ax.set_title(band_label(part, len(value.values)), loc="right", fontsize=8, color=_NOTE)
    ax.margins(x=0.02)
    _scale(ax, "x", over)
    plain_ticks(ax.yaxis)
    ax.set_xlabel(over.label)
    ax.set_ylabel(value.label)


def spread_groups(values: Array) -> list[Indices]:
    """Return the rows of each value, or, if most values occur once, groups of similar values."""
    unique, places = np.unique(values, return_inverse=True)
    if 2 * len(unique) <= len(values):
        return [np.flatnonzero(places == k) for k in range(len(unique))]
    return np.array_split(np.argsort(values, kind="stable"), max(1, round(len(values) ** 0.5)))


def band_label(part: float, count: int) -> str:
    """Return the label of a band, in a legend."""
    return f"median and central {100 * part:g} % of {count} rows"


def _draw_family(
    ax: Any,
    x: Array,
    y: Array,
    places: Indices,
    texts: Sequence[str],
    others: Sequence[PlottedQuantity],
) -> None:
    """Draw a curve for each combination of the other quantities."""
    few = len(texts) <= _FAMILIES
    by = max(others, key=_distinct, default=None)
    graded = style.grades(by.values, by.log) if by is not None else None
    for number, label in enumerate(texts):
        mine = places == number
        order = np.argsort(x[mine], kind="stable")
        marker = "." if mine.sum() <= _MARKED else None
        look = style.line(number)
        if not few:
            assert graded is not None
            assert by is not None
            look = {"color": graded.to_rgba(by.values[mine][0])}
        ax.plot(x[mine][order], y[mine][order], **look, marker=marker, label=label)
    if few and len(texts) > 1:
        style.legend_beside(ax)
    elif graded and by is not None and not few:
        rest = ", ".join(q.symbol for q in others if q is not by)
        verb = "vary" if len(others) > 2 else "varies"
        label = by.label + (f" ({rest} {verb} too)" if rest else "")
        ax.figure.colorbar(graded, ax=ax, label=label, pad=0.02)


def _mark_missing(ax: Any, missing: Array, values: Array) -> None:
    """Mark rows without a value at the bottom of a panel, and explain them."""
    if not len(missing):
        return
    look: dict[str, Any] = {
        "linestyle": "none",
        "marker": "x",
        "markersize": 4,
        "color": style.GREY,
    }
    foot = np.full(len(missing), 0.03)
    ax.plot(missing, foot, **look, transform=ax.get_xaxis_transform())
    ax.set_title(f"× {_EMPTY}", loc="left", fontsize=8, color=_NOTE)
    if np.isnan(values).all():
        ax.set_yticks([])


def _is_function(x: Array, y: Array | Indices) -> bool:
    """Whether no two rows agree in both."""
    pairs = np.stack((x, y), axis=1)
    return len(np.unique(pairs, axis=0)) == len(x)


class _Axis:
    """An axis of a map: the positions of values, and the edges of their cells.

    Few values that form neither an arithmetic nor a geometric sequence have cells of equal width.
    """

    def __init__(self, quantity: PlottedQuantity):
        self.quantity, self.values = quantity, np.unique(quantity.values)
        few = 1 < len(self.values) <= _TICKED
        steps = np.diff(self.values)
        even = len(steps) > 0 and np.ptp(steps) < 1e-6 * steps.max()
        self.listed = few and not even and not _spaced_by_ratio(self.values)
        self.ticked = few
        self.centers = np.arange(len(self.values), dtype=float) if self.listed else self.values

    @property
    def edges(self) -> Array:
        """The edges of the cells."""
        return _edges(self.centers) if not self.listed else _edges_between(self.centers)

    def label(self, ax: Any, which: str) -> None:
        """Label the axis: each value, if they are few."""
        if not self.listed:
            _scale(ax, which, self.quantity)
        if self.ticked:
            texts = [f"{x:.4g}" for x in self.values.tolist()]
            if not any("e" in text for text in texts):
                places = max(len(text.partition(".")[2]) for text in texts)
                texts = [f"{x:.{places}f}" for x in self.values.tolist()]
            # as many as stand side by side; the others keep their ticks
            room = ax.get_position().width * ax.figure.get_figwidth() if which == "x" else np.inf
            every = int(np.ceil(sum(map(len, texts)) * _DIGIT / room)) or 1
            shown = [text if i % every == 0 else "" for i, text in enumerate(texts)]
            getattr(ax, f"set_{which}ticks")(self.centers, shown, minor=False)
            getattr(ax, f"set_{which}ticks")([], minor=True)
        getattr(ax, f"set_{which}label")(self.quantity.label)


def _draw_map(figure: Any, ax: Any, panel: _Panel) -> None:
    """Draw a measure over two quantities: as a map on a grid, otherwise as coloured points."""
    first, second = (q._replace(values=q.values[panel.rows]) for q in panel.over)
    values = panel.value.values[panel.rows]
    axes = [_Axis(first), _Axis(second)]
    shape = [len(axis.values) for axis in axes]
    across, up = (np.searchsorted(a.values, a.quantity.values) for a in axes)
    norm = _color_scale(panel.value.values)
    grid = shape[0] * shape[1] == len(values) == len(set(zip(across, up, strict=True)))
    if grid and min(shape) > 1:
        filled = np.full((shape[1], shape[0]), np.nan)
        filled[up, across] = values
        look: dict[str, Any] = {"cmap": style.COLORMAP, "rasterized": True}
        shown = ax.pcolormesh(axes[0].edges, axes[1].edges, filled, norm=norm, **look)
        for axis, which in zip(axes, "xy", strict=True):
            axis.label(ax, which)
    else:
        grid = False
        places = (first.values, second.values)
        shown = ax.scatter(*places, c=values, s=14, cmap=style.COLORMAP, norm=norm)
        ax.margins(0.03)
        for quantity, which in ((first, "x"), (second, "y")):
            _scale(ax, which, quantity)
            getattr(ax, f"set_{which}label")(quantity.label)
    ax.grid(False)
    empty = np.isnan(values)
    if empty.any():
        _mark_empty(ax, None if grid else (first.values[empty], second.values[empty]))
    if panel.description:
        ax.set_title(panel.description, loc="right", fontsize=9)
    figure.colorbar(shown, ax=ax, label=panel.value.label, pad=0.02)


def _color_scale(values: Array) -> Any:
    """Return the colour scale: logarithmic if the values differ widely."""
    from matplotlib.colors import LogNorm, Normalize

    finite = values[np.isfinite(values)]
    if not finite.size:
        return Normalize(0, 1)
    low, high = finite.min(), finite.max()
    return (LogNorm if 0 < low * _WIDE < high else Normalize)(low, high)


def _mark_empty(ax: Any, points: tuple[Array, Array] | None) -> None:
    """Hatch cells without a value, or mark such points, and explain them."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    if points is None:
        ax.patch.set(hatch="////", edgecolor=style.GREY, facecolor="white")
        handle: Any = Patch(hatch="////", edgecolor=style.GREY, facecolor="white", label=_EMPTY)
    else:
        look: dict[str, Any] = {
            "linestyle": "none",
            "marker": "x",
            "markersize": 3,
            "color": style.GREY,
        }
        ax.plot(*points, **look)
        handle = Line2D([], [], **look, label=_EMPTY)
    ax.legend(handles=[handle], loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)


def _spaced_by_ratio(values: Array) -> bool:
    """Whether values form a geometric rather than an arithmetic sequence."""
    unique = np.unique(values)
    if len(unique) < 4 or unique[0] <= 0:
        return False
    ratios = unique[1:] / unique[:-1]
    return bool(unique[-1] / unique[0] > 8 and np.ptp(ratios) < 1e-6 * ratios.max())


def _scale(ax: Any, axis: str, quantity: PlottedQuantity) -> None:
    if quantity.log:
        getattr(ax, f"set_{axis}scale")("log")
    else:
        plain_ticks(getattr(ax, f"{axis}axis"))


def _edges(centers: Array) -> Array:
    """Return the edges of the cells around increasing positions."""
    if _spaced_by_ratio(centers):
        return np.asarray(np.exp(_edges_between(np.log(centers))))
    return _edges_between(centers)


def _edges_between(centers: Array) -> Array:
    middle = [(a + b) / 2 for a, b in pairwise(centers)]
    return np.array([2 * centers[0] - middle[0], *middle, 2 * centers[-1] - middle[-1]])


#: Largest number of values of a quantity for which means are computed.
_LEVELS = 50


class Effect(NamedTuple):
    """Effect of a varied quantity on a measure.

    Parameters
    ----------
    label : str
    low, high : float
        The measure at the smallest and the largest value of the quantity.
    least, largest : float
        The ends of the bar: the extremes over all values.
    """

    label: str
    low: float
    high: float
    least: float
    largest: float


def effects(varied: dict[str, Array], measure: Array) -> list[Effect]:
    """Return the effects of varied quantities on a measure, the largest first.

    Parameters
    ----------
    varied : dict of str to (rows,) array
        By label; NaN for values that are too large to be drawn.
    measure : (rows,) array
        NaN for rows without a value.

    Raises
    ------
    UsageError
        Too few rows have a value.
    """
    good = np.isfinite([measure, *varied.values()]).all(axis=0)
    changing = {k: x[good] for k, x in varied.items() if len(np.unique(x[good])) > 1}
    y = measure[good]
    if not changing or len(y) <= len(changing):
        raise UsageError(
            "a tornado chart needs more rows with a measure than quantities that were varied"
        )
    levels = {k: np.unique(x) for k, x in changing.items()}
    factorial = np.prod([len(x) for x in levels.values()]) == len(y)
    bars = []
    if factorial and max(map(len, levels.values())) <= _LEVELS:
        for label, x in changing.items():
            means = [float(y[x == level].mean()) for level in levels[label]]
            bars.append(Effect(label, means[0], means[-1], min(means), max(means)))
    else:
        middle = {k: x.mean() for k, x in changing.items()}
        size = {k: np.ptp(x) for k, x in changing.items()}
        columns = [(x - middle[k]) / size[k] for k, x in changing.items()]
        matrix = np.stack([np.ones(len(y)), *columns], axis=1)
        mean, *slopes = np.linalg.lstsq(matrix, y, rcond=None)[0]
        for (label, x), slope in zip(changing.items(), slopes, strict=True):
            low, high = (
                float(mean + slope * (end - middle[label]) / size[label])
                for end in (x.min(), x.max())
            )
            bars.append(Effect(label, low, high, min(low, high), max(low, high)))
    return sorted(bars, key=lambda e: e.largest - e.least, reverse=True)


def draw_tornado(ax: Any, effects: list[Effect], label: str) -> None:
    """Draw a bar for each quantity, the longest on top; colours distinguish low and high values."""
    center = float(np.mean([0.5 * (e.low + e.high) for e in effects]))
    for place, effect in enumerate(reversed(effects)):
        for end, color in ((effect.low, style.PALETTE[0]), (effect.high, style.PALETTE[1])):
            ax.barh(place, end - center, left=center, color=color, height=0.6)
        ax.plot([effect.least, effect.largest], [place, place], color="#404040", linewidth=0.8)
    ax.set_yticks(range(len(effects)), [e.label for e in reversed(effects)])
    ax.axvline(center, color="#404040", linewidth=0.8)
    ax.grid(False, axis="y")
    ax.set_axisbelow(True)
    ax.margins(x=0.05)
    ax.set_xlabel(label)
    plain_ticks(ax.xaxis)
    from matplotlib.patches import Patch

    handles = [Patch(color=style.PALETTE[i]) for i in (0, 1)]
    style.legend_beside(ax, handles, ["lowest value", "highest value"])


def draw_histogram(ax: Any, quantity: PlottedQuantity, quantiles: Sequence[float]) -> None:
    """Draw the distribution of a quantity over the rows, with its median and outer quantiles.

    Raises
    ------
    UsageError
        No row has a value.
    """
    values = quantity.values[np.isfinite(quantity.values)]
    if not values.size:
        raise UsageError(f"no row has a value of `{quantity.name}`: there is nothing to draw")
    # of the rules for the width of bins, the one that a few distant values do not mislead
    edges = np.histogram_bin_edges(values, bins="fd" if np.ptp(values) > 0 else 1)
    bins = min(_BINS, max(len(edges) - 1, 1))
    ax.hist(values, bins=bins, color=style.PALETTE[0], alpha=0.75, edgecolor="white", lw=0.4)
    for part, side in zip(quantiles, ("right", "center", "left"), strict=True):
        at = float(np.quantile(values, part))
        ax.axvline(at, color=style.PALETTE[1], lw=1.2, ls="-" if part == 0.5 else (0, (4, 2)))
        ax.annotate(
            f"{100 * part:g} %: {at:.4g}",
            (at, 1.0),
            (0, 3),
            xycoords=ax.get_xaxis_transform(),
            textcoords="offset points",
            ha=side,
            fontsize=8,
            color=_NOTE,
        )
    missing = len(quantity.values) - len(values)
    ax.set_ylabel(f"rows ({missing} without a value)" if missing else "rows")
    ax.set_xlabel(quantity.label)
    ax.grid(False, axis="x")
    ax.set_axisbelow(True)
    ax.margins(x=0.02)
    plain_ticks(ax.xaxis)


#: Largest number of rows that are drawn: more curves would cover each other.
MOST = 200


class Rows:
    """The stored trajectories of a sweep file.

    Parameters
    ----------
    path : str
    model : str, optional
        See `RunFile`.

    Attributes
    ----------
    runs : list of Run
        The completed rows, at most `MOST`, evenly selected.
    good : int
        Number of completed rows.
    numbers : (good,) array of int
        Their places in the file.
    file : SweepFile
        The file, closed; rows open it once more.

    Raises
    ------
    UsageError
        The file contains no trajectories, or no row was completed.
    FileError
        As `lagcli.sweeps.file.store.open_sweep`.
    """

    def __init__(self, path: str, model: str | None = None):
        from lagcli.sweeps.file.store import open_sweep

        self.path, self._model_file = path, model
        with open_sweep(path) as file:
            if not file.kept:
                measures = ", ".join(f"`{c.name}`" for c in file.measures)
                raise UsageError(
                    f"{path} contains measures, but no trajectories: plot {measures}, or sweep with"
                    " --keep trajectories"
                )
            good = np.flatnonzero(file.read("status") == COMPLETED)
            if not len(good):
                raise UsageError(f"{path}: no row was completed: there is nothing to plot")
            facts = file.facts
            self.names = {name: file.names(name) for name in ("coordinate", "constraint")}
            self.outputs, self.fields = file.outputs, file.fields
            self.count = len(file.times)
            self.inputs, self.units, self.notation = file.inputs, facts["units"], _notation(facts)
            self.text, self.parameters = str(facts["model"]), dict(facts["parameters"])
            self.display = facts["display"]
            columns = file.columns
            values = np.stack([file.read(c.dataset)[good] for c in columns], axis=1)
        self.good, self.numbers, self.file = len(good), good, file
        if model is not None:
            self.units, self.notation = result_units(self.model), Notation(self.model)
        self.units = self.units | {c.name: c.unit for c in columns if c.unit != NOT_STATED}
        chosen = evenly(self.good, MOST)
        self.runs: list[RunFile] = [
            SweepRow(self, int(good[i]), dict(zip([c.name for c in columns], v, strict=True)))
            for i, v in zip(chosen, values[chosen].tolist(), strict=True)
        ]

    @cached_property
    def model(self) -> Model:
        """The model with the values common to all rows.

        Raises
        ------
        ModelError, FileError
            As `RunFile.model`.
        """
        parameters = {name: f"{value!r}*1" for name, value in self.parameters.items()}
        if self._model_file is not None:
            return load(self._model_file, parameters)
        return load_text(self.text, f"{self.path}:model", parameters, data=input_data(self.inputs))


class SweepRow(RunFile):
    """One row of a sweep file; see `RunFile`."""

    def __init__(self, rows: Rows, number: int, varied: Mapping[str, float]):
        self._rows, self._number = rows, number
        self.name = rows.path
        self.coordinates, self.constraints = rows.names["coordinate"], rows.names["constraint"]
        self.outputs, self.count = rows.outputs, rows.count
        self.conserved_names, self.sensitivity = (), ()
        self.varied = varied
        self.fields = frozenset(rows.fields) | {f"outputs/{name}" for name in rows.outputs}
        self.terms = Terms.of((), (len(self.constraints), len(self.coordinates)))
        unknown = np.full(len(self.constraints), np.nan)
        self.record = Record(
            scale_position=unknown,
            scale_velocity=unknown,
            units=rows.units,
            display=rows.display,
            model=rows.text,
            parameters={**rows.parameters, **varied},
            inputs=rows.inputs,
        )

    def blocks(self, names: Sequence[str]) -> Iterator[Mapping[str, Array]]:
        """Yield fields of `Samples` by name, all samples at once."""
        from lagcli.results.hdf5.opening import open_verified

        with open_verified(self.name) as opened:
            file = self._rows.file.again(opened)
            yield {
                name: file.times if name == "time" else file.read(name, self._number)
                for name in names
            }

    @property
    def model(self) -> Model:
        """The model, the same for all rows."""
        return self._rows.model

    @property
    def notation(self) -> Notation | None:
        """The notation of the model's names."""
        return self._rows.notation


#: Largest number of values of a curve in all rows that is held at once: 240 MB.
_HELD = 30_000_000


def plot_row_bands(
    path: str, model: str | None, names: Sequence[str], target: FigureTarget, part: float
) -> tuple[str, ...]:
    """Plot the median of the rows of a sweep at each time, with the band of a part of them.

    Parameters
    ----------
    path, model
        As for `Rows`.
    names, target
        As for `lagcli.pictures.plots.run_plot.plot_runs`.
    part : float
        The part of the rows between the ends of the bands, of 1.

    Returns
    -------
    tuple of str
        Notes for the reader of the picture.
    """
    from lagcli.pictures.plots.run_plot import plot_bands
    from lagcli.sweeps.file.store import open_sweep

    rows = Rows(path, model)
    numbers = rows.numbers[evenly(rows.good, max(2, _HELD // max(1, rows.count)))]

    def bands_of(curves: Sequence[Curve]) -> RowBands:
        values = {c.name: np.empty((len(numbers), rows.count)) for c in curves}
        fields = list(dict.fromkeys(c.field for c in curves))
        with open_sweep(path) as file:
            for i, number in enumerate(numbers.tolist()):
                block = {name: file.read(name, number) for name in fields}
                for c in curves:
                    values[c.name][i] = magnitudes(rows.runs[0], c, block)
        values["t"] = rows.runs[0].columns(["time"])["time"][None]
        return RowBands(values, part)

    plot_bands(rows.runs[0], names, target, bands_of, band_label(part, len(numbers)))
    return (f"{len(numbers)} of {rows.good} rows used",) if len(numbers) < rows.good else ()
