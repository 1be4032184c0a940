"""Pictures of modes: the operating point, and both ends of the motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.analysis.linear.description import describe_modes
from lagcli.analysis.linear.mode_motion import StoredModes
from lagcli.analysis.linear.modes import modes
from lagcli.pictures.plots.figure import FigureFile
from lagcli.pictures.plots.mode_plot import plot_modes

pytest.importorskip("matplotlib")

DOUBLE = Path(__file__).parents[4] / "models" / "double_pendulum_cartesian.yaml"


def test_ends_are_on_the_constraints_and_opposite(tmp_path: Path) -> None:
    model = lagcli.load(DOUBLE)
    content = describe_modes(modes(model, equilibrium=True))
    stored = StoredModes(content, model, "a file")
    for mode in content["modes"]:
        run = stored.extremes(mode["number"])
        rest, end, other = run.q
        np.testing.assert_array_equal(rest, list(content["operating_point"]["q"].values()))
        shape = np.array([mode["position"][name][0] for name in model.coordinate_names])
        # along the shape, on both sides: horizontally, as the rods keep their lengths
        across = shape != 0
        np.testing.assert_allclose((end - rest)[across], (rest - other)[across], rtol=1e-9)
        assert ((end - rest)[across] * shape[across] > 0).all()
        assert np.abs(run.residual_position).max() < 1e-12
    path = tmp_path / "modes.svg"
    plot_modes(content, FigureFile(str(path), "svg"), "Double", model, "a file")
    assert path.read_text().count('id="drawn-') == 2
    # without a mechanism, there are the poles alone
    plot_modes(content, FigureFile(str(path), "svg", force=True), "Double", None, "a file")
    assert "<image" not in path.read_text()
