"""The inverse inertia at rows."""

import numpy as np
import pytest

from lagcli.engine.switching.reference.coupling import Coupling
from tests.support.switching_models import prepared


def test_rows_of_a_free_body() -> None:
    _, request, full = prepared()
    state = request.state
    d = full.dynamics(state.t, state.q, state.v)
    coupling = Coupling(d, [], [0, 1], np.ones(2), np.ones(2))
    np.testing.assert_allclose(coupling.matrix, np.eye(2) / 2)
    a, _, y = coupling.loaded(d.forcing)
    np.testing.assert_allclose(a, [0, -10])
    np.testing.assert_allclose(y, [-10, 0])


def test_bilateral_rows_are_eliminated() -> None:
    _, request, full = prepared()
    state = request.state
    d = full.dynamics(state.t, state.q, state.v)
    coupling = Coupling(d, [0], [0, 1], np.ones(2), np.ones(2))
    # the floor is fixed, as a bilateral row, and answers what presses on it
    np.testing.assert_allclose(coupling.matrix, [[0, 0], [0, 0.5]], atol=1e-16)
    np.testing.assert_allclose(coupling.along_bilateral, [[-1, 0]], atol=1e-15)
    _, force, _ = coupling.loaded(d.forcing)
    assert force == pytest.approx([20.0])


def test_redundant_bilateral_rows() -> None:
    _, request, full = prepared()
    state = request.state
    d = full.dynamics(state.t, state.q, state.v)
    twice = d._replace(jacobian=np.vstack([d.jacobian, d.jacobian[:1]]), rhs=np.zeros(3))
    coupling = Coupling(twice, [0, 2], [1], np.ones(2), np.ones(3))
    _, force, _ = coupling.loaded(d.forcing)
    np.testing.assert_allclose(force, [10, 10])
