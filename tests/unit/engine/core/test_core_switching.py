"""The binding of runs whose rows switch: what it reports of an instant."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import lagcli
from lagcli.engine.core.switching import SwitchingIntegrator

MODELS = Path(__file__).parents[4] / "models" / "contact"


def test_the_ball_bounces_and_reports_its_contact(cores: list[SwitchingIntegrator]) -> None:
    run = lagcli.simulate(lagcli.load(MODELS / "bouncing_ball.yaml"))
    [core] = cores
    assert run.status == "completed"
    assert len(run.events) > 3
    assert core.modes == [1]  # it rests
    assert core.contacts.shape == (3, 1)
    rows, problem, motions = core.problem
    assert rows == [0]
    assert problem.matrix.shape == (1, 1)
    assert len(motions) == 1
    # what carries the ball is its weight, and it does not accelerate
    np.testing.assert_allclose(motions[0].motion, 0.0, atol=1e-12)
    assert problem.violation(motions[0].force, motions[0].motion) < 1e-12
    assert core.no_gap(0) > 0.0
    assert core.begun
    assert core.course == ([0], 0, 0)
    assert core.gain[0] == 0.0
    assert core.losses == []
    assert len(core.take_log()) == 0  # the run has taken all


def test_a_run_without_rows_has_empty_reports(cores: list[SwitchingIntegrator]) -> None:
    """Clocks alone: a sampled controller."""
    lagcli.simulate(lagcli.load(MODELS / "sampled_pendulum.yaml"))
    core = cores[0]
    assert core.modes == core.struck == core.surfaces == core.happened() == []
    assert core.branches == []
    assert core.contacts.shape == (3, 0)
    assert core.next_tick > core.t - 1e-9
