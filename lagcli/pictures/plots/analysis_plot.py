"""Plots of analyses: bifurcation diagrams, comparisons, fits."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import ColumnName, unit_quotient
from lagcli.equations.typesetting.notation import Notation, unit_text
from lagcli.errors import LagcliError, UsageError
from lagcli.model.loader import load_text
from lagcli.model.model import Model
from lagcli.model.result_units import given_units, result_units
from lagcli.model.spelling import did_you_mean, nearest
from lagcli.pictures import style
from lagcli.pictures.curves import look_of_column, look_of_value, raw
from lagcli.pictures.plots.figure import FigureFile, FigureTarget, plain_ticks, power
from lagcli.pictures.plots.mode_plot import plot_modes
from lagcli.pictures.selection import drawable
from lagcli.results.metadata import model_title
from lagcli.simulations.inputs import input_data

if TYPE_CHECKING:
    from lagcli.analysis.fit.result import FitResult, FittedData

_WIDTH, _PANEL = 6.5, 2.4  # inches
_USUAL = 4  # number of panels by default
_MULTIPLIERS = 6  # largest number of multipliers of two models that are drawn
_MARKERS = {
    "fold": "s",
    "branch point": "D",
    "Hopf point": "^",
    "flutter": "v",
    "divergence": "o",
    "stability change": "P",
}
#: Lines by the verdict on stability; those of all other verdicts are solid.
_DRAWN = {"unstable": (0, (4, 3)), "undecided": (0, (1, 2))}
_OF_CONTACT = "X"  # where a contact ends a branch
#: Curves of a comparison, and the labels of their axes; SI.
_COMPARED = {
    "residual": "largest residual [SI]",
    "energy": "error of energy balance [J]",
    "q": r"largest $|\Delta q|$ [SI]",
}


class AnalysisLabels:
    """The labels of quantities on the axes: in the notation and the units of the model.

    Parameters
    ----------
    content : mapping
    model : Model or None
        The model of the analysis; if it is not known, names are written as they are typed.
    units : mapping of str to str
        Units of coordinates, parameters and, by column, λ.
    """

    def __init__(self, content: Mapping[str, Any], model: Model | None, units: Mapping[str, str]):
        self.title = str(content["model"] if model is None else model.title)
        self._names = None if model is None else Notation(model)
        self._model, self._units = model, units
        self.given = {} if model is None else given_units(model)

    def of(self, name: str) -> str:
        """Return the label of a coordinate, a velocity, a multiplier, or the growth rate."""
        base = name.removesuffix("_dot")
        unit = "1/s" if name == "growth" else self._units.get(name)
        if unit is None and base != name and base in self._units:
            unit = unit_quotient(self._units[base], "s")
        if name == "growth":
            return _with_unit("growth rate", unit)
        if self._model is None:
            return _with_unit(raw(name), unit)
        model = self._model
        look = look_of_column(self._names, name, model.coordinate_names, model.constraint_names)
        return _with_unit(look, unit)

    def of_parameter(self, name: str) -> str:
        """Return the label of a parameter, or of a velocity of steady motions."""
        base = name.rstrip("'")
        unit = self._units.get(name)
        if unit is None and base != name and base in self._units:
            unit = unit_quotient(self._units[base], "s")
        if name in self.given:
            unit = self.given[name].unit
        return _with_unit(look_of_value(self._names, name), unit)

    def in_unit(self, name: str, values: Any) -> Array:
        """Return values of a parameter in the unit of its label."""
        return _numbers(values) / (self.given[name].factor if name in self.given else 1.0)


def _with_unit(label: str, unit: str | None) -> str:
    return f"{label} [{unit_text(unit)}]" if unit and unit != "1" else label


def plot_analysis(
    content: Mapping[str, Any],
    names: Sequence[str],
    target: FigureTarget,
    *,
    model: Model | None = None,
    units: Mapping[str, str] | None = None,
    path: str = "the file",
) -> None:
    """Plot the content of an analysis file.

    Parameters
    ----------
    content : mapping
        Content of ``lagcli equilibrium --along``, ``lagcli modes`` or ``lagcli compare``.
    names : sequence of str
        Coordinates, velocities and multipliers of branches; by default those that vary.
    target : FigureTarget
    model : Model, optional
        The model, for names, the title and the shapes of modes.
    units : mapping of str to str, optional
        Units of coordinates, parameters and, by column, λ, for the axes.
    path : str
        The file, for messages.

    Raises
    ------
    UsageError
        There is nothing to draw, or a quantity is unknown.
    FileError
        The file cannot be written.
    """
    labels = AnalysisLabels(content, model, units or {})
    title = labels.title
    if "branches" in content:
        panels = _panels(content, names)
        with target.figure((_WIDTH, _PANEL * len(panels) + 0.4), title) as figure:
            _draw_branches(figure, content, panels, labels)
    elif content["command"] == "compare" and "runs" in content:
        if names:
            raise UsageError("a comparison is plotted whole; give no names")
        with target.figure((_WIDTH, _PANEL * len(_COMPARED) + 1.2), title) as figure:
            _draw_comparison(figure, content)
    elif content["command"] == "compare":
        if names:
            raise UsageError("a comparison is plotted whole; give no names")
        shown = list(content["curves"]["multipliers"])[:_MULTIPLIERS]
        with target.figure((_WIDTH, _PANEL * (1 + len(shown)) + 0.4), title) as figure:
            _draw_models(figure, content, shown, labels)
    elif content["command"] == "modes":
        if names:
            raise UsageError("modes are plotted whole; give no names")
        plot_modes(content, target, title, model, path)
    else:
        raise UsageError(
            f"a file of lagcli {content['command']} has no plot; lagcli info describes it, and"
            " lagcli equilibrium --along makes branches to plot"
        )


def _draw_comparison(figure: Any, content: Mapping[str, Any]) -> None:
    axes = np.atleast_1d(figure.subplots(len(_COMPARED), 1, sharex=True))
    runs = [run for run in content["runs"] if run["curves"]["time"]]
    handles = []
    for number, run in enumerate(runs):
        look = {
            "color": style.PALETTE[number % len(style.PALETTE)],
            "ls": ("-", (0, (4, 2)))[number // len(style.PALETTE) % 2],
        }
        label = f"{run['formulation']}, {run['method']}, {_power(run['rtol'])}"
        for ax, name in zip(axes, _COMPARED, strict=True):
            values = _numbers(run["curves"][name])
            drawn = np.where(values > 0, values, np.nan)  # a logarithmic axis has no zero
            (line,) = ax.plot(_numbers(run["curves"]["time"]), drawn, lw=1.0, label=label, **look)
        handles.append(line)
    for ax, label in zip(axes, _COMPARED.values(), strict=True):
        ax.set_yscale("log")
        ax.set_ylabel(label)
        ax.margins(x=0)
    axes[-1].set_xlabel("$t$ [s]")
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize="small")


def _power(tolerance: float) -> str:
    """Return a tolerance as 10⁻⁹, or 2×10⁻⁹."""
    digits, exponent = f"{tolerance:.0e}".split("e")
    return ("" if digits == "1" else f"{digits}×") + power(int(exponent))


def _draw_models(
    figure: Any, content: Mapping[str, Any], shown: Sequence[str], labels: AnalysisLabels
) -> None:
    """Draw the difference of the coordinates of two models, and the multipliers of both."""
    curves = content["curves"]
    axes = np.atleast_1d(figure.subplots(1 + len(shown), 1, sharex=True))
    time, off = _numbers(curves["time"]), _numbers(curves["q"])
    axes[0].plot(time, np.where(off > 0, off, np.nan), lw=1.0, color=style.PALETTE[2])
    axes[0].set_yscale("log")
    axes[0].set_ylabel(_COMPARED["q"])
    for ax, name in zip(axes[1:], shown, strict=True):
        for number, side in enumerate(("first", "second")):
            look = {"color": style.PALETTE[number], "ls": ("-", (0, (4, 2)))[number]}
            ax.plot(time, _numbers(curves["multipliers"][name][side]), lw=1.2, **look)
        ax.set_ylabel(labels.of(f"lambda.{name}"))
        plain_ticks(ax.yaxis)
    if shown:
        style.legend_beside(
            axes[1], axes[1].get_lines(), [raw(content[x]) for x in ("model", "other")]
        )
    for ax in axes:
        ax.margins(x=0)
    axes[-1].set_xlabel("$t$ [s]")


def _numbers(values: Any) -> Array:
    """Return numbers of the content, with NaN for those too large for an axis."""
    return drawable(np.asarray(values, float))


def _series(branch: Mapping[str, Any]) -> dict[str, Sequence[float]]:
    """Return the quantities that vary along a branch, by name."""
    return {
        **branch["q"],
        **{f"{name}_dot": values for name, values in branch["v"].items()},
        **{f"lambda.{name}": values for name, values in branch["multipliers"].items()},
        "growth": branch["growth"],
    }


def _panels(content: Mapping[str, Any], names: Sequence[str]) -> list[str]:
    every = [_series(branch) for branch in content["branches"]]
    known = list(every[0])
    if names:
        wanted = [name[:-1] + "_dot" if name.endswith("'") else name for name in names]
        for name in wanted:
            if name not in known:
                remedy = did_you_mean(nearest(name, known)) or f"there are {', '.join(known[:20])}"
                raise UsageError(f"the branches have no `{name}`; {remedy}")
        return wanted
    changing = []
    for name in known:
        values = np.concatenate([np.asarray(series[name], float) for series in every])
        if name != "growth" and np.ptp(values) > 1e-9 * max(1.0, np.abs(values).max()):
            changing.append(name)
    return changing[:_USUAL] or [*known[:1], "growth"]


def _draw_branches(
    figure: Any, content: Mapping[str, Any], panels: Sequence[str], labels: AnalysisLabels
) -> None:
    over = content["parameter"]
    axes = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
    for ax, name in zip(axes, panels, strict=True):
        for number, branch in enumerate(content["branches"]):
            at = labels.in_unit(over, branch["parameter"])
            values = _numbers(_series(branch)[name])
            verdicts = [x if x in _DRAWN else "stable" for x in branch["stability"]]
            look = {"color": style.PALETTE[number % len(style.PALETTE)]}
            for verdict in dict.fromkeys(verdicts):
                chosen = np.array([x == verdict for x in verdicts])
                drawn = _DRAWN.get(verdict, "-")
                # a piece extends to the first point of the next one
                reached = chosen | np.append(False, chosen[:-1])
                ax.plot(at, np.where(reached, values, np.nan), linestyle=drawn, **look)
        for point in content["special_points"]:
            value = _series_at(point, name)
            if value is not None:
                marker = _MARKERS.get(point["kind"], _OF_CONTACT)
                place = labels.in_unit(over, [point["parameter"]]), _numbers([value])
                ax.plot(*place, marker, ms=6, mfc="white", color="#202020")
        ax.set_ylabel(labels.of(name))
        ax.margins(x=0.02, y=0.08)
        plain_ticks(ax.yaxis)
    axes[-1].set_xlabel(labels.of_parameter(over))
    figure.align_ylabels(axes)
    _legend(axes[0], content)


def _series_at(point: Mapping[str, Any], name: str) -> float | None:
    values = {
        **point["q"],
        **{f"{q}_dot": value for q, value in point["v"].items()},
        **{f"lambda.{c}": value for c, value in point["multipliers"].items()},
    }
    return values.get(name)


def _legend(ax: Any, content: Mapping[str, Any]) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color="#202020", linestyle="-", label="stable"),
        Line2D([], [], color="#202020", linestyle=_DRAWN["unstable"], label="unstable"),
    ]
    if any("undecided" in branch["stability"] for branch in content["branches"]):
        undecided = _DRAWN["undecided"]
        handles.append(Line2D([], [], color="#202020", linestyle=undecided, label="not determined"))
    for kind in dict.fromkeys(point["kind"] for point in content["special_points"]):
        marker = _MARKERS.get(kind, _OF_CONTACT)
        handles.append(
            Line2D([], [], color="#202020", marker=marker, mfc="white", ls="", label=kind)
        )
    style.legend_beside(ax, handles, [handle.get_label() for handle in handles])


_POINTS = "#404040"
#: Largest number of measured points that have dots of the usual size.
_FEW_POINTS = 150
_FIT_WIDTH, _DATA, _RESIDUALS = 7.0, 1.9, 0.9  # inches
#: Standard deviations that contain about 95 % of the residuals of a good fit.
_BAND = 2.0


class _ObservedPanel(NamedTuple):
    data: FittedData
    place: int  # index of the observed quantity
    name: str


def plot_fit(path: str, names: Sequence[str], target: FigureFile) -> None:
    """Plot the data, the fitted model and the residuals to a file.

    Parameters
    ----------
    path : str
        A fit file.
    names : sequence of str
        Observed quantities; all of them by default.
    target : FigureFile
        Size, resolution and title; by default as wide as a page, with the model's name.

    Raises
    ------
    UsageError
        A quantity is not observed, or the picture is too large.
    FileError
        A file cannot be read or written.
    """
    from lagcli.analysis.fit.file import read_fit

    draw_result(read_fit(path), names, target, path)


def draw_result(
    result: FitResult, names: Sequence[str], target: FigureTarget, path: str = "the fit"
) -> None:
    """Draw a fit that has been read; see `plot_fit`."""
    panels = _fit_panels(result, names, path)
    heights = [x for _ in panels for x in (_DATA, _RESIDUALS)]
    title = model_title(result.model) or result.model_name
    with target.figure((_FIT_WIDTH, sum(heights) + 0.6), title) as figure:
        draw_fit(figure, result, panels, heights)


def _fit_panels(result: FitResult, names: Sequence[str], path: str) -> list[_ObservedPanel]:
    for name in names:
        if name not in result.observed:
            help_ = did_you_mean(nearest(name, result.observed))
            raise UsageError(
                f"{path} has no observed quantity `{name}`;"
                f" {help_ or 'there are ' + ', '.join(result.observed)}"
            )
    return [
        _ObservedPanel(data, result.observed.index(name), name)
        for data in result.data
        for name in names or result.observed
    ]


def _observed_names(model: Model | None) -> Callable[[str], str]:
    """Return a function from the name of an observed quantity to its label."""
    if model is None:
        return raw
    names, q, constraints = Notation(model), model.coordinate_names, model.constraint_names
    return lambda name: look_of_column(names, name, q, constraints)


def _fitted_model(result: FitResult) -> Model | None:
    """Return the fitted model; None if it is not one of this version, or lacks its data."""
    try:
        return load_text(result.model, result.model_name, data=input_data(result.inputs))
    except LagcliError:
        return None


def draw_fit(
    figure: Any, result: FitResult, panels: Sequence[_ObservedPanel], heights: Sequence[float]
) -> None:
    """Draw each observed quantity of each experiment, with its residuals."""
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    model = _fitted_model(result)
    look = _observed_names(model)
    units = {**({} if model is None else result_units(model)), **result.units}
    constraints = () if model is None else model.constraint_names
    colors = {
        str(ColumnName("multipliers", name)): color
        for name, color in style.constraint_colors(constraints).items()
    }
    axes = []
    for number, panel in enumerate(panels):
        above = figure.add_subplot(grid[2 * number])
        below = figure.add_subplot(grid[2 * number + 1], sharex=above)
        axes += [above, below]
        data, j = panel.data, panel.place
        time, measured, residuals = (
            drawable(x) for x in (data.times, data.measured[:, j], data.residuals[:, j])
        )
        curve = drawable(data.curve_times), drawable(data.curve[:, j])
        there = np.isfinite(measured)
        # the curve is seen below many points
        size = 4 if there.sum() <= _FEW_POINTS else 1.5
        points = {"linestyle": "none", "marker": ".", "markersize": size, "color": _POINTS}
        color = colors.get(panel.name, style.PALETTE[0])
        above.plot(*curve, color=color, linewidth=2, label="fitted")
        above.plot(time[there], measured[there], **points, label="measured")
        if not number:
            style.legend_beside(above)
        above.set_ylabel(_with_unit(look(panel.name), units.get(panel.name)))
        if len(result.data) > 1:
            above.set_title(raw(os.path.basename(data.path)), fontsize=8, loc="left")
        below.axhspan(-_BAND, _BAND, color=style.GREY, alpha=0.2, linewidth=0)
        below.plot(time[there], residuals[there], **points)
        below.set_ylabel(r"residual [$\sigma$]")
        above.tick_params(labelbottom=False)
        below.set_xlabel("$t$ [s]" if number == len(panels) - 1 else "")
        for ax in (above, below):
            plain_ticks(ax.xaxis)
            plain_ticks(ax.yaxis)
    figure.align_ylabels(axes)
