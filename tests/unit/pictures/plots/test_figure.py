"""Ticks of plots: whole decades, whatever positive numbers there are."""

from __future__ import annotations

import numpy as np
import pytest

from lagcli.pictures.plots.figure import decades

pytest.importorskip("matplotlib", reason="lagcli[pictures] is not installed")


@pytest.mark.parametrize(
    ("values", "limits"),
    [
        ([2e-12, 3e-9, 0.0, np.nan], (1e-12, 1e-8)),
        ([1e-9], (1e-9, 1e-8)),
        ([], (1e-16, 1e-15)),
        ([5e-324], (1e-305, 1e-304)),
        ([5e-324, 1.7e308], (1e-305, 1e305)),
        ([1.7e308], (1e304, 1e305)),
    ],
)
def test_an_axis_spans_whole_decades(values: list[float], limits: tuple[float, float]) -> None:
    from matplotlib.figure import Figure

    figure = Figure()
    ax = figure.subplots()
    decades(ax, [np.array(values)])
    np.testing.assert_allclose(ax.get_ylim(), limits)
    figure.canvas.draw()  # which asks for the text of every tick
