"""Periods of clocks are checked before a run."""

from __future__ import annotations

import pytest

from lagcli.errors import ModelError
from lagcli.model.loader import load_text
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare
from lagcli.simulations.switching.clock_periods import check_clocks

TEXT = """\
coordinates: [x]
parameters: {T: 0.01}
T: x'^2/2
initial: {x: 0, x': 1}
events: {tick: {every: T - 0.02, stop: true}}
"""


def test_a_period_that_is_not_positive() -> None:
    with pytest.raises(ModelError, match=r"<text>:5:24: .* is -0.01 s, but must be positive"):
        prepare(load_text(TEXT))
    simulation = prepare(load_text(TEXT, set={"T": 1.0}))
    check_clocks(simulation.model, simulation.system, simulation.settings)


def test_a_period_below_rounding_errors() -> None:
    text = TEXT.replace("T - 0.02", "T/1e6")
    with pytest.raises(ModelError, match="below the rounding errors of times near 1e\\+09 s"):
        prepare(load_text(text), SettingsOverrides(t_start=1e9, t_end=1e9 + 1))
