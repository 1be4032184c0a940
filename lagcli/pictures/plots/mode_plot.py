"""Plots of modes: the shape of each as a picture of the mechanism, and the poles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lagcli.arrays import Image
from lagcli.errors import UsageError
from lagcli.model.model import Model
from lagcli.pictures import style
from lagcli.pictures.plots.figure import FigureTarget, plain_ticks
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.selection import drawable

_WIDTH, _SPECTRUM = 6.5, 3.4  # inches
_SHAPES, _COLUMNS, _SHAPE = 6, 3, 1.8  # modes that are shown, in a row; height, inches
_PIXELS = (480, 360)  # of a shape
#: Prefix of the ids of the pictures of a mechanism in an SVG.
DRAWN = "drawn-"
_NUMBERED = 40  # largest number of modes whose poles are numbered
_KINDS = {
    "neutral": "o",
    "oscillation": "o",
    "growing oscillation": "^",
    "decay": "s",
    "divergence": "D",
}
#: How much of its contrast the mechanism keeps at rest, and at the other end of its motion.
_REST, _OTHER_END = 0.35, 0.15


def plot_modes(
    content: Mapping[str, Any], target: FigureTarget, title: str, model: Model | None, path: str
) -> None:
    """Plot the shapes of the first modes, if the mechanism can be drawn, and all poles.

    Parameters
    ----------
    content : mapping
        Content of ``lagcli modes``.
    target : FigureTarget
    title : str
    model : Model, optional
    path : str
        The file, for messages.

    Raises
    ------
    UsageError
        There are no modes.
    FileError
        The content is not that of the model, or the figure cannot be written.
    """
    if not content["modes"]:
        raise UsageError(f"{content['model']} has no modes: there is nothing to plot")
    shapes = _shapes(content, model, path)
    columns = min(_COLUMNS, len(shapes))
    rows = -(-len(shapes) // columns) if shapes else 0
    heights = [*[_SHAPE] * rows, _SPECTRUM]
    with target.figure((_WIDTH, sum(heights) + 0.3), title) as figure:
        grid = figure.add_gridspec(rows + 1, 1, height_ratios=heights)
        cells = [grid[row].subgridspec(1, columns) for row in range(rows)]
        for place, (mode, image) in enumerate(zip(content["modes"], shapes, strict=False)):
            ax = figure.add_subplot(cells[place // columns][place % columns])
            shown = ax.imshow(image, interpolation="antialiased")
            shown.set_gid(f"{DRAWN}{mode['number']}")
            ax.axis("off")
            ax.set_title(f"Mode {mode['number']}: {_described(mode)}", fontsize=8)
        _draw_spectrum(figure.add_subplot(grid[rows]), content["modes"])


def _shapes(content: Mapping[str, Any], model: Model | None, path: str) -> list[Image]:
    """Return pictures of the first modes; none if the mechanism cannot be drawn."""
    from lagcli.analysis.linear.mode_motion import StoredModes
    from lagcli.pictures.scene.automatic_view import with_view
    from lagcli.pictures.scene.drawing import SceneDrawing
    from lagcli.pictures.scene.view_evaluator import scene_of

    viewed = None if model is None else with_view(model)
    if viewed is None or viewed.view is None:
        return []
    viewed = replace(viewed, view=viewed.view._replace(vectors=(), trails=(), labels={}))
    modes, images = StoredModes(content, viewed, path), []
    for number in range(1, min(len(content["modes"]), _SHAPES) + 1):
        scene = scene_of(RunFile(modes.extremes(number)), model=viewed)
        assert scene is not None
        drawing = SceneDrawing(scene, *_PIXELS, annotated=False)
        rest, end, other = (drawing.frame(time) for time in scene.time)
        images.append(np.minimum(end, np.minimum(_faded(rest, _REST), _faded(other, _OTHER_END))))
    return images


def _faded(image: Image, contrast: float) -> Image:
    """Return a picture with less contrast to white paper."""
    return np.asarray(255 - contrast * (255.0 - image)).astype(np.uint8)


def _described(mode: Mapping[str, Any]) -> str:
    """Return the frequency of a mode, or its time constant, and its damping."""
    kind = mode["kind"]
    if mode["frequency"]:
        damping = mode["damping_ratio"]
        return f"{mode['frequency']:.3g} Hz" + (f", ζ = {damping:.2g}" if damping else "")
    return f"{kind}, {mode['time_constant']:.3g} s" if mode["time_constant"] else str(kind)


def _draw_spectrum(ax: Any, modes: Sequence[Mapping[str, Any]]) -> None:
    """Draw the poles with their numbers."""
    for draw in (ax.axhline, ax.axvline):
        draw(0, color=style.GREY, lw=0.7)
    for number, (kind, marker) in enumerate(_KINDS.items()):
        mine = [mode for mode in modes if mode["kind"] == kind]
        if not mine:
            continue
        points = drawable(np.array([mode["eigenvalue"] for mode in mine], dtype=float))
        look = {"ls": "", "ms": 5, "color": style.PALETTE[number % len(style.PALETTE)]}
        for sign in (1, -1):
            label = kind if sign == 1 else None
            ax.plot(points[:, 0], sign * points[:, 1], marker, **look, label=label)
        for (x, y), mode in zip(points, mine, strict=True):
            if len(modes) <= _NUMBERED and kind != "neutral":
                ax.annotate(str(mode["number"]), (x, y), (4, 3), textcoords="offset points")
    ax.set_xlabel("Re $s$ [1/s]")
    ax.set_ylabel("Im $s$ [1/s]")
    ax.margins(0.12)
    for axis in (ax.xaxis, ax.yaxis):
        plain_ticks(axis)
    values = drawable(np.array([mode["eigenvalue"] for mode in modes], dtype=float))
    reach = np.nanmax(np.abs(values), initial=0.0) or 1.0
    if not np.any(values[:, 0]):  # undamped: centre the imaginary axis
        ax.set_xlim(-reach / 4, reach / 4)
    if not np.any(values[:, 1]):
        ax.set_ylim(-reach / 4, reach / 4)
    style.legend_beside(ax)
