"""The compiled engine takes what runs a System: with switching, or without."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.engine.contract import Block
from lagcli.engine.integrate import compiled_engine
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations import simulation

FALL = """
coordinates: [y]
T: y'^2/2
V: 2*y
initial: {y: 1, y': 0}
"""


@pytest.mark.parametrize(("floor", "end"), [("", -3.0), ("constraints: {floor: y >= 0}", 0.0)])
def test_what_runs_a_system(floor: str, end: float) -> None:
    prepared = simulation.prepare(lagcli.load_text(FALL + floor), SettingsOverrides(t_end=2))
    blocks: list[Block] = []
    outcome = compiled_engine.run(prepared.system, prepared.request, blocks.append)
    assert outcome.status == "completed"
    assert blocks[-1].q[-1] == pytest.approx([end], abs=1e-9)
    assert bool(outcome.events) == bool(floor)
