"""Trajectories of modes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.analysis.linear.mode_motion import mode_motion
from lagcli.errors import UsageError

MODELS = Path(__file__).parents[4] / "models"


def test_motion_of_a_mode_is_on_the_constraints_and_has_its_multipliers() -> None:
    model = lagcli.load(MODELS / "slider_crank.yaml", set_initial={"phi": "-1.5", "phi'": "0"})
    run = mode_motion(model, 1, amplitude=1e-4, equilibrium=True)
    (mode,) = lagcli.modes(model, equilibrium=True).modes
    assert run.time[-1] == pytest.approx(3 * mode.period)
    assert np.abs(run.residual_position).max() < 1e-14
    # the equations hold to second order
    assert run.residual_equation.max() < 1e-5
    assert np.ptp(run.q[:, 0]) == pytest.approx(2e-4, rel=1e-3)
    assert np.ptp(run.multipliers[:, 0]) == pytest.approx(2e-4 * abs(mode.multipliers[0]), rel=1e-3)


def test_default_amplitude_can_be_seen_and_rods_keep_their_lengths() -> None:
    run = mode_motion(lagcli.load(MODELS / "chain.yaml", set={"N": "3"}), 2, equilibrium=True)
    assert 0.02 < np.ptp(run.q[:, :3], axis=0).max() < 1.0
    steps = np.diff(run.q.reshape(-1, 2, 3), axis=2)
    assert np.hypot(steps[:, 0], steps[:, 1]) == pytest.approx(1 / 3, rel=1e-9)
    assert "mode 2 (oscillation)" in run.message


def test_growing_and_decaying_motions_take_three_time_constants() -> None:
    model = lagcli.load(MODELS / "slider_crank.yaml")
    growing, decaying = (mode_motion(model, n, amplitude=1e-4, equilibrium=True) for n in (1, 2))
    size = np.abs(growing.q - growing.q[0]).max(axis=1)
    assert size[-1] == size.max()
    reached = np.abs(decaying.q[:, 0] - np.pi / 2)
    assert reached[-1] == pytest.approx(reached[0] * np.exp(-3), rel=1e-3)


def test_wrong_numbers_are_rejected() -> None:
    model = lagcli.load(MODELS / "slider_crank.yaml")
    for arguments in ({"number": 3}, {"number": 0}, {"number": 1, "amplitude": -1.0}):
        with pytest.raises(UsageError):
            mode_motion(model, equilibrium=True, **arguments)  # type: ignore[arg-type]
