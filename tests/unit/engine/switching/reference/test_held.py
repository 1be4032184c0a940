"""A System of which only some rows are there."""

import numpy as np

from lagcli.engine.switching.reference.held import HeldEvaluator
from tests.support.switching_models import prepared


def test_rows_that_do_not_hold_are_left_out() -> None:
    system, request, full = prepared()
    t, q, v = request.state.t, request.state.q, request.state.v
    friction = HeldEvaluator(full, [1])
    assert friction.system.constraints == ("floor.slip",)
    assert friction.system.holonomic == ()
    np.testing.assert_array_equal(friction.dynamics(t, q, v).jacobian, [[1, 0]])
    assert friction.constraints(t, q, v).position.shape == (0,)
    floor = HeldEvaluator(full, [0])
    assert floor.system.holonomic == (0,)
    np.testing.assert_array_equal(floor.constraints(t, q, v).jacobian, [[0, 1]])
    assert len(system.constraints) == 2
