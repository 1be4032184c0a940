"""Random states that satisfy the constraints."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.constraints import random_states
from lagcli.engine.constraints.initial import coordinate_reach
from lagcli.engine.evaluator import Evaluator
from lagcli.simulations.simulation import prepare

SKATE = """
coordinates: [x, y, phi]
T: x'^2/2 + y'^2/2 + phi'^2/2
constraints: {blade: x'*sin(phi) = y'*cos(phi)}
initial: {x: 20, y: 3, phi: 0.4, x': 2, y': {guess: 1}, phi': 0.3}
"""


def test_random_states_are_steps_of_limited_length(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each at most half of the coordinates' reach from the last one, in all directions."""
    simulation = prepare(lagcli.load_text(SKATE))
    system, start = simulation.system, simulation.start
    states = random_states.random_states(system, start)
    assert len(states) == 20
    reach = coordinate_reach(Evaluator(system, start.state.p), start.state)
    path = np.array([start.state.q, *[s.state.q for s in states]])
    lengths = np.abs(np.diff(path, axis=0) / reach).max(axis=1)
    # 20 numbers that are uniform between 0 and a half
    assert 0.4 < lengths.max() <= 0.5 + 1e-12
    assert lengths.min() < 0.1
    assert 0.15 < lengths.mean() < 0.35
    for found in states:
        phi, v = found.state.q[2], found.state.v
        assert v[0] * np.sin(phi) == pytest.approx(v[1] * np.cos(phi))
    # velocities too: normally distributed steps of their own size, or of the reach
    speeds = np.array([0.3, *[found.state.v[2] for found in states]])
    steps = np.diff(speeds) / np.maximum(np.abs(speeds[:-1]), reach[2])
    assert 0.5 < np.std(steps) < 1.6
    monkeypatch.setattr(random_states, "MOST_COORDINATES", 3)
    assert len(random_states.random_states(system, start)) == 20
    monkeypatch.setattr(random_states, "MOST_COORDINATES", 2)
    assert random_states.random_states(system, start) == []
