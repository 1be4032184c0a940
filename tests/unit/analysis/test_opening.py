"""`lagcli.open` returns what a file holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.cli.app import run
from lagcli.model.model import Model
from lagcli.results.formats import SUFFIXES
from lagcli.trajectory.trajectory import Trajectory


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("opened")
    trajectory = lagcli.simulate(lagcli.load("slider_crank"), t_end=0.1, samples=11)
    for suffix in SUFFIXES:
        lagcli.write(trajectory, found / f"run{suffix}")
    sweep = ["--vary", "m=1,2", "--measure", "peak=max(lambda.guide)", "--t-end", "0.1", "-q"]
    assert run(["sweep", "slider_crank", *sweep, "-o", str(found / "sweep.h5")]) == 0
    modes = ["modes", "pendulum_cartesian", "--equilibrium", "-o", str(found / "modes.h5")]
    assert run([*modes, "-q"]) == 0
    return found


def test_models() -> None:
    for name in ("slider_crank", Path(__file__).parents[3] / "models" / "slider_crank.yaml"):
        model = lagcli.open(name)
        assert isinstance(model, Model)
        assert model.name == "slider_crank"


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_results_of_every_format(suffix: str, folder: Path) -> None:
    found = lagcli.open(folder / f"run{suffix}")
    assert isinstance(found, Trajectory)
    assert np.array_equal(found.q, lagcli.read(folder / f"run{suffix}").q)


def test_a_sweep_is_a_dataset(folder: Path) -> None:
    found = lagcli.open(folder / "sweep.h5")
    assert found["peak"].shape == (2,)
    # without friction, lambda is proportional to the mass
    assert float(found["peak"][1]) == pytest.approx(2 * float(found["peak"][0]), rel=1e-6)


def test_an_analysis_is_its_content(folder: Path) -> None:
    assert lagcli.open(folder / "modes.h5")["command"] == "modes"


def test_what_cannot_be_opened(tmp_path: Path) -> None:
    with pytest.raises(lagcli.errors.FileError, match="none"):
        lagcli.open(tmp_path / "none.h5")
    with pytest.raises(lagcli.errors.LagcliError, match="slider_krank"):
        lagcli.open("slider_krank")
