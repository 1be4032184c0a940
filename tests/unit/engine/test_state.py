"""States: what a run begins from."""

from __future__ import annotations

import numpy as np

from lagcli.engine.state import State


def test_a_run_begins_without_work_done() -> None:
    state = State(0.5, np.array([1.0, 2.0]), np.array([3.0, 4.0]), (9.81,))
    np.testing.assert_array_equal(state.y, [1.0, 2.0, 3.0, 4.0, 0.0])
    state.y[0] = 7.0
    assert state.q[0] == 1.0
