"""What of a System switches."""

from __future__ import annotations

import math

import pytest

from lagcli.engine.switching.switching import Clock, RowMode, clocks_of
from lagcli.model.loader import load_text
from lagcli.simulations.simulation import prepare


def test_rows_slip_either_way() -> None:
    assert [mode for mode in RowMode if mode.slips] == [RowMode.FORWARD, RowMode.BACKWARD]


@pytest.mark.parametrize(
    ("period", "offset", "said"),
    [
        (0.0, 0.0, "is 0 s, but must be positive"),
        (-0.5, 0.0, "is -0.5 s, but must be positive"),
        (math.nan, 0.0, "is nan s, but must be positive"),
        (math.inf, 0.0, "is inf s, but must be positive"),
        (1.0, math.nan, "the offset of event `tick` is nan"),
        (1e-15, 0.0, "below the rounding errors of times near 2 s"),
        (1e-6, 1e12, "below the rounding errors of times near 1e+12 s"),
    ],
)
def test_faults(period: float, offset: float, said: str) -> None:
    assert said in Clock("tick", period, offset, 0).fault((-1.0, 2.0))
    assert not Clock("tick", 1e-13, 0.0, 0).fault((-1.0, 2.0))


def test_clocks_of_a_model_follow_its_parameters() -> None:
    text = """
coordinates: [x]
parameters: {m: 1, T: 0.5, n: 3}
T: m/2*x'^2
initial: {x: 0, x': 1}
events:
  now: {when: x >= 1}
  tick[i=1..2]: {every: i*T, offset: i/n, times: 4}
"""
    system = prepare(load_text(text)).system
    assert system.switching is not None
    assert clocks_of(system.switching, (1.0, 0.25, 2.0)) == [
        Clock("tick[1]", 0.25, 0.5, 4),
        Clock("tick[2]", 0.5, 1.0, 4),
    ]
