"""Tornado charts: effects of the varied quantities on a measure.

The bar of a quantity spans the means of the measure over the rows with each of its values, if
all values were combined; otherwise what a linear fit to all rows says of its range.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.errors import UsageError
from lagcli.pictures.plots import style
from lagcli.pictures.plots.ticks import plain_ticks

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
        By label.
    measure : (rows,) array
        NaN for rows without a value.

    Raises
    ------
    UsageError
        Too few rows have a value.
    """
    good = np.isfinite(measure)
    changing = {k: x[good] for k, x in varied.items() if len(np.unique(x[good])) > 1}
    y = measure[good]
    if not changing or len(y) <= len(changing):
        raise UsageError(
            "a tornado chart needs more rows with a measure than quantities that were varied"
        )
    levels = {k: np.unique(x) for k, x in changing.items()}
    factorial = np.prod([len(x) for x in levels.values()]) == len(y)
    found = []
    if factorial and max(map(len, levels.values())) <= _LEVELS:
        for label, x in changing.items():
            means = [float(y[x == level].mean()) for level in levels[label]]
            found.append(Effect(label, means[0], means[-1], min(means), max(means)))
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
            found.append(Effect(label, low, high, min(low, high), max(low, high)))
    return sorted(found, key=lambda e: e.largest - e.least, reverse=True)


def draw_tornado(ax: Any, found: list[Effect], label: str) -> None:
    """Draw a bar for each quantity, the longest on top; colours distinguish low and high values."""
    center = float(np.mean([0.5 * (e.low + e.high) for e in found]))
    for place, effect in enumerate(reversed(found)):
        for end, color in ((effect.low, style.PALETTE[0]), (effect.high, style.PALETTE[1])):
            ax.barh(place, end - center, left=center, color=color, height=0.6)
        ax.plot([effect.least, effect.largest], [place, place], color="#404040", linewidth=0.8)
    ax.set_yticks(range(len(found)), [e.label for e in reversed(found)])
    ax.axvline(center, color="#404040", linewidth=0.8)
    ax.grid(False, axis="y")
    ax.set_axisbelow(True)
    ax.margins(x=0.05)
    ax.set_xlabel(label)
    plain_ticks(ax.xaxis)
    from matplotlib.patches import Patch

    handles = [Patch(color=style.PALETTE[i]) for i in (0, 1)]
    style.legend_beside(ax, handles, ["lowest value", "highest value"])
