"""A picture in SVG with the drawing operations of a raster image, without matplotlib."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from lagcli.arrays import Array

#: Mean width of a character, relative to the font size.
_LETTER = 0.56
_ANCHORS = {"left": "start", "center": "middle", "right": "end"}


class VectorPicture:
    """An SVG picture; see `lagcli.pictures.scene.raster.Raster`, whose operations it has.

    Parameters
    ----------
    width, height, unit, paper
        As for `Raster`: x to the right and y up.
    """

    def __init__(self, width: int, height: int, unit: float, paper: str):
        self.width, self.height, self.unit, self.paper = width, height, unit, paper
        self._parts: list[str] = []

    def clear(self) -> None:
        """Clear the picture."""
        self._parts = [f'<rect width="{self.width}" height="{self.height}" fill="{self.paper}"/>']

    def svg(self) -> str:
        """Return the picture as the text of a file."""
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.width} {self.height}"'
            f' width="{self.width}" height="{self.height}" font-family="sans-serif"'
            f' stroke-linejoin="round">{"".join(self._parts)}</svg>'
        )

    def element(self, label: str, *, of_model: bool = False) -> str:
        """Return the picture as an image element with an alternative text, perhaps the model's."""
        kept = ' translate="no"' if of_model else ""
        return (
            f'<img alt="{escape(label)}"{kept} width="{self.width}" height="{self.height}"'
            f' src="data:image/svg+xml;base64,{b64encode(self.svg().encode()).decode()}">'
        )

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
        """Draw a line through (n, 2) places, of a width in units; gaps where they are not
        finite."""
        dashes = ",".join(f"{length * self.unit:.1f}" for length in dash)
        more = f' stroke-dasharray="{dashes}"' if dash else ""
        more += f' stroke-opacity="{alpha:.2g}"' if alpha < 1 else ""
        self._parts.append(
            f'<path d="{self._path(places)}" fill="none" stroke="{color}"'
            f' stroke-width="{width * self.unit:.2f}" stroke-linecap="{cap}"{more}/>'
        )

    def area(
        self, places: Any, color: str, alpha: float = 1.0, edge: str | None = None, width: float = 0
    ) -> None:
        """Fill the polygon of (n, 2) positions, with an edge of a width in units."""
        stroke = f' stroke="{edge}" stroke-width="{width * self.unit:.2f}"' if edge else ""
        self._parts.append(
            f'<path d="{self._path(places)}Z" fill="{color}" fill-opacity="{alpha:.2g}"{stroke}/>'
        )

    def dot(self, place: Array, radius: float, color: str, edge: str) -> None:
        """Draw a disc of a radius in units."""
        x, y = place[0], self.height - place[1]
        self._parts.append(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius * self.unit:.1f}" fill="{color}"'
            f' stroke="{edge}" stroke-width="{1.6 * self.unit:.2f}"/>'
        )

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
        """Write text at a position, vertically centred; return about its width in pixels."""
        size *= max(1.0, self.unit)
        around = f' stroke="{self.paper}" stroke-width="4" paint-order="stroke"' if halo else ""
        self._parts.append(
            f'<text x="{place[0]:.1f}" y="{self.height - place[1]:.1f}" dy="0.36em"'
            f' font-size="{size:.1f}" text-anchor="{_ANCHORS[align]}" fill="{color}"{around}>'
            f"{escape(text)}</text>"
        )
        return _LETTER * size * len(text)

    def _path(self, places: Any) -> str:
        points = np.asarray(places, dtype=float)[:, :2]
        begun, parts = False, []
        for x, y in points.tolist():
            if x - x + y - y != 0:  # not finite
                begun = False
                continue
            parts.append(f"{'L' if begun else 'M'}{x:.1f} {self.height - y:.1f}")
            begun = True
        return "".join(parts)
