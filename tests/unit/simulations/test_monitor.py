"""Conserved quantities along a run: values, names, and where there are none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.settings.resolve import compiled_available
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.monitor import NO_MONITOR, monitor_of
from lagcli.simulations.simulation import prepare

MODELS = Path(__file__).parents[3] / "models"


def test_the_columns_are_the_quantities() -> None:
    model = lagcli.load(MODELS / "charged_pendulum.yaml")
    run = lagcli.simulate(model, t_end=2.0, samples=21, rtol=1e-11)
    assert run.conserved_names == ("J_1",)
    assert run.conserved_formulas == {"J_1": "x*p_y - y*p_x"}
    # the model's own output, as its author wrote it
    np.testing.assert_allclose(
        run.conserved[:, 0], run.outputs["angular_momentum"], rtol=1e-13, atol=1e-15
    )
    assert np.ptp(run.conserved[:, 0]) < 1e-10


def test_a_drifting_formulation_shows_in_them() -> None:
    model = lagcli.load(MODELS / "heavy_top.yaml")
    tight, loose = (
        lagcli.simulate(model, t_end=0.2, samples=5, rtol=rtol).conserved for rtol in (1e-11, 1e-5)
    )
    assert np.abs(tight - tight[0]).max() < 1e-3 * np.abs(loose - loose[0]).max()


@pytest.mark.parametrize("engine", ["compiled", "scipy"] if compiled_available() else ["scipy"])
def test_engines_agree(engine: str) -> None:
    model = lagcli.load(MODELS / "knife_edge_incline.yaml")
    run = lagcli.simulate(model, t_end=0.5, samples=4, engine=engine)
    np.testing.assert_allclose(run.conserved, 0.2, rtol=1e-9)
    assert run.conserved_names == ("p_phi",)


def test_without_quantities_there_is_nothing_to_evaluate() -> None:
    model = lagcli.load(MODELS / "atwood.yaml")
    assert monitor_of(lagcli.derive(model)) is NO_MONITOR
    simulation = prepare(model, SettingsOverrides(t_end=0.1, samples=3))
    assert simulation.monitor is NO_MONITOR
    assert lagcli.simulate(model, t_end=0.1, samples=3).conserved.shape == (3, 0)


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_files_keep_them(tmp_path: Path, suffix: str) -> None:
    model = lagcli.load(MODELS / "bead_on_rotating_hoop.yaml")
    run = lagcli.simulate(model, t_end=0.5, samples=6)
    path = str(tmp_path / f"run{suffix}")
    lagcli.write(run, path, meta=suffix == ".csv")
    found = lagcli.read(path)
    assert found.conserved_names == ("jacobi",)
    assert found.conserved_formulas == {"jacobi": "h - 4*p_phi"}
    np.testing.assert_array_equal(found.conserved, run.conserved)
