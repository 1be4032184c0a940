"""Phases of a run: what ends a mode."""

import numpy as np

from lagcli.engine.integrate.phases import Phases, Watched
from lagcli.engine.switching.switching import RowMode
from tests.support.switching_models import prepared


def test_what_is_watched_in_each_mode() -> None:
    _, request, full = prepared()
    state = request.state
    phases = Phases(full, request)
    expected = {
        (RowMode.OPEN, RowMode.OPEN): [Watched("gap", 0)],
        (RowMode.HOLDS, RowMode.HOLDS): [Watched("force", 0), Watched("stick", 1)],
        (RowMode.HOLDS, RowMode.FORWARD): [
            *(Watched("force", 0), Watched("slip", 1), Watched("jam", 1))
        ],
    }
    values = {}
    for modes, watched in expected.items():
        phases.enter(np.array(modes), state.t, state.q, state.v)
        assert phases.watched == watched
        values[modes] = phases.values(state.t, state.y)[: len(watched)].tolist()
    assert values[RowMode.OPEN, RowMode.OPEN] == [0.0]
    assert values[RowMode.HOLDS, RowMode.HOLDS] == [20.0, 20.0]
    assert values[RowMode.HOLDS, RowMode.FORWARD] == [20.0, 1.0, 1.0]


def test_parameters_that_change() -> None:
    _, request, full = prepared()
    phases = Phases(full, request)
    before = phases.energy(0.0, request.state.q, request.state.v)
    phases.set_parameters((4.0, *full.p[1:]))
    assert phases.energy(0.0, request.state.q, request.state.v) == 2 * before
    assert phases.motion.full.p[0] == 4.0
