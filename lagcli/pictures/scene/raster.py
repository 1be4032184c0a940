"""A raster image: lines, areas and text in pixels, drawn by matplotlib's Agg renderer.

Frames of an animation are many and similar: drawn in pixels, one takes milliseconds, a tenth of a
matplotlib figure.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from lagcli.arrays import Array, Image

#: Font size of cached outlines, and the middle of small letters at that size.
_EM, _MIDDLE = 100.0, 0.36


@lru_cache(maxsize=1000)
def _glyph(character: str) -> tuple[Any, float]:
    """Return the outline of a character and its advance width.

    Text layout takes milliseconds, and each frame contains the same few characters.
    """
    from matplotlib.textpath import TextPath

    outline = None if character.isspace() else TextPath((0, 0), character, size=_EM)
    # the next character shows the advance width, also of a space
    after, alone = (TextPath((0, 0), text, size=_EM) for text in (f"{character}|", "|"))
    return outline, float(after.get_extents().x1 - alone.get_extents().x1)


class Raster:
    """A raster image and its drawing operations; x to the right and y up, in pixels.

    Parameters
    ----------
    width, height : int
    unit : float
        Pixels per unit of line width.
    paper : str
        Background colour.
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

    def clear(self, still: Image | None = None) -> None:
        """Clear the raster, or copy a picture to it: (height, width, 4)."""
        self.renderer.clear()
        if still is not None:
            np.asarray(self.renderer.buffer_rgba())[...] = still
            return
        sheet = [(0, 0), (self.width, 0), (self.width, self.height), (0, self.height)]
        self.area(np.array(sheet, dtype=float), self.paper)

    def image(self) -> Image:
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
        """Fill the polygon of (n, 2) positions, with an edge of a width in units."""
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
        """Write text at a position, vertically centred; return its width in pixels.

        A halo separates it from the background.
        """
        from matplotlib.path import Path
        from matplotlib.transforms import Affine2D

        glyphs = [_glyph(character) for character in text]
        starts = np.cumsum([0.0, *(advance for _, advance in glyphs)])
        scale = size * max(1.0, self.unit) / _EM
        width = float(starts[-1] * scale)
        outlines = [
            Path(glyph.vertices + np.array([start, 0.0]), glyph.codes)
            for (glyph, _), start in zip(glyphs, starts, strict=False)
            if glyph is not None
        ]
        if not outlines:
            return width
        left = place[0] - {"left": 0.0, "center": width / 2, "right": width}[align]
        foot = place[1] - _MIDDLE * _EM * scale
        path, at = Path.make_compound_path(*outlines), Affine2D().scale(scale).translate(left, foot)
        if halo:
            context = self._context(self.paper, 4, 1.0)
            self.renderer.draw_path(context, path, at, None)
            context.restore()
        context = self._context(color, 0, 0.0)
        self.renderer.draw_path(context, path, at, self._rgba(color))
        context.restore()
        return width

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
