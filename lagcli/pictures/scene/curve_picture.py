"""A picture of curves over time, without matplotlib, for pages that are read without JavaScript."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lagcli.arrays import Array
from lagcli.pictures.page import number
from lagcli.pictures.scene.timing import round_number
from lagcli.pictures.scene.vector import VectorPicture
from lagcli.pictures.selection import thin
from lagcli.pictures.style import GREY, ROLES, line

_WIDTH, _HEIGHT = 640, 320
_LEFT, _RIGHT, _BELOW, _ABOVE = 80, 120, 44, 24
_COLUMNS = 300  # pixels that a curve distinguishes
_NAMED = 12  # curves


def curve_picture(
    time: Array,
    values: Array,
    labels: Sequence[str],
    unit: str,
    colors: Sequence[str | None] = (),
) -> VectorPicture:
    """Return a picture of curves over time.

    Parameters
    ----------
    time : (m,) array
    values : (m, n) array
    labels : sequence of str
        Of the curves; those after the first twelve are not drawn.
    unit : str
        Of the values, as it is written; empty if they have different ones.
    colors : sequence of str or None, optional
        Of the curves; by default the palette's.
    """
    picture = VectorPicture(_WIDTH, _HEIGHT, 1.0, ROLES["paper"])
    picture.clear()
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    margin = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    low, high = low - margin, high + margin
    span = float(time[-1] - time[0]) or 1.0  # all samples may be at one time

    def across(t: float) -> float:
        return float(_LEFT + (t - time[0]) / span * (_WIDTH - _LEFT - _RIGHT))

    def up(y: float) -> float:
        return _BELOW + (y - low) / (high - low) * (_HEIGHT - _BELOW - _ABOVE)

    for y in _ticks(low, high):
        picture.line([(_LEFT, up(y)), (_WIDTH - _RIGHT, up(y))], GREY, 0.5, alpha=0.5)
        picture.text(number(y), (_LEFT - 8, up(y)), ROLES["label"], 12, "right")
    for t in _ticks(float(time[0]), float(time[-1])):
        picture.line([(across(t), _BELOW), (across(t), _BELOW - 5)], GREY, 1)
        picture.text(number(t), (across(t), _BELOW - 14), ROLES["label"], 12, "center")
    picture.line([(_LEFT, _BELOW), (_WIDTH - _RIGHT, _BELOW)], GREY, 1)
    picture.text("t [s]", ((_LEFT + _WIDTH - _RIGHT) / 2, 10), ROLES["label"], 12, "center")
    if unit:
        picture.text(f"[{unit}]", (_LEFT, _HEIGHT - 10), ROLES["label"], 12, "right")
    chosen = [*colors, *[None] * (len(labels) - len(colors))]
    for i, label in enumerate(labels[:_NAMED]):
        color = chosen[i] or line(i)["color"]
        kept = thin(time, values[:, i], _COLUMNS)
        places = [(across(t), up(y)) for t, y in zip(time[kept], values[kept, i], strict=True)]
        picture.line(places, color, 1.6)
        top = _HEIGHT - _ABOVE - 17 * i - 8
        picture.line([(_WIDTH - _RIGHT + 10, top), (_WIDTH - _RIGHT + 28, top)], color, 2)
        picture.text(label.replace("_", " "), (_WIDTH - _RIGHT + 34, top), ROLES["label"], 12)
    return picture


def curve_image(
    time: Array,
    values: Array,
    labels: Sequence[str],
    unit: str,
    colors: Sequence[str | None] = (),
) -> str:
    """Return the picture of `curve_picture` as an image in HTML, with what it shows in words."""
    said = f"{', '.join(x.replace('_', ' ') for x in labels[:_NAMED])} over time"
    return curve_picture(time, values, labels, unit, colors).element(said)


def _ticks(low: float, high: float) -> list[float]:
    """Return round numbers in an interval."""
    if not low < high:
        return [low]
    step = round_number((high - low) / 4)
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return [float(f"{n * step:.12g}") for n in np.arange(first, last + 1) + 0.0]
