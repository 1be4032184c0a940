"""Plots of sweeps: measures over what was varied, as curves and as maps."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.errors import UsageError
from lagcli.model.spelling import did_you_mean, nearest
from lagcli.pictures.plots import style
from lagcli.pictures.plots.curves import pretty_unit
from lagcli.pictures.plots.figure_file import FigureFile
from lagcli.pictures.plots.ticks import drawable, plain_ticks
from lagcli.pictures.plots.tornado import draw_tornado, effects
from lagcli.results.layout import NOT_STATED
from lagcli.sweeps.row_results import COMPLETED

_WIDTH, _CURVE, _MAP = 6.0, 2.4, 4.0  # inches
_FAMILIES = 6  # values of a second quantity that a legend distinguishes
_MARKED = 60  # points of a curve that are marked
_USUAL = 6  # measures that are drawn where none is named
_GREY = "#8C8C8C"
#: What asks for a tornado chart of a measure.
_TORNADO = "tornado:"


class PlottedQuantity(NamedTuple):
    """A number of each row: varied, or measured."""

    name: str
    label: str
    values: Array
    measured: bool

    @property
    def log(self) -> bool:
        """Whether the values are spaced by a ratio rather than by a difference."""
        return _spaced_by_ratio(self.values)


class PlottedTable:
    """The numbers of a sweep's rows; what was measured in rows that failed is NaN.

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
            self.varied = [_quantity(c, file.read(c.dataset), False) for c in file.columns]
            self.measures = [
                _quantity(c, np.where(good, file.read(c.dataset), np.nan), True)
                for c in file.measures
            ]
        self._every = {q.name: q for q in (*self.varied, *self.measures)}
        self._every |= {
            name.removesuffix("'") + "_dot": q
            for name, q in self._every.items()
            if name.endswith("'") and not q.measured
        }

    def knows(self, name: str) -> bool:
        """Whether a name, or a pair or triple of names, is made of the columns of the file."""
        plain = name.removeprefix(_TORNADO)
        return plain in self._every or all(part.strip() in self._every for part in plain.split(":"))

    def find(self, name: str) -> PlottedQuantity:
        """Return a quantity.

        Raises
        ------
        UsageError
            There is none of this name.
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


def _quantity(column: Any, values: Array, measured: bool) -> PlottedQuantity:
    unit = "" if column.unit == NOT_STATED else pretty_unit(column.unit)
    name = column.name.replace("$", r"\$")
    label = f"{name} [{unit}]" if unit else name
    return PlottedQuantity(column.name, label, drawable(values), measured)


class _Panel(NamedTuple):
    value: PlottedQuantity
    over: tuple[PlottedQuantity, ...]  # one: a curve; two: a map; none: a tornado chart

    @property
    def height(self) -> float:
        """Inches."""
        return _MAP if len(self.over) == 2 else _CURVE


def plot_table(table: PlottedTable, names: Sequence[str], target: FigureFile) -> None:
    """Plot measures of a sweep to a file.

    Parameters
    ----------
    table : Table
    names : sequence of str
        Measures, over the one or two quantities that were varied; or ``m:peak``, and ``m:l:peak``
        for a map over m and l; ``tornado:peak`` for the effects of all that was varied. By default
        all measures, if they are few.
    target : FigureFile

    Raises
    ------
    UsageError
        A name is unknown, or more than two quantities were varied and none is named.
    FileError
        The file cannot be written.
    """
    panels = [_asked(table, name) for name in names or [q.name for q in table.measures[:_USUAL]]]
    if not panels:
        raise UsageError(f"{table.path} holds no measures; sweep with --measure 'peak=max(…)'")
    heights = [panel.height for panel in panels]
    with target.figure((_WIDTH, sum(heights) + 0.4), table.title) as figure:
        grid = figure.add_gridspec(len(panels), 1, height_ratios=heights)
        for place, panel in enumerate(panels):
            ax = figure.add_subplot(grid[place])
            if not panel.over:
                varied = {q.label: q.values for q in table.varied}
                draw_tornado(ax, effects(varied, panel.value.values), panel.value.label)
            elif len(panel.over) == 2:
                _draw_map(figure, ax, panel)
            else:
                _draw_curve(ax, panel, table)


def _asked(table: PlottedTable, name: str) -> _Panel:
    if name.startswith(_TORNADO):
        return _Panel(table.find(name.removeprefix(_TORNADO)), ())
    parts = [name] if name in (q.name for q in table.measures) else name.split(":")
    *over, value = [table.find(part) for part in parts]
    if len(over) > 2:
        raise UsageError(f"{name!r} names more than a map shows; write m:peak, or m:l:peak")
    if not over:
        over = [q for q in table.varied if len(np.unique(q.values)) > 1] or table.varied[:1]
    if len(over) > 2:
        a, b = over[:2]
        raise UsageError(
            f"{table.path}: {len(over)} quantities were varied; say over which `{value.name}` is to"
            f" be drawn: {a.name}:{value.name}, or {a.name}:{b.name}:{value.name} for a map"
        )
    return _Panel(value, tuple(over))


def _draw_curve(ax: Any, panel: _Panel, table: PlottedTable) -> None:
    """Draw a value over one quantity; for each value of the others, a curve of its own."""
    (over,), value = panel.over, panel.value
    others = [
        q
        for q in table.varied
        if q.name not in (over.name, value.name) and len(np.unique(q.values)) > 1
    ]
    combinations = np.zeros(len(over.values), dtype=int)
    told: list[str] = [""]
    if others:
        every = np.stack([q.values for q in others], axis=1)
        unique, combinations = np.unique(every, axis=0, return_inverse=True)
        told = [
            ", ".join(f"{q.name} = {x:.4g}" for q, x in zip(others, row, strict=True)).replace(
                "$", r"\$"
            )
            for row in unique
        ]
    places = combinations.ravel()
    if over.measured or not _is_function(over.values, places):
        ax.plot(over.values, value.values, linestyle="none", marker=".", color=style.PALETTE[0])
    else:
        _draw_family(ax, over.values, value.values, places, told, others)
    ax.margins(x=0.02)
    _scale(ax, "x", over)
    plain_ticks(ax.yaxis)
    ax.set_xlabel(over.label)
    ax.set_ylabel(value.label)


def _draw_family(
    ax: Any,
    x: Array,
    y: Array,
    places: Array,
    told: Sequence[str],
    others: Sequence[PlottedQuantity],
) -> None:
    """Draw a curve for each combination of the other quantities."""
    few = len(told) <= _FAMILIES
    graded = style.grades(others[0].values, others[0].log) if len(others) == 1 else None
    for number, label in enumerate(told):
        mine = places == number
        order = np.argsort(x[mine], kind="stable")
        marker = "." if mine.sum() <= _MARKED else None
        look = style.line(number)
        if not few:
            look = {"color": graded.to_rgba(others[0].values[mine][0]) if graded else _GREY}
        ax.plot(x[mine][order], y[mine][order], **look, marker=marker, label=label)
    if few and len(told) > 1:
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    elif graded and not few:
        ax.figure.colorbar(graded, ax=ax, label=others[0].label, pad=0.02)


def _is_function(x: Array, combinations: Array) -> bool:
    """Whether no combination has two rows at one place."""
    pairs = np.stack((x, combinations.ravel()), axis=1)
    return len(np.unique(pairs, axis=0)) == len(x)


def _draw_map(figure: Any, ax: Any, panel: _Panel) -> None:
    """Draw a value over two quantities: as a map on a grid, elsewhere as coloured points."""
    (first, second), value = panel.over, panel.value
    x, across = np.unique(first.values, return_inverse=True)
    y, up = np.unique(second.values, return_inverse=True)
    filled = np.full((len(y), len(x)), np.nan)
    filled[up.ravel(), across.ravel()] = value.values
    grid = len(x) * len(y) == len(value.values) and min(len(x), len(y)) > 1
    if grid and len(np.unique(up.ravel() * len(x) + across.ravel())) == len(value.values):
        edges = (_edges(x), _edges(y))
        shown = ax.pcolormesh(*edges, filled, cmap=style.COLORMAP, rasterized=True)
    else:
        shown = ax.scatter(
            first.values,
            second.values,
            c=value.values,
            s=9,
            cmap=style.COLORMAP,
            plotnonfinite=False,
        )
        ax.margins(0.03)
    ax.grid(False)
    if np.isnan(value.values).any():
        _mark_empty(ax, panel, grid)
    figure.colorbar(shown, ax=ax, label=value.label, pad=0.02)
    _scale(ax, "x", first)
    _scale(ax, "y", second)
    ax.set_xlabel(first.label)
    ax.set_ylabel(second.label)


def _mark_empty(ax: Any, panel: _Panel, grid: bool) -> None:
    """Hatch the cells of rows without a value, or cross their points, and say what they are."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    (first, second), value = panel.over, panel.value
    told = "no value: the row failed, or the measure has none"
    if grid:
        ax.patch.set(hatch="////", edgecolor=_GREY, facecolor="white")
        handle: Any = Patch(hatch="////", edgecolor=_GREY, facecolor="white", label=told)
    else:
        look: dict[str, Any] = {"linestyle": "none", "marker": "x", "markersize": 3, "color": _GREY}
        empty = np.isnan(value.values)
        ax.plot(first.values[empty], second.values[empty], **look)
        handle = Line2D([], [], **look, label=told)
    ax.legend(handles=[handle], loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)


def _spaced_by_ratio(values: Array) -> bool:
    """Whether values are spaced by a ratio rather than by a difference."""
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
    """Return the edges of the cells around increasing places."""
    if _spaced_by_ratio(centers):
        return np.asarray(np.exp(_edges_between(np.log(centers))))
    return _edges_between(centers)


def _edges_between(centers: Array) -> Array:
    middle = [(a + b) / 2 for a, b in pairwise(centers)]
    return np.array([2 * centers[0] - middle[0], *middle, 2 * centers[-1] - middle[-1]])
