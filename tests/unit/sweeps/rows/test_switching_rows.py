"""Rows of models that switch: each equal to its single run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rows_alone import check_equal_alone

import lagcli

ROOT = Path(__file__).parents[4]
CONTACT = ROOT / "models" / "contact"


def test_a_ball_bounces_as_it_does_alone():
    """Impacts after √(2 h/g) and then after 2 e^k √(2 h/g), to the end of the run."""
    random = np.random.default_rng(3)
    table = random.uniform([0.5, 0.4, 1.0], [0.9, 2.0, 3.0], (8, 3))
    model = lagcli.load(CONTACT / "bouncing_ball.yaml")
    ends, runs = check_equal_alone(model, ["e", "h", "m"], table, t_end=1.5, rtol=1e-10)
    assert ends == ["completed"] * 8
    for (e, h, _), run in zip(table, runs, strict=True):
        fall = np.sqrt(2 * h / 9.81)
        times = fall * (1 + 2 * np.cumsum(e ** np.arange(1, 4)))
        expected = [x for x in (fall, *times) if x < 1.4]
        np.testing.assert_allclose(run.events.part("time")[: len(expected)], expected, rtol=1e-9)


def test_what_cannot_start_is_refused_as_it_is_alone():
    """Below the floor, on it, without mass, and with coefficients out of their range."""
    table = [
        [0.8, 1.0, 2.0],
        [0.8, -0.1, 2.0],
        [0.8, 0.0, 2.0],
        [0.8, 1.0, 0.0],
        [1.2, 1.0, 2.0],
        [-0.1, 1.0, 2.0],
        [0.8, 1.0, -2.0],
        [0.8, 1.0, 1e-300],
        [0.0, 1.0, 2.0],
    ]
    model = lagcli.load(CONTACT / "bouncing_ball.yaml")
    ends, _ = check_equal_alone(model, ["e", "h", "m"], table, t_end=1.0)
    refused = [False, True, False, True, True, True]
    assert [end == "no start" for end in ends[:6]] == refused


@pytest.mark.parametrize(
    ("path", "columns"),
    [
        ("models/contact/stick_slip_belt.yaml", ["m", "k"]),
        ("models/contact/slider_crank_friction.yaml", ["m", "mu"]),
        ("models/contact/sliding_ladder.yaml", ["m", "l"]),
        ("models/contact/newtons_cradle.yaml", ["m", "s"]),
        ("models/contact/sampled_pendulum.yaml", ["m", "k_d"]),
        ("tests/found/two_way_set.yaml", ["m", "l"]),
        ("tests/found/press.yaml", ["m5"]),
    ],
)
def test_rows_that_switch_are_single_runs(path, columns):
    model = lagcli.load(ROOT / path)
    own = np.array([model.parameters[name].value for name in columns])
    table = own * np.array([[1.0], [0.93], [1.08]])
    end = min(1.0, model.settings.t_end)
    ends, _ = check_equal_alone(model, columns, table, t_end=end)
    assert "no start" not in ends


def test_clocks_with_other_periods_are_those_of_single_runs():
    model = lagcli.load(CONTACT / "sampled_pendulum.yaml")
    ends, _ = check_equal_alone(model, ["T_s"], [[0.02], [0.03], [0.03], [0.02]], t_end=0.2)
    assert ends == ["completed"] * 4
