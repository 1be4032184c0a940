"""The tapes of what switches, as arrays."""

import numpy as np

from lagcli.engine.switching.reference.tapes import SwitchingTapes
from tests.support.switching_models import prepared


def test_limits_follow_the_force_that_bears() -> None:
    system, request, full = prepared()
    state = request.state
    tapes = SwitchingTapes(system)
    for force in (20.0, 40.0):
        inputs = (state.t, *state.q, *state.v, 0.0, 0.0, force, 0.0, *full.p)
        limits = tapes.limits(inputs)
        assert limits.static == [2 * 0.5 * force]
        assert limits.kinetic == [0.5 * force]
        np.testing.assert_array_equal(limits.static_slopes, [[1.0, 0.0]])
        np.testing.assert_array_equal(limits.kinetic_slopes, [[0.5, 0.0]])
    restitution, friction = tapes.impact((state.t, *state.q, *state.v, *full.p))
    assert (restitution, friction) == ([0.5], [0.5])
    assert tapes.forces(inputs).values.shape == (0,)
    values = tapes.conditions((0.35, *state.q, *state.v, *full.p), None)
    np.testing.assert_allclose(values, [0.25])
    assert tapes.actions(inputs) == [2.0]
