"""Actions of events, with a core that only notes them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.engine.contract import Stop
from lagcli.engine.integrate.switching_actions import Actions
from lagcli.simulations import simulation


class NotingCore:
    """Stands for the core at an instant."""

    def __init__(self, state: list[float], happened: list[int]):
        self.t, self.state, self._happened = 0.5, np.array(state), happened
        self.modes = [0]
        self.active: dict[int, bool] = {}
        self.motion = np.zeros(3), np.array([1.0]), np.array([0.0])
        self.p: list[float] = []

    def happened(self) -> list[int]:
        return self._happened

    def ticked(self) -> list[int]:
        return []

    def place(self, y: Any) -> None:
        self.state = np.array(y)

    def no_gap(self, row: int) -> float:
        return 1e-9

    def activate(self, row: int, active: bool) -> None:
        self.active[row] = active

    def set_parameters(self, p: list[float]) -> None:
        self.p = list(p)


MODEL = """
coordinates: [x]
parameters: {m: 2, k: 3}
T: m/2*x'^2
V: k/2*x^2
constraints:
  pin: {expr: x = 1, active: false}
events:
  kick: {when: x >= 0.2, set: {x': 2*x', k: k + x}, times: 1}
  fix: {when: x >= 0.9, engage: pin}
  free: {when: x >= 0.95, release: pin, stop: true}
initial: {x: 0, x': 1}
"""


def actions(state: list[float], happened: list[int]) -> tuple[Actions, NotingCore]:
    prepared = simulation.prepare(lagcli.load_text(MODEL))
    core = NotingCore(state, happened)
    return Actions(prepared.system, prepared.request, core), core


def test_values_are_those_of_before() -> None:
    doing, core = actions([0.2, 3.0, 0.0], [0])
    (entry,) = doing.react([])
    assert core.p == [2, 3.2]
    # T + V with the new k
    work = 36 + 3.2 * 0.02 - (9 + 3 * 0.02)
    np.testing.assert_allclose(core.state, [0.2, 6.0, work])
    assert (entry.occurrence, entry.which, entry.time) == ("event", 0, 0.5)
    assert entry.work == pytest.approx(work)
    assert not doing.react([])  # once is all


def test_rows_are_engaged_where_they_are_met() -> None:
    doing, core = actions([1.0, 0.0, 0.0], [1])
    assert [e.occurrence for e in doing.react([])] == ["event", "engages"]
    assert core.active == {0: True}
    doing, _ = actions([1 + 1e-8, 0.0, 0.0], [1])
    with pytest.raises(Stop, match="`pin` cannot be engaged"):
        doing.react([])
    doing, _ = actions([0.7, 0.0, 0.0], [1])
    with pytest.raises(Stop, match=r"`pin` cannot be engaged at t = 0\.5 s, phi = -0\.3"):
        doing.react([])


def test_rows_are_released_and_the_run_stops() -> None:
    doing, core = actions([1.0, 0.0, 0.0], [2])
    assert [e.occurrence for e in doing.react([])] == ["event", "releases"]
    assert core.active == {0: False}
    assert doing.stopped == "`free` stopped the run at t = 0.5 s"
