"""Style of all pictures: a colour-blind safe palette and line styles for print."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.pictures.selection import by_family

#: The hues of Okabe & Ito, "Color Universal Design", 2008, without black and yellow; the last three
#: are darker, so that all have a contrast of 3 with white pages and with dark ones.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CB78A6", "#915D00", "#089DDC")

#: Colours of constraints, by index; see `constraint_colors`.
CONSTRAINT_COLORS = (*PALETTE[1:], PALETTE[0])

#: Measured points, axes through 0, and what has no value.
GREY = "#8C8C8C"

#: Line styles combined with the colours: the number of combinations is their product.
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)), (0, (9, 2)))

#: Markers of curves that are drawn as points.
MARKERS = ("o", "x", "^", "s", "+", "D")

#: Colours of the elements of a scene.
ROLES = {
    "rod": "#404040",
    "spring": "#009E73",
    "guide": "#8C8C8C",
    "ground": "#767676",
    "disc": "#404040",
    "point": "#202020",
    "trail": "#56B4E9",
    "label": "#202020",
    "velocity": "#0072B2",
    "force": "#D55E00",
    "vector": "#CC79A7",
    "paper": "#FFFFFF",
}

#: Colour map of values over two parameters; perceptually uniform, also in grey.
COLORMAP = "viridis"


#: Colours of the members of a large family, from the first to the last, on light and dark pages.
_FAMILY = ("#7A5CC0", "#3B7DC4", "#1D9A94", "#4FA538", "#AB9000")


def constraint_colors(constraints: Sequence[str]) -> dict[str, str]:
    """Return the colour of each constraint of a model, by name.

    It is the colour of its λ, its impulses, its arrows and its terms, in plots and on pages. Other
    curves have the palette's colours in order, and members of large families `family_colors`.
    """
    colors = {
        name: CONSTRAINT_COLORS[i % len(CONSTRAINT_COLORS)] for i, name in enumerate(constraints)
    }
    return colors | family_colors(constraints)


def family_colors(names: Sequence[str]) -> dict[str, str]:
    """Return the colours of the members of families that are larger than the palette, by name."""
    colors: dict[str, str] = {}
    for family in by_family(names, len(PALETTE)):
        members = [names[i] for i in family]
        if len(members) > len(PALETTE) and all("[" in name for name in members):
            last = len(members) - 1
            colors |= {name: graded(i / last) for i, name in enumerate(members)}
    return colors


def graded(part: float) -> str:
    """Return the colour of a member of a family, from the first (0) to the last (1)."""
    place = part * (len(_FAMILY) - 1)
    k = min(int(place), len(_FAMILY) - 2)
    ends = [[int(x[n : n + 2], 16) for n in (1, 3, 5)] for x in _FAMILY[k : k + 2]]
    mixed = [round(a + (place - k) * (b - a)) for a, b in zip(*ends, strict=True)]
    return "#" + "".join(f"{x:02X}" for x in mixed)


def family_scale(first: float, last: float) -> Any:
    """Return the scale of `family_colors` for a colour bar, by the index of the members.

    Parameters
    ----------
    first, last : float
        Indices of the first and the last member.

    Returns
    -------
    matplotlib.cm.ScalarMappable
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    shades = ListedColormap([graded(i / 255) for i in range(256)])
    return ScalarMappable(Normalize(first, last), shades)


def line(number: int) -> dict[str, Any]:
    """Return colour and line style of a curve by number.

    Parameters
    ----------
    number : int
        Number from 0. Colours change first, then both together, so that thirty curves all differ.

    Returns
    -------
    dict
        ``color`` and ``linestyle`` for matplotlib.
    """
    turn, place = divmod(number, len(PALETTE))
    return {"color": PALETTE[place], "linestyle": DASHES[(place + turn) % len(DASHES)]}


def shade(part: Any) -> Any:
    """Return the colours of values between 0 and 1."""
    from matplotlib import colormaps

    return colormaps[COLORMAP](0.9 * part)  # without the bright end, which is invisible on white


def grades(values: Any, log: bool = False) -> Any:
    """Return the colour map and its normalization for curves and a colour bar.

    Parameters
    ----------
    values : sequence of float
    log : bool
        Whether colours follow the logarithm.

    Returns
    -------
    matplotlib.cm.ScalarMappable
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, LogNorm, Normalize

    norm = (LogNorm if log else Normalize)(min(values), max(values))
    return ScalarMappable(norm, ListedColormap(shade(np.arange(256) / 255)))


def legend_beside(ax: Any, *entries: Any) -> None:
    """Draw the legend of a panel next to it.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    *entries
        Handles and labels; by default those of the curves.
    """
    ax.legend(*entries, loc="upper left", bbox_to_anchor=(1.0, 1.0))


#: Height of a label at the end of a curve, and least distance of two ends that it tells apart,
#: points.
_LABEL_HEIGHT, _ENDS_APART = 11.0, 4.0


def label_ends(ax: Any, lines: Sequence[Any], labels: Sequence[str]) -> bool:
    """Write the labels of curves at their right ends, if each is next to its own end.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        With its final limits.
    lines : sequence of matplotlib.lines.Line2D
    labels : sequence of str

    Returns
    -------
    bool
        Whether there is room; otherwise nothing is written.
    """
    last = ax.get_xlim()[1]
    low, high = ax.get_ylim()
    height = 72 * ax.get_position().height * ax.figure.get_figheight()
    ends = [(line.get_xdata()[-1:], line.get_ydata()[-1:]) for line in lines]
    if not all(len(x) and x[0] == last and np.isfinite(y[0]) for x, y in ends):
        return False
    at = height * (np.array([y[0] for _, y in ends]) - low) / (high - low)
    places = spread(at, _LABEL_HEIGHT, height)
    if places is None or (np.diff(np.sort(at)) < _ENDS_APART).any():
        return False
    for line, label, end, place in zip(lines, labels, at, places, strict=True):
        # a line of its colour leads to the label: pale letters would be hard to read
        leader = {"arrowstyle": "-", "color": line.get_color(), "shrinkA": 1, "shrinkB": 1}
        ax.annotate(
            label,
            (1.0, end / height),
            (12, place - end),
            xycoords="axes fraction",
            textcoords="offset points",
            va="center",
            fontsize=8,
            annotation_clip=False,
            arrowprops=leader,
        )
    return True


def spread(at: Array, apart: float, height: float) -> Array | None:
    """Return places near others that are at least so far apart, between 0 and a height.

    The order stays; None if there is no room.
    """
    count = len(at)
    if (count - 1) * apart > height:
        return None
    order = np.argsort(at)
    steps = apart * np.arange(count)
    # without the steps between them, places need only be in order: means of those that are not
    blocks: list[list[float]] = []
    for wanted in (at[order] - steps).tolist():
        blocks.append([wanted, 1.0])
        while len(blocks) > 1 and blocks[-2][0] >= blocks[-1][0]:
            mean, weight = blocks.pop()
            first, more = blocks[-1]
            blocks[-1] = [(first * more + mean * weight) / (more + weight), more + weight]
    level = np.repeat([mean for mean, _ in blocks], [int(weight) for _, weight in blocks])
    places = np.empty(count)
    places[order] = np.clip(level, 0.0, height - steps[-1]) + steps
    return places


def settings() -> Any:
    """Return the matplotlib settings of a picture."""
    return {
        # fonts included in matplotlib, so that pictures look the same everywhere
        "font.family": "DejaVu Sans",
        "font.size": 9,
        "mathtext.fontset": "dejavusans",
        "axes.formatter.useoffset": False,
        "axes.formatter.limits": (-4, 5),
        "axes.grid": True,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.labelsize": 9,
        "axes.titlesize": 10,
        "axes.linewidth": 0.7,
        "axes.xmargin": 0.0,
        "grid.color": "#D9D9D9",
        "grid.linewidth": 0.5,
        "lines.linewidth": 1.2,
        "legend.fontsize": 8,
        "legend.framealpha": 0.85,
        "legend.edgecolor": "#D9D9D9",
        "legend.handlelength": 2.6,
        "legend.borderaxespad": 0.2,
        "figure.dpi": 100,
        "figure.constrained_layout.use": True,
        "figure.max_open_warning": 0,
        "svg.fonttype": "none",  # text remains text that can be searched and edited
        "svg.hashsalt": "lagcli",  # reproducible files
        "pdf.fonttype": 42,
        "path.simplify": True,
        "agg.path.chunksize": 10_000,
    }
