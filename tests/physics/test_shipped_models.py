"""Every shipped model over its own simulation block: what a result promises."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.trajectory.trajectory import Trajectory

MODELS = Path(__file__).parents[2] / "models"
NAMES = sorted(path.stem for path in MODELS.glob("*.yaml"))


@cache
def run(name: str) -> Trajectory:
    return lagcli.simulate(lagcli.load(MODELS / f"{name}.yaml"))


def test_models_are_shipped() -> None:
    assert len(NAMES) >= 17


@pytest.mark.parametrize("name", NAMES)
def test_file_says_what_it_is(name: str) -> None:
    text = (MODELS / f"{name}.yaml").read_text(encoding="utf-8")
    model = lagcli.load(MODELS / f"{name}.yaml")
    head = text.split("\nname:")[0]
    assert all(line.startswith("#") for line in head.splitlines())
    for part in ("# Shows:", "# lambda.", "# Try:"):
        assert part in head
    assert model.name == name
    assert model.description
    assert model.settings.rtol == 1e-9
    assert model.settings.t_end
    assert model.settings.samples


@pytest.mark.parametrize("name", NAMES)
def test_completes(name: str) -> None:
    trajectory, settings = run(name), lagcli.load(MODELS / f"{name}.yaml").settings
    assert trajectory.status == "completed", trajectory.message
    assert len(trajectory.time) == settings.samples
    assert trajectory.time[-1] == settings.t_end
    assert np.ptp(trajectory.q, axis=0).max() > 0.1  # something moves
    for key in ("q", "v", "a", "multipliers", "energy_total", "residual_equation"):
        assert np.isfinite(getattr(trajectory, key)).all(), key
    for key, values in trajectory.outputs.items():
        assert values.shape == trajectory.time.shape, key
        assert np.isfinite(values).all(), key


@pytest.mark.parametrize("name", NAMES)
def test_constraints_hold_at_every_sample(name: str) -> None:
    trajectory = run(name)
    holonomic = ~np.isnan(trajectory.residual_position).any(axis=0)
    # the promise of docs and results: 1e-12 of the sum of the constraint's terms
    position = np.abs(trajectory.residual_position[:, holonomic])
    assert (position <= 1e-12 * trajectory.scale_position[holonomic]).all()
    assert (np.abs(trajectory.residual_velocity) <= 1e-12 * trajectory.scale_velocity).all()


@pytest.mark.parametrize("name", NAMES)
def test_energy_balance_closes(name: str) -> None:
    trajectory = run(name)
    # energy of a potential is known up to a constant: judge by what is exchanged if that is larger
    size = max(np.abs(trajectory.energy_total).max(), np.ptp(trajectory.energy_kinetic))
    assert np.abs(trajectory.energy_balance).max() <= 1e-8 * size


@pytest.mark.parametrize("name", NAMES)
def test_equations_hold_for_the_written_numbers(name: str) -> None:
    trajectory = run(name)
    # M a - f - Bᵀλ with a and λ as written: rounding, amplified by the forces that cancel in f
    if trajectory.constraints:
        forces = trajectory.terms.total(np.abs(trajectory.constraint_force_by)).max()
    else:  # coordinates of unit size: forces are of the size of what energy is exchanged
        forces = np.ptp(trajectory.energy_kinetic)
    assert trajectory.residual_equation.max() <= 1e-10 * forces


def test_parallelogram_stops_at_the_flat_configuration_or_passes_it() -> None:
    """What the comment in the file tells to try."""
    model = lagcli.load(MODELS / "parallelogram.yaml", set_initial={"alpha_1'": 6})
    stopped = lagcli.simulate(model)
    assert stopped.status == "failed"
    assert "singular" in stopped.message
    assert stopped.q[:, 0].max() < 0  # every sample is one of the way to it
    passed = lagcli.simulate(model, through_singular=True)
    assert passed.status == "completed", passed.message
    assert passed.q[:, 0].max() > 0.1
    np.testing.assert_allclose(passed.q[:, 3], 0, atol=1e-9)  # it did not tip over
