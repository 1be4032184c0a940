"""A ball that bounces to rest: its log, files and measures against closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from trajectories import assert_same_logs

import lagcli
from lagcli.settings.settings import SettingsOverrides
from lagcli.sweeps.plan.plan import Spec, make_plan
from lagcli.sweeps.rows.rows import run_rows
from lagcli.trajectory.trajectory import Trajectory

MODEL = """\
name: ball
coordinates: {y: m}
parameters: {m: 2 kg, g: 9.81 m/s^2, e: 0.5}
T: m/2*y'^2
V: m*g*y
constraints:
  floor: {expr: y >= 0, restitution: e}
initial: {y: 1, y': 0}
"""
FALL = math.sqrt(2 / 9.81)
SPEED = 9.81 * FALL


@pytest.fixture(scope="module")
def ball() -> Trajectory:
    return lagcli.simulate(lagcli.load_text(MODEL), t_end=2.0, samples=41)


def test_log(ball: Trajectory) -> None:
    """Impact k at FALL (1 + 2 Σ eʲ); rest at FALL (1 + e)/(1 − e); m v² (1 − e²)/2 is lost."""
    log = ball.events
    assert log is not None
    impacts = log.instants("floor", "impact")
    assert impacts[0] == pytest.approx(FALL, rel=1e-9)
    flights = 2 * FALL * np.cumsum(0.5 ** np.arange(1, 6))
    assert impacts[1:6] == pytest.approx(FALL + flights, rel=1e-9)
    first = log.kinds.index("impact")
    assert log.impulse[first, 0] == pytest.approx(2 * 1.5 * SPEED, rel=1e-9)
    assert log.loss[first] == pytest.approx(SPEED**2 * (1 - 0.25), rel=1e-9)
    (rest,) = log.rests()
    assert rest.time == pytest.approx(3 * FALL, rel=1e-8)
    assert log.loss.sum() == pytest.approx(2 * 9.81, rel=1e-9)
    assert np.abs(ball.energy_balance).max() < 1e-9 * 2 * 9.81


def test_modes_and_forces_go_together(ball: Trajectory) -> None:
    assert ball.modes is not None
    holds = ball.modes[:, 0] == 1
    assert (holds == (ball.time > 3 * FALL)).all()
    assert ball.multipliers[holds, 0] == pytest.approx(2 * 9.81, rel=1e-12)
    assert (ball.multipliers[~holds, 0] == 0.0).all()


@pytest.mark.parametrize("name", ["ball.h5", "ball.csv"])
def test_files(ball: Trajectory, tmp_path: Path, name: str) -> None:
    lagcli.write(ball, tmp_path / name, meta=True)
    assert_same_logs(ball.events, lagcli.read(tmp_path / name).events)


def test_measures_of_a_sweep() -> None:
    """Times, counts and impulses of rows with two coefficients of restitution."""
    measures = ("time_of(floor impacts)", "count(floor impacts)", "impulse.floor")
    plan = make_plan(lagcli.load_text(MODEL), ["e=0.2,0.4"], None)
    settings = SettingsOverrides(t_end=2.0, samples=3)
    named = tuple((x, x) for x in measures)
    spec = Spec(MODEL, "model.yaml", {}, {}, settings, plan, named, "measures")
    found = run_rows(spec, np.arange(2)).measures
    assert found[:, 0] == pytest.approx([FALL, FALL], rel=1e-9)
    assert found[0, 1] < found[1, 1]
    # all impulses: m v (1 + e) Σ eᵏ of the impacts that are counted, before it comes to rest
    for (_, count, impulse), e in zip(found, (0.2, 0.4), strict=True):
        assert impulse == pytest.approx(2 * SPEED * (1 + e) * (1 - e**count) / (1 - e), rel=1e-9)


def test_a_ball_that_comes_to_rest_still_slides() -> None:
    """All impulses of the floor are m g t at rest, so that friction has taken μ g t of x'."""
    text = MODEL.replace("{y: m}", "{x: m, y: m}").replace("y'^2", "(x'^2 + y'^2)")
    text = text.replace("restitution: e}", "restitution: e, friction: 0.1, slip: x'}")
    model = lagcli.load_text(text.replace("initial: {", "initial: {x: 0, x': 5, "))
    run = lagcli.simulate(model, t_end=2.0, samples=41)
    assert run.events is not None
    (rest,) = run.events.rests()
    later = run.time > rest.time
    assert later.sum() > 10
    # within what friction changes during the impacts that are left out
    np.testing.assert_allclose(run.v[later, 0], 5 - 0.981 * run.time[later], rtol=0, atol=1e-4)
    assert (run.v[later, 0] > 3).all()
