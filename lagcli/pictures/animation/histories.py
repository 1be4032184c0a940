"""Coordinates as functions of time, with a moving mark: for models without a view."""

from __future__ import annotations

from typing import Any

import numpy as np

from lagcli.arrays import Array, Image, Indices
from lagcli.pictures.plots.curves import Catalogue, pretty_unit, read_curves
from lagcli.pictures.plots.figure_file import new_figure
from lagcli.pictures.plots.panels import Panel, asked
from lagcli.pictures.plots.run_plot import PanelDrawing
from lagcli.pictures.plots.style import PALETTE, ROLES
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.raster import Raster

_DPI = 100
_MARKED = 10  # largest number of curves with a moving dot


class Histories:
    """The coordinates of a run at some samples.

    Parameters
    ----------
    run : Run
    samples : (m,) array of int
        Indices of the samples, increasing.
    """

    def __init__(self, run: RunFile, samples: Indices):
        self.run = run
        self.catalogue = Catalogue(run)
        self.panels: list[Panel] = asked(self.catalogue, run.coordinates)
        values = read_curves(run, {curve for panel in self.panels for curve in panel.curves})
        self.values = {name: column[samples] for name, column in values.items()}
        self.time: Array = self.values["t"]

    def to_json(self) -> dict[str, Any]:
        """Return the data for ``assets/histories.js``."""
        notation = self.catalogue.notation
        return {
            "time": self.time,
            "palette": PALETTE,
            "plots": [
                {
                    "title": "",
                    "unit": pretty_unit(panel.curves[0].unit),
                    "series": [
                        {
                            "name": c.name,
                            "label": notation.text(c.name) if notation else c.name,
                            "values": self.values[c.name],
                        }
                        for c in panel.curves
                    ],
                }
                for panel in self.panels
            ],
        }


class HistoriesDrawing:
    """Draws coordinates as functions of time, with marks at the current time.

    Parameters
    ----------
    histories : Histories
    width, height : int
        Pixels.
    """

    def __init__(self, histories: Histories, width: int, height: int):
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        self.histories = histories
        unit = max(0.6, min(1.6, min(width, height) / 420))
        self.raster = Raster(width, height, unit, ROLES["paper"])
        self.strip = 26 * max(1.0, unit)
        size = (width / _DPI, height / _DPI)
        panels = histories.panels
        with new_figure(size, _DPI) as figure:
            canvas = FigureCanvasAgg(figure)
            figure.get_layout_engine().set(rect=(0, 0, 1, 1 - self.strip / height))
            drawing = PanelDrawing(figure, [histories.run], [histories.values], width)
            drawing.draw([panels], [1.0] * len(panels))
            canvas.draw()
            self.still = np.asarray(canvas.buffer_rgba()).copy()
            #: For each panel, the transformation to pixels, and its left, lower, right and upper
            #: end.
            self.axes = [(ax.transData.frozen(), ax.get_window_extent()) for ax in figure.axes]

    def frame(self, time: float, note: str = "") -> Image:
        """Return the picture at a time, with a line of text; see `SceneDrawing.frame`."""
        raster, histories = self.raster, self.histories
        raster.clear(self.still)
        for panel, (place, box) in zip(histories.panels, self.axes, strict=True):
            across = place.transform((time, 0.0))[0]
            raster.line([(across, box.y0), (across, box.y1)], ROLES["point"], 1.2, alpha=0.6)
            for curve in panel.curves[:_MARKED] if len(panel.curves) <= _MARKED else ():
                value = np.interp(time, histories.time, histories.values[curve.name])
                at = place.transform((time, value))
                if np.isfinite(at).all():
                    raster.dot(np.asarray(at), 3, ROLES["point"], ROLES["paper"])
        raster.text(note, (14, raster.height - self.strip / 2), ROLES["label"])
        return raster.image()
