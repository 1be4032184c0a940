"""A pen: lines, areas and text in pixels, drawn by matplotlib's Agg renderer.

Frames of an animation are many and alike: drawn in pixels, one takes milliseconds, a tenth of what
a matplotlib figure takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Pen:
    """Draws on a picture of its own; x to the right and y up, in pixels.

    Parameters
    ----------
    width, height : int
    unit : float
        Pixels for one unit of the widths of lines.
    paper : str
        Colour of the ground.
    """

    def __init__(self, width: int, height: int, unit: float, paper: str):
        from matplotlib.backends.backend_agg import RendererAgg
        from matplotlib.colors import to_rgba
        from matplotlib.transforms import IdentityTransform

        self.width, self.height, self.unit = width, height, unit
        # at 72 dots per inch matplotlib's points are pixels
        self.renderer = RendererAgg(width, height, 72)
        self.paper = paper
        self._as_it_is = IdentityTransform()
        self._rgba = to_rgba

    def clear(self) -> None:
        """Begin with a clean sheet."""
        self.renderer.clear()
        sheet = [(0, 0), (self.width, 0), (self.width, self.height), (0, self.height)]
        self.area(np.array(sheet, dtype=float), self.paper)

    def image(self) -> NDArray[np.uint8]:
        """Return a copy of the picture: (height, width, 3)."""
        return np.asarray(self.renderer.buffer_rgba())[:, :, :3].copy()

    def line(
        self,
        places: Any,
        color: str,
        width: float,
        *,
        alpha: float = 1.0,
        dash: Sequence[float] = (),
        cap: str = "round",
    ) -> None:
        """Draw a line through (n, 2) places, of a width in units."""
        context = self._context(color, width * self.unit, alpha)
        context.set_capstyle(cap)
        if dash:
            context.set_dashes(0, [length * self.unit for length in dash])
        self._draw(context, places, None)

    def area(
        self, places: Any, color: str, alpha: float = 1.0, edge: str | None = None, width: float = 0
    ) -> None:
        """Fill what (n, 2) places surround, with an edge of a width in units."""
        context = self._context(edge or color, width * self.unit, 1.0 if edge else 0.0)
        closed = np.concatenate([places, places[:1]])
        self._draw(context, closed, self._rgba(color, alpha))

    def dot(self, place: Array, radius: float, color: str, edge: str) -> None:
        """Draw a disc of a radius in units."""
        angle = np.linspace(0, 2 * np.pi, 33)[:-1]
        circle = np.column_stack([np.cos(angle), np.sin(angle)]) * radius * self.unit
        self.area(place + circle, color, edge=edge, width=1.6)

    def text(
        self,
        text: str,
        place: Any,
        color: str,
        size: float = 12,
        align: str = "left",
        *,
        halo: bool = False,
    ) -> float:
        """Write text beside a place, in the middle of its height; return its width in pixels.

        With a halo, what is under the text fades.
        """
        from matplotlib.font_manager import FontProperties

        font = FontProperties(size=size * max(1.0, self.unit))
        width, height, descent = self.renderer.get_text_width_height_descent(text, font, False)
        left = place[0] - {"left": 0.0, "center": width / 2, "right": width}[align]
        if halo:
            right, half = left + width + 2, height / 2 + 1
            low, high = place[1] - half, place[1] + half
            corners = [(left - 2, low), (right, low), (right, high), (left - 2, high)]
            self.area(np.array(corners), self.paper, 0.7)
        foot = self.height - place[1] + (height - descent) / 2
        context = self._context(color, 0, 1.0)
        self.renderer.draw_text(context, left, foot, text, font, 0)
        context.restore()
        return float(width)

    def _context(self, color: str, width: float, alpha: float) -> Any:
        context = self.renderer.new_gc()
        context.set_foreground(self._rgba(color, alpha), isRGBA=True)
        context.set_linewidth(width)
        context.set_joinstyle("round")
        return context

    def _draw(self, context: Any, places: Any, fill: Any) -> None:
        from matplotlib.path import Path

        path = Path(np.asarray(places, dtype=float)[:, :2])
        self.renderer.draw_path(context, path, self._as_it_is, fill)
        context.restore()
