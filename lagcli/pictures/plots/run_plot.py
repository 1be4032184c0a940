"""Plots of runs: time histories, phase portraits, several runs in one figure, bands."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import ColumnName
from lagcli.equations.typesetting.notation import unit_text
from lagcli.errors import UsageError
from lagcli.model.names.members import family_of, split_names
from lagcli.pictures import style
from lagcli.pictures.curves import (
    IMPULSE,
    Catalogue,
    Curve,
    look_of_value,
    raw,
    read_curves,
)
from lagcli.pictures.jumps import Jumps
from lagcli.pictures.plots.bands import Bands, LinearBands, RowBands, linear_bands, read_bands
from lagcli.pictures.plots.figure import FigureTarget, decades, plain_ticks
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.selection import by_family, drawable, scale_groups, thin
from lagcli.prose import counted
from lagcli.trajectory.samples import ENDED


class Panel(NamedTuple):
    """Curves as functions of time, or pairs of curves.

    Parameters
    ----------
    curves : tuple of Curve
        Curves of the vertical axis.
    over : tuple of Curve
        Curves of the horizontal axis; empty for the time.
    joined : bool
        Whether the user joined the curves.
    at : str
        Name of an event or a contact: the pairs are drawn as points at its instants.
    """

    curves: tuple[Curve, ...]
    over: tuple[Curve, ...] = ()
    joined: bool = False
    at: str = ""

    @property
    def log(self) -> bool:
        """Whether the panel's axis is logarithmic."""
        return not self.over and all(c.log for c in self.curves)

    @property
    def from_log(self) -> bool:
        """Whether its values are those of the event log."""
        return self.impulses or bool(self.at)

    @property
    def impulses(self) -> bool:
        """Whether it shows impulses, at single instants."""
        return any(c.field == IMPULSE for c in self.curves)

    @property
    def of_constraints(self) -> bool:
        """Whether each curve is λ or an impulse, drawn in the colour of its constraint."""
        return not self.over and all(c.field in ("multipliers", IMPULSE) for c in self.curves)

    @property
    def members(self) -> list[float] | None:
        """The indices of the members of one large family, which colours tell apart."""
        if (
            len(self.curves) <= len(style.PALETTE)
            or len({family_of(c.name) for c in self.curves}) > 1
        ):
            return None
        indices = [_INDEX.search(curve.name) for curve in self.curves]
        if all(indices):
            return [float(match[1]) for match in indices if match]
        return None

    @property
    def equal_scales(self) -> bool:
        """Whether both axes are lengths and need equal scales."""
        pairs = list(zip(self.curves, self.over, strict=False))
        lengths = all(a.unit == b.unit == "m" for a, b in pairs)
        unknown = all(a.unit == b.unit == "" and a.field == b.field == "q" for a, b in pairs)
        return bool(pairs) and (lengths or unknown)


#: Matches the index of a member of a family with one index.
_INDEX = re.compile(r"\[(\d+)\]")


def _by_family(panel: Panel) -> list[Panel]:
    """Return panels of single families, if there are more curves than a legend distinguishes."""
    if panel.over or panel.joined:
        return [panel]
    groups = by_family([curve.name for curve in panel.curves], len(style.PALETTE))
    return [Panel(tuple(panel.curves[i] for i in group)) for group in groups]


def asked(catalogue: Catalogue, names: Iterable[str]) -> list[Panel]:
    """Return the panels of the names on a command line.

    Names of one kind and unit share a panel; so do those joined by commas, of any kind. ``a:b`` is
    b over a.

    Raises
    ------
    UsageError
        A name is unknown.
    """
    together: dict[object, list[Curve]] = {}
    phases: list[Panel] = []
    for place, whole in enumerate(names):
        text, _, at = whole.partition("@")
        parts = [part for part in split_names(text) if part]
        pairs = [part for part in parts if ":" in part]
        if not parts:
            raise UsageError(f"{text!r} names nothing to plot")
        if len(parts) + len(pairs) > 1 and IMPULSE in text:
            raise UsageError(f"{text!r} joins impulses with others; they have panels of their own")
        if pairs and len(pairs) < len(parts):
            raise UsageError(
                f"{text!r} mixes quantities drawn over time with others; give them separately"
            )
        if at and not pairs:
            raise UsageError(f"{whole!r}: pairs are drawn at the instants of an event, x:y@{at}")
        if pairs:
            phases.append(_phase(catalogue, pairs)._replace(at=at.strip()))
            together[place] = []
            continue
        curves = [curve for part in parts for curve in catalogue.find(part)]
        if len(parts) > 1:
            together[place] = curves
            continue
        for curve in curves:
            together.setdefault((curve.group, curve.unit, curve.log), []).append(curve)
    panels = []
    for key, curves in together.items():
        if curves:
            panel = Panel(tuple(dict.fromkeys(curves)), joined=isinstance(key, int))
            panels += _by_family(panel)
        elif isinstance(key, int):
            panels.append(phases.pop(0))
    return panels


def _phase(catalogue: Catalogue, pairs: Sequence[str]) -> Panel:
    over, up = [], []
    for pair in pairs:
        ends = pair.split(":")
        if len(ends) != 2 or not all(end.strip() for end in ends):
            raise UsageError(f"{pair!r} is not a pair of curves; write x:y, which draws y over x")
        first, second = (catalogue.find(end) for end in ends)
        if len(first) != len(second):
            raise UsageError(f"{pair!r} pairs {counted(len(first), 'curve')} with {len(second)}")
        over += first
        up += second
    return Panel(tuple(up), tuple(over))


def usual(catalogue: Catalogue, impulses: bool) -> list[Panel]:
    """Return the default panels: coordinates, multipliers, impulses if wanted, and energies."""
    run = catalogue.run
    names = [
        *run.coordinates,
        *(str(ColumnName("multipliers", c)) for c in run.constraints),
        *(curve.name for curve in (catalogue.impulses() if impulses else ())),
        *("energy_kinetic", "energy_potential", "energy_total"),
    ]
    return asked(catalogue, names)


def split_by_scale(panels: Iterable[Panel], largest: Mapping[str, float]) -> list[Panel]:
    """Return panels without curves that are too small to be visible next to the others.

    Panels with curves joined by the user are unchanged.

    Parameters
    ----------
    panels : iterable of Panel
    largest : mapping of str to float
        The largest magnitude of each curve, by its name.
    """
    split: list[Panel] = []
    for panel in panels:
        if panel.over or panel.log or panel.joined or panel.impulses or panel.members:
            split.append(panel)
            continue
        groups = scale_groups([largest[c.name] for c in panel.curves])
        split += [Panel(tuple(panel.curves[i] for i in group)) for group in groups]
    return split


WIDTH = 7.0  # inches
_TIME, _PHASE = 1.7, 4.2  # heights of panels, inches
_LISTED = 10  # largest number of curves in a legend
_NAMED = 4  # largest number of curves in the label of an axis, and in a note
#: Resolution of vector formats, for thinning.
_PRINTED = 300
#: Number of time intervals for thinning a curve that is not a function of time.
_PORTRAIT = 20_000
_GREY = {"color": "#404040"}
#: Matches a TeX letter, possibly with a dot, before its subscript or superscript.
_SUBSCRIPTED = re.compile(r"\$(\\?[A-Za-z]+(?:\{\\?[A-Za-z]+\})?)[_^]")

Values = Mapping[str, Array]


def plot_runs(
    runs: Sequence[RunFile], names: Sequence[str], target: FigureTarget, bands: Sequence[str] = ()
) -> tuple[str, ...]:
    """Plot runs to a file.

    Parameters
    ----------
    runs : sequence of Run
        At least one; several are drawn together.
    names : sequence of str
        What to plot, see `asked`; by default coordinates, multipliers and energies.
    target : FigureTarget
        Size, resolution and title; by default as wide as a page, with the model's name.
    bands : sequence of str
        As for `lagcli.plot`.

    Returns
    -------
    tuple of str
        Notes for the reader of the picture.

    Raises
    ------
    UsageError
        A name is unknown, a run has no samples, or the picture is too large.
    FileError
        A file cannot be read or written.
    """
    catalogues = [Catalogue(run, tex=True) for run in runs]
    panels = [asked(c, names) if names else usual(c, len(runs) == 1) for c in catalogues]
    _check(runs, panels)
    drawn = [
        {curve for p in own if not p.from_log for curve in (*p.curves, *p.over)} for own in panels
    ]
    values = [read_curves(run, curves) for run, curves in zip(runs, drawn, strict=True)]
    around = [
        linear_bands(run, curves, known, read_bands(run, bands))
        for run, curves, known in zip(runs, drawn, values, strict=True)
    ]
    _draw(runs, panels, values, target, around)
    return _without(drawn[0], around[0]) if bands and names else ()


def plot_bands(
    run: RunFile,
    names: Sequence[str],
    target: FigureTarget,
    bands_of: Callable[[Sequence[Curve]], RowBands],
    label: str,
) -> None:
    """Plot the medians of many runs of one model, with the bands around them.

    Parameters
    ----------
    run : RunFile
        One of the runs.
    names, target
        As for `plot_runs`.
    bands_of : callable
        Returns the bands of curves, including the time's.
    label : str
        What the bands are.

    Raises
    ------
    UsageError, FileError
        As `plot_runs`.
    """
    catalogue = Catalogue(run, tex=True)
    panels = asked(catalogue, names) if names else usual(catalogue, impulses=False)
    _check([run], [panels])
    curves = {curve for panel in panels for curve in (*panel.curves, *panel.over)}
    bands = bands_of(list(curves))
    _draw([run], [panels], [bands.medians], target, [bands], label)


def _draw(
    runs: Sequence[RunFile],
    panels: Sequence[Sequence[Panel]],
    values: Sequence[Values],
    target: FigureTarget,
    bands: Sequence[Bands],
    label: str = "",
) -> None:
    """Draw panels of runs to a target."""
    largest = _largest(values)
    split = [split_by_scale(own, largest) for own in panels]
    heights = [_PHASE if panel.over else _TIME for panel in split[0]]
    with target.figure((WIDTH, sum(heights) + 0.6), _title(runs)) as figure:
        dpi = target.dpi if target.kind == "png" else _PRINTED
        columns = int(figure.get_figwidth() * dpi)
        PanelDrawing(figure, runs, values, columns, bands).draw(split, heights)
        if label:
            figure.axes[0].set_title(label, loc="right", fontsize=8, color=style.GREY)


def _without(drawn: Iterable[Curve], bands: LinearBands) -> tuple[str, ...]:
    """Return a note on the curves without a band."""
    without = sorted({curve.name for curve in drawn} - bands.changes.keys())
    if not without:
        return ()
    shown = ", ".join(f"`{name}`" for name in without[:_NAMED])
    more = f" and {len(without) - _NAMED} more" if len(without) > _NAMED else ""
    return (
        f"no bands around {shown}{more}: they are drawn around functions of the state at one time",
    )


def _largest(values: Sequence[Values]) -> dict[str, float]:
    """Return the largest finite magnitude of each curve over all runs."""
    largest: dict[str, float] = {}
    for run in values:
        for name, curve in run.items():
            finite = np.abs(curve[np.isfinite(curve)])
            largest[name] = max(largest.get(name, 0.0), float(finite.max(initial=0.0)))
    return largest


def _check(runs: Sequence[RunFile], panels: Sequence[Sequence[Panel]]) -> None:
    """Raise an error unless there is something to draw."""
    for run, own in zip(runs, panels, strict=True):
        if not run.count:
            raise UsageError(f"{run.name} contains no samples to plot")
        mine, first = ([_shape(p) for p in side] for side in (own, panels[0]))
        if mine != first:
            raise UsageError(
                f"{run.name} and {runs[0].name} are of different models; name quantities that both"
                " have"
            )


def _shape(panel: Panel) -> tuple[list[str], list[str]]:
    return [c.name for c in panel.curves], [c.name for c in panel.over]


def _title(runs: Sequence[RunFile]) -> str:
    """Return the model's name, and the status if the run is not complete."""
    from lagcli.results.metadata import model_title

    name = model_title(runs[0].record.model) or ""
    bad = [run.record.status for run in runs if run.record.status not in (*ENDED, "")]
    if not bad:
        return name
    return f"{name} ({bad[0]})" if name else bad[0]


class PanelDrawing:
    """Draws panels of runs into a figure.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    runs : sequence of Run
    values : sequence of mappings of str to (nt,) array
        The curves of each run, by name.
    columns : int
        Number of pixels, or their equivalent, along the axis of time.
    bands : sequence of Bands
        The bands around curves of each run.
    """

    def __init__(
        self,
        figure: Any,
        runs: Sequence[RunFile],
        values: Sequence[Values],
        columns: int,
        bands: Sequence[Bands] = (),
    ):
        self.bands = bands or [LinearBands({}, {})] * len(runs)
        self.figure, self.runs, self.values, self.columns = figure, runs, values, columns
        self.jumps = [Jumps(run) for run in runs]
        self.constraints = style.constraint_colors(runs[0].constraints)
        self.labels, numbers, self.difference = labels_of(runs)
        #: Many runs form a family: coloured by the value that distinguishes them, without a legend.
        self.family: Sequence[float] | None = None
        if len(runs) > len(style.PALETTE):
            self.family = numbers or range(1, len(runs) + 1)
            self.difference = self.difference or "run"
            self.grades = style.grades(self.family)

    def draw(self, panels: Sequence[Sequence[Panel]], heights: Sequence[float]) -> None:
        """Draw all panels, one below the other."""
        grid = self.figure.add_gridspec(len(heights), 1, height_ratios=heights)
        axes: list[Any] = []
        timed: Any = None
        for place in range(len(heights)):
            is_timed = not panels[0][place].over
            ax = self.figure.add_subplot(grid[place], sharex=timed if is_timed else None)
            timed = ax if is_timed and timed is None else timed
            self.panel(ax, [own[place] for own in panels])
            axes.append(ax)
        over_time = [not panel.over for panel in panels[0]]
        for place, ax in enumerate(axes):
            if over_time[place]:  # the last of several shows the numbers for all
                below = place + 1 < len(axes) and over_time[place + 1]
                ax.set_xlabel("" if below else "$t$ [s]")
                ax.tick_params(labelbottom=not below)
            self.legend(ax, panels[0][place], first=place == 0)
        if timed is not None and len(self.runs) == 1:
            name_marks(timed, self.runs[0], _span(self.values), self.figure.get_figwidth())
        self.figure.align_ylabels(axes)
        if self.family is not None:
            self.scale(axes)

    def scale(self, axes: Sequence[Any]) -> None:
        """Draw the colour bar of a family."""
        self.figure.colorbar(self.grades, ax=axes, label=self.difference, aspect=40, pad=0.02)

    def panel(self, ax: Any, panels: Sequence[Panel]) -> None:
        """Draw one panel of all runs."""
        first = panels[0]
        count = len(first.curves)
        shown: list[Array] = []
        for number, (panel, values) in enumerate(zip(panels, self.values, strict=True)):
            for place, curve in enumerate(panel.curves):
                if panel.impulses:
                    self.stems(ax, number, curve, self.look(number, place, panel)["color"])
                    continue
                over = panel.over[place] if panel.over else None
                if panel.at and over is not None:
                    color = self.look(number, place, panel)["color"]
                    points = (at_event(self.runs[number], c, panel.at) for c in (over, curve))
                    ax.plot(*points, linestyle="none", marker=".", markersize=4, color=color)
                    continue
                x, y = self.drawn(number, values, curve, over)
                look = self.look(number, place, panel)
                if panel.log:  # rounding errors are noise: a line would cover the panel
                    look = {"color": look["color"], **_points(place if count > 1 else number)}
                    x, y = x[y > 0], y[y > 0]
                elif len(x) == 1:
                    look["marker"] = "o"
                ax.plot(x, y, **look)
                shown.append(y)
                self.band(ax, number, curve, over, look["color"])
        if len(self.runs) == 1 and not first.over:
            draw_marks(ax, self.runs[0], _span(self.values), self.columns)
        plain_ticks(ax.xaxis)
        if first.log:
            decades(ax, shown)
            ax.set_xlim(*_span(self.values))
        else:
            plain_ticks(ax.yaxis)
        if first.equal_scales:
            ax.set_aspect("equal", adjustable="datalim")
        if first.impulses:
            ax.axhline(0, color=style.GREY, linewidth=0.7, zorder=0.6)
            ax.set_xlim(*_span(self.values))
        place = ax.get_position()
        if first.at:
            ax.set_title(f"at `{raw(first.at)}`", fontsize=8, loc="left")
        if first.over:
            ax.margins(0.05)
            ax.set_xlabel(_axis(first.over, place.width * self.figure.get_figwidth()))
        ax.set_ylabel(_axis(first.curves, place.height * self.figure.get_figheight()))

    def band(self, ax: Any, run: int, curve: Curve, over: Curve | None, color: Any) -> None:
        """Draw the band around a curve of a run, if it has one."""
        time = self.values[run]["t"]
        if over is None:
            ends = self.bands[run].over_time(curve.name)
            if ends is not None:
                low, high = map(drawable, ends)
                shown = low > 0 if curve.log else None
                ax.fill_between(time, low, high, shown, color=color, alpha=0.25, linewidth=0)
            return
        ends = self.bands[run].portrait(over.name, curve.name)
        if ends is None:
            return
        from matplotlib.collections import PolyCollection
        from matplotlib.colors import to_rgb

        kept = thin(time, np.concatenate(ends, axis=1), _PORTRAIT)
        one, other = (drawable(end[kept]) for end in ends)
        strips = np.stack((one[:-1], one[1:], other[1:], other[:-1]), axis=1)
        # opaque, because strips overlap where the curve bends
        light = 0.75 + 0.25 * np.array(to_rgb(color))
        look: dict[str, Any] = {"facecolors": [light], "linewidths": 0, "zorder": 0.4}
        ax.add_collection(PolyCollection(list(strips), **look))
        ax.update_datalim(strips.reshape(-1, 2))

    def stems(self, ax: Any, run: int, curve: Curve, color: Any) -> None:
        """Draw the impulses of a constraint at their instants."""
        log = self.runs[run].record.events
        assert log is not None
        assert curve.place is not None
        times, values = log.struck(curve.place[0])
        ax.vlines(times, 0.0, values, color=color, linewidth=1.2)
        ax.plot(times, values, linestyle="none", marker="o", markersize=3, color=color)

    def drawn(
        self, run: int, values: Values, curve: Curve, over: Curve | None
    ) -> tuple[Array, Array]:
        """Return the drawn points of a curve of a run."""
        y, time = drawable(values[curve.name]), values["t"]
        if over is None:
            time, y = self.jumps[run].drawn(curve.name, time, y)
            kept = thin(time, y, self.columns)
            return time[kept], y[kept]
        x = drawable(values[over.name])
        kept = thin(time, np.stack((x, y), axis=1), _PORTRAIT)
        return x[kept], y[kept]

    def look(self, run: int, curve: int, panel: Panel) -> dict[str, Any]:
        """Return colour and line style of a curve of a run."""
        count = len(panel.curves)
        if self.family is not None:
            return {"color": self.grades.to_rgba(self.family[run]), **_dash(curve)}
        if len(self.runs) == 1:
            if panel.members:
                first, last = min(panel.members), max(panel.members)
                part = (panel.members[curve] - first) / (last - first)
                return {"color": style.graded(part)}
            if count > _LISTED:
                return {"color": style.shade(curve / (count - 1)), "linewidth": 0.8}
            look = style.line(curve)
            if panel.of_constraints:
                look["color"] = self.constraints[panel.curves[curve].constraint]
            return look
        if count == 1:
            return style.line(run)
        return {"color": style.line(run)["color"], **_dash(curve)}

    def legend(self, ax: Any, panel: Panel, first: bool) -> None:
        """Draw the legend of a panel, if there is anything to distinguish.

        Several curves are named, at their ends if there is room, but the members of a large family
        have a colour scale; the first panel also names the runs.
        """
        from matplotlib.lines import Line2D

        if self._labelled(ax, panel):
            return

        entries: dict[str, dict[str, Any]] = {}
        curves = panel.curves
        count, single = len(curves), len(self.runs) == 1
        if single and panel.members:
            scale = style.family_scale(min(panel.members), max(panel.members))
            ends = sorted({min(panel.members), max(panel.members)})
            bar = self.figure.colorbar(scale, ax=ax, aspect=12, pad=0.02, ticks=ends, format="%d")
            bar.set_label("index", labelpad=-8)
        elif count > 1:
            chosen = list(range(count))
            if count > _LISTED:  # of many, a few from the first to the last
                chosen = sorted({round(i * (count - 1) / 4) for i in range(5)})
            for place in chosen:
                look = self.look(0, place, panel) if single else _dash(place) | _GREY
                if panel.impulses:
                    look = {"color": look["color"], "marker": "o", "markersize": 3}
                elif curves[place].log:
                    look = {"color": look["color"], **_points(place), "markersize": 3}
                entries[curves[place].label] = look
        if first and not single and self.family is None:
            for number, label in enumerate(self.labels):
                entries[label] = style.line(number)
        if entries:
            handles = [Line2D([], [], **look) for look in entries.values()]
            style.legend_beside(ax, handles, list(entries))

    def _labelled(self, ax: Any, panel: Panel) -> bool:
        """Write the names of a few curves over time at their ends; return whether there is room."""
        count = len(panel.curves)
        few = len(self.runs) == 1 and 1 < count <= len(style.PALETTE)
        if not few or panel.over or panel.impulses or panel.log or panel.members:
            return False
        return style.label_ends(ax, ax.lines[:count], [curve.label for curve in panel.curves])


def _points(number: int) -> dict[str, Any]:
    marker = style.MARKERS[number % len(style.MARKERS)]
    return {"linestyle": "none", "marker": marker, "markersize": 1.6, "markeredgewidth": 0.5}


def _span(values: Sequence[Values]) -> tuple[float, float]:
    """Return the first and the last time of several runs."""
    first, last = min(v["t"][0] for v in values), max(v["t"][-1] for v in values)
    return (first, last) if last > first else (first - 0.5, last + 0.5)


def _dash(curve: int) -> dict[str, Any]:
    return {"linestyle": style.DASHES[curve % len(style.DASHES)]}


def _axis(curves: Sequence[Curve], room: float) -> str:
    """Return the label of an axis of a given length in inches: its quantities and unit.

    The curves, if they are few and fit; otherwise their letters without indices; otherwise the name
    of their group.
    """
    curves = list(dict.fromkeys(curves))
    groups = {c.group for c in curves}
    units = {c.unit for c in curves}
    unit = unit_text(units.pop()) if len(units) == 1 else ""
    labels = [c.label for c in curves]
    choices = [] if curves[0].log else [labels, list(dict.fromkeys(map(_letter, labels)))]
    texts = [", ".join(names) for names in choices if len(names) <= _NAMED]
    texts.append(curves[0].group if len(groups) == 1 else "")
    shown = [f"{text} [{unit}]" if unit else text for text in texts]
    return next((text for text in shown if _length(text) <= room), shown[-1])


def _letter(label: str) -> str:
    """Return a label without its index or subscript."""
    match = _SUBSCRIPTED.match(label)
    return f"${match[1]}$" if match else label


def _length(text: str) -> float:
    """Return the length of a label in inches."""
    from matplotlib import rcParams
    from matplotlib.textpath import TextPath

    points: float = TextPath((0, 0), text, size=rcParams["axes.labelsize"]).get_extents().width
    return points / 72


_DIGITS = 4
_MOST = 3  # names in a label


def labels_of(runs: Sequence[RunFile]) -> tuple[list[str], list[float] | None, str]:
    """Return a label for each run, and values if a single number distinguishes the runs.

    Returns
    -------
    labels : list of str
        For matplotlib. By the parameters that differ; otherwise by initial values, by options, or
        by file names.
    values : list of float or None
        Values of the differing parameter; of several, the one with the most values.
    name : str
        Label of that parameter with its unit, and of the others that differ.
    """
    if len(runs) < 2:
        return [""] * len(runs), None, ""
    tables = [dict(run.varied or run.record.parameters) for run in runs]
    differing = _differing(tables)
    notation = runs[0].notation
    units = {name: unit_text(unit) for name, unit in runs[0].record.units.items()}
    looks = {name: look_of_value(notation, name) for name in differing}
    if differing:
        from lagcli.model.result_units import stored_units

        given = stored_units(runs[0].record.display)
        units |= {name: unit_text(x.unit) for name, x in given.items()}
        tables = [
            {name: x / given[name].factor if name in given else x for name, x in table.items()}
            for table in tables
        ]
        labels = [
            ", ".join(
                f"{looks[name]} = {table[name]:.{_DIGITS}g} {_written(units.get(name))}".rstrip()
                for name in _chosen(differing, tables)
                if name in table
            )
            for table in tables
        ]
        complete = [name for name in differing if all(name in table for table in tables)]
        if not complete:
            return _unique(labels, runs), None, ""
        name = max(complete, key=lambda name: len({table[name] for table in tables}))
        unit = _written(units.get(name))
        titled = f"{looks[name]} [{unit}]" if unit else looks[name]
        others = [looks[x] for x in differing if x != name]
        if others:
            titled += f" ({', '.join(others[:_MOST])} var{'ies' if len(others) == 1 else 'y'} too)"
        return _unique(labels, runs), [table[name] for table in tables], titled
    starts = [dict(run.initial) for run in runs]
    chosen = _differing(starts)
    if chosen and len(chosen) <= _MOST:
        labels = [
            ", ".join(
                f"{look_of_value(notation, name)}(0) = {start.get(name, math.nan):.{_DIGITS}g}"
                for name in chosen
            )
            for start in starts
        ]
        return _unique(labels, runs), None, ""
    options = [
        {k: str(v) for k, v in run.record.options.items() if k != "choice"}  # not an option
        for run in runs
    ]
    chosen = _differing(options)[:_MOST]
    labels = [", ".join(f"{raw(k)} = {raw(o[k])}" for k in chosen if k in o) for o in options]
    return _unique(labels, runs), None, ""


def _written(unit: str | None) -> str:
    """Return a unit as it stands behind a number: none of a pure number."""
    return "" if unit in (None, "1") else str(unit)


def _differing(tables: Sequence[dict[str, float]] | Sequence[dict[str, str]]) -> list[str]:
    names = dict.fromkeys(name for table in tables for name in table)
    return [name for name in names if len({table.get(name) for table in tables}) > 1]


def _chosen(differing: list[str], tables: Sequence[dict[str, float]]) -> list[str]:
    """Return the smallest number of leading names that distinguish all runs."""
    for count in range(1, len(differing) + 1):
        seen = {tuple(table.get(name) for name in differing[:count]) for table in tables}
        if len(seen) == len(tables):
            return differing[:count]
    return differing[:_MOST]


def _unique(labels: list[str], runs: Sequence[RunFile]) -> list[str]:
    """Return the labels, with file names added if two are equal."""
    if len(set(labels)) == len(labels) and all(labels):
        return labels
    stems = [Path(run.name).stem for run in runs]
    if len(set(stems)) < len(stems):
        stems = [run.name for run in runs]
    return [
        f"{label} ({raw(stem)})" if label else raw(stem)
        for label, stem in zip(labels, stems, strict=True)
    ]


def at_event(run: RunFile, curve: Curve, event: str) -> Array:
    """Return a curve right after the instants of an event or a contact, as the log has it.

    Raises
    ------
    UsageError
        There is no such entry, or it does not have the curve.
    """
    log = run.record.events
    entries = [] if log is None else [i for i, name in enumerate(log.names) if name == event]
    if log is None or not entries:
        known = ", ".join(dict.fromkeys(() if log is None else log.names)) or "none"
        raise UsageError(f"{run.name}: nothing of `{event}` is in the event log; it has: {known}")
    places = np.array(entries)
    places = places[np.unique(log.time[places], return_index=True)[1]]
    if curve.place is not None and curve.field in ("q", "v"):
        return np.asarray((log.q if curve.field == "q" else log.after)[places, curve.place[0]])
    if curve.name not in log.records.columns:
        raise UsageError(
            f"{run.name}: `{event}` does not record `{curve.name}`; add it to `record` of the event"
        )
    return log.recorded(curve.name)[1][places]


#: Size of the names of marks, points, and the width of a letter and of the space between names,
#: inches; part of the figure's width that a panel has.
_NAME_SIZE, _LETTER, _SPACE, _PANEL_PART = 7, 0.056, 0.08, 0.8
_MARK_LOOK = {"color": "#808080", "linewidth": 0.6, "zorder": 0.5}
#: Smallest distance of marks in pixels, so that the curves remain visible.
_APART = 3


def draw_marks(ax: Any, run: RunFile, span: tuple[float, float], columns: int) -> None:
    """Draw a thin line at each instant of a contact or event of a run.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        With time as horizontal axis.
    run : RunFile
    span : (float, float)
        First and last time of the axis, s.
    columns : int
        Pixels along the axis.
    """
    log = run.record.events
    if log is None:
        return
    first, last = span
    times = log.time[(log.time >= first) & (log.time <= last)]
    if not len(times):
        return
    column = np.floor((times - first) / ((last - first) or 1.0) * columns / _APART)
    times = times[np.unique(column, return_index=True)[1]]
    ax.vlines(times, 0.0, 1.0, transform=ax.get_xaxis_transform(), **_MARK_LOOK)


def name_marks(ax: Any, run: RunFile, span: tuple[float, float], width: float) -> None:
    """Write above a panel what the marks of a run are, as far as the names do not overlap.

    Parameters
    ----------
    ax, run, span
        See `draw_marks`.
    width : float
        Width of the figure, inches.
    """
    log = run.record.events
    if log is None or not len(log):
        return
    first, last = span
    scale = (last - first) / (width * _PANEL_PART)
    free = first + _factor_width(ax) * scale
    for time in np.unique(log.time[(log.time >= first) & (log.time <= last)]).tolist():
        if time < free:
            continue
        text = log.named_at(time)
        length = _LETTER * len(text) * scale
        at_end = time + length > last
        if at_end and last - length < free:
            continue
        ax.annotate(
            raw(text),
            (last if at_end else time, 1.0),
            (0, 3),
            xycoords=ax.get_xaxis_transform(),
            textcoords="offset points",
            ha="right" if at_end else "left",
            fontsize=_NAME_SIZE,
            color=_MARK_LOOK["color"],
        )
        free = time + length + _SPACE * scale


def _factor_width(ax: Any) -> float:
    """Return the width of the power of ten above a panel's vertical axis, inches; 0 without one."""
    ticks = ax.yaxis.get_major_formatter()
    ticks.set_locs(ax.get_yticks())
    size = ax.yaxis.get_offset_text().get_fontsize() / _NAME_SIZE
    return _LETTER * len(factor) * size + _SPACE if (factor := ticks.get_offset()) else 0.0
