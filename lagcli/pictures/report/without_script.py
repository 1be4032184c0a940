"""What a report shows without JavaScript: a picture of the mechanism, a plot of λ, a sentence."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lagcli.pictures.curves import Curve
from lagcli.pictures.page import number
from lagcli.pictures.report.run_plots import Plot
from lagcli.pictures.scene.scene import Scene
from lagcli.pictures.scene.still import still_image
from lagcli.pictures.scene.timing import round_number
from lagcli.pictures.scene.vector import VectorPicture
from lagcli.pictures.selection import thin
from lagcli.pictures.style import GREY, ROLES, line

_WIDTH, _HEIGHT = 640, 320
_LEFT, _RIGHT, _BELOW, _ABOVE = 80, 120, 44, 24
_COLUMNS = 300  # pixels that a curve distinguishes
_NAMED = 12  # curves


def without_script(
    plot: Plot | None, colors: Mapping[str, str], scene: Scene | None, title: str
) -> str:
    """Return HTML for browsers in which scripts are off.

    Parameters
    ----------
    plot : Plot, optional
        Of λ, or of the coordinates of a free system.
    colors : mapping of str to str
        The colour of each constraint.
    scene : Scene, optional
        The mechanism, if the model has a view.
    title : str
        Plain text.
    """
    images = [] if scene is None else [still_image(scene, title)]
    if plot is not None and len(plot.time) > 1:
        images.append(_drawn(plot, colors))
    said = "The animation, the plots and the values of terms need JavaScript, which is switched off"
    said += " here; equations, tables and the model are complete."
    return (
        f'<noscript><figure class="still">{"".join(images)}'
        f'<figcaption class="status stopped">{said}</figcaption></figure></noscript>'
    )


def _drawn(plot: Plot, colors: Mapping[str, str]) -> str:
    """Return an image of curves over time."""
    picture = VectorPicture(_WIDTH, _HEIGHT, 1.0, ROLES["paper"])
    picture.clear()
    time, finite = plot.time, plot.values[np.isfinite(plot.values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    margin = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    low, high = low - margin, high + margin

    def across(t: float) -> float:
        return float(_LEFT + (t - time[0]) / (time[-1] - time[0]) * (_WIDTH - _LEFT - _RIGHT))

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
    if plot.unit:
        picture.text(f"[{plot.unit}]", (_LEFT, _HEIGHT - 10), ROLES["label"], 12, "right")
    for i, curve in enumerate(plot.curves[:_NAMED]):
        color, values = colors.get(curve.constraint, line(i)["color"]), plot.values[:, i]
        kept = thin(time, values, _COLUMNS)
        places = [(across(t), up(y)) for t, y in zip(time[kept], values[kept], strict=True)]
        picture.line(places, color, 1.6)
        top = _HEIGHT - _ABOVE - 17 * i - 8
        picture.line([(_WIDTH - _RIGHT + 10, top), (_WIDTH - _RIGHT + 28, top)], color, 2)
        picture.text(_name(curve), (_WIDTH - _RIGHT + 34, top), ROLES["label"], 12)
    return picture.element(f"{', '.join(map(_name, plot.curves[:_NAMED]))} over time")


def _name(curve: Curve) -> str:
    return curve.label.replace("_", " ")


def _ticks(low: float, high: float) -> list[float]:
    """Return round numbers in an interval."""
    step = round_number((high - low) / 4)
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return [float(f"{n * step:.12g}") for n in np.arange(first, last + 1) + 0.0]
