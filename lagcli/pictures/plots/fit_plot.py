"""Plots of fits: measured values with the fitted model, and the residuals below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lagcli.analysis.fit.file import read_fit
from lagcli.analysis.fit.result import FitResult, FittedData
from lagcli.errors import UsageError
from lagcli.model.spelling import did_you_mean, nearest
from lagcli.pictures.plots import style
from lagcli.pictures.plots.curves import pretty_unit
from lagcli.pictures.plots.figure_file import FigureFile, FigureTarget
from lagcli.pictures.plots.ticks import drawable, plain_ticks

_WIDTH, _DATA, _RESIDUALS = 7.0, 1.9, 0.9  # inches
_GREY = "#8C8C8C"
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
    draw_result(read_fit(path), names, target, path)


def draw_result(
    result: FitResult, names: Sequence[str], target: FigureTarget, path: str = "the fit"
) -> None:
    """Draw a fit that has been read; see `plot_fit`."""
    panels = _panels(result, names, path)
    heights = [x for _ in panels for x in (_DATA, _RESIDUALS)]
    with target.figure((_WIDTH, sum(heights) + 0.6), result.model_name) as figure:
        draw_fit(figure, result, panels, heights)


def _panels(result: FitResult, names: Sequence[str], path: str) -> list[_ObservedPanel]:
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


def draw_fit(
    figure: Any, result: FitResult, panels: Sequence[_ObservedPanel], heights: Sequence[float]
) -> None:
    """Draw each observed quantity of each experiment, with its residuals."""
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    axes = []
    for number, panel in enumerate(panels):
        above = figure.add_subplot(grid[2 * number])
        below = figure.add_subplot(grid[2 * number + 1], sharex=above)
        axes += [above, below]
        data, j = panel.data, panel.place
        time, measured, model, residuals = (
            drawable(x)
            for x in (data.times, data.measured[:, j], data.model[:, j], data.residuals[:, j])
        )
        there = np.isfinite(measured)
        points = {"linestyle": "none", "marker": ".", "markersize": 3, "color": _GREY}
        above.plot(time[there], measured[there], **points, label="measured")
        above.plot(time, model, **style.line(0), label="fitted")
        style.legend_beside(above)
        unit = pretty_unit(result.units.get(panel.name, ""))
        label = panel.name.replace("$", r"\$")
        above.set_ylabel(f"{label} [{unit}]" if unit else label)
        if len(result.data) > 1:
            above.set_title(data.path.replace("$", r"\$"), fontsize=8, loc="left")
        below.axhspan(-_BAND, _BAND, color=_GREY, alpha=0.2, linewidth=0)
        below.plot(time[there], residuals[there], **points)
        below.set_ylabel(r"residual [$\sigma$]")
        above.tick_params(labelbottom=False)
        below.set_xlabel("$t$ [s]" if number == len(panels) - 1 else "")
        for ax in (above, below):
            plain_ticks(ax.xaxis)
            plain_ticks(ax.yaxis)
    figure.align_ylabels(axes)
