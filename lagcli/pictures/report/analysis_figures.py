"""Pictures of analyses for pages: the plots of `lagcli plot`, light and dark."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from typing import Any

from lagcli.pictures.plots.figure_file import FigureTarget, new_figure

#: Colours of light pictures, and the corresponding ones of dark pages.
_DARK = {
    "#ffffff": "#16191d",
    "#000000": "#e8e8e8",
    "#202020": "#ececec",
    "#262626": "#e8e8e8",
    "#404040": "#a8b0b8",
    "#d9d9d9": "#343a42",
    "#8c8c8c": "#8c939b",
    "white": "#16191d",
}


class _HeldFigure:
    """A figure that is stored as SVG."""

    kind, dpi = "svg", 100.0
    svg = ""

    @contextmanager
    def figure(self, size: tuple[float, float], title: str) -> Iterator[Any]:
        """Create a figure; the page contains the title."""
        with new_figure(size, 100) as figure:
            yield figure
            held = io.BytesIO()
            figure.savefig(held, format="svg", metadata={"Date": None, "Title": title})
            self.svg = held.getvalue().decode("utf-8")


def picture(draw: Callable[[FigureTarget], object], caption: str) -> str:
    """Return a picture in HTML.

    Parameters
    ----------
    draw : callable
        Function that draws to the given target.
    caption : str
        Alternative text.

    Raises
    ------
    UsageError
        matplotlib is not installed.
    """
    target = _HeldFigure()
    draw(target)
    images = "".join(
        f'<img class="{name}" alt="{escape(caption)}" src="data:image/svg+xml;base64,'
        f'{base64.b64encode(svg.encode()).decode()}">'
        for name, svg in (("light", target.svg), ("dark", _darkened(target.svg)))
    )
    return f'<figure class="picture">{images}</figure>'


def _darkened(svg: str) -> str:
    """Return a picture for dark pages."""
    for light, dark in _DARK.items():
        svg = svg.replace(f": {light}", f": {dark}")
    # letters have no colour attribute
    return svg.replace('<style type="text/css">', '<style type="text/css">text{fill:#e8e8e8}', 1)
