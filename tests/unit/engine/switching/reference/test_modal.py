"""The right-hand side in a mode."""

import numpy as np
import pytest

from lagcli.engine.switching.reference.modal import ModalMotion
from lagcli.engine.switching.reference.tapes import SwitchingTapes
from lagcli.engine.switching.switching import RowMode
from tests.support.switching_models import prepared

OPEN, HOLDS, FORWARD, BACKWARD = RowMode


@pytest.mark.parametrize(
    ("modes", "rows", "a", "multipliers", "power"),
    [
        ((OPEN, OPEN), [], [0, -10], [0, 0], 0.0),
        ((HOLDS, HOLDS), [0, 1], [0, 0], [20, 0], 0.0),
        ((HOLDS, FORWARD), [0], [-5, 0], [20, -10], -10.0),
        ((HOLDS, BACKWARD), [0], [5, 0], [20, 10], 10.0),
    ],
)
def test_a_block_on_the_floor(
    modes: tuple[RowMode, ...],
    rows: list[int],
    a: list[float],
    multipliers: list[float],
    power: float,
) -> None:
    """2 kg, mu = 0.5, v = 1 m/s: friction of 10 N."""
    system, request, full = prepared()
    state = request.state
    motion = ModalMotion(full, SwitchingTapes(system), rows, np.array(modes), len(rows))
    motion.measure(state.t, state.q, state.v)
    found = motion.accelerations(state.t, state.q, state.v)
    np.testing.assert_allclose(found[0], a, atol=1e-14)
    np.testing.assert_allclose(found[1], multipliers, atol=1e-14)
    assert found[2] == pytest.approx(power)
    assert motion.margin == 1.0  # the friction does not change the force that bears it


def test_cones_of_rows_that_hold() -> None:
    """λ_N ≥ 0, and 2 mu λ_N ± λ_T ≥ 0."""
    system, request, full = prepared()
    state = request.state
    motion = ModalMotion(full, SwitchingTapes(system), [0, 1], np.array([HOLDS, HOLDS]), 2)
    motion.measure(state.t, state.q, state.v)
    a, multipliers, _ = motion.accelerations(state.t, state.q, state.v)
    rows, bounds = motion.cone_rows(state.t, state.q, state.v, a, multipliers)
    np.testing.assert_allclose(rows, [[1, 0], [1, 1], [1, -1]])
    np.testing.assert_allclose(bounds, [-20, -20, -20])
    assert motion.cone_owners() == [0, 1, 1]
    np.testing.assert_allclose(motion.force_terms(state.t, state.q, state.v), [0, 20])


def test_a_state_without_accelerations() -> None:
    system, request, full = prepared()
    motion = ModalMotion(full, SwitchingTapes(system), [0], np.array([HOLDS, FORWARD]), 1)
    a, multipliers, _ = motion.accelerations(0.0, np.array([np.inf, 0]), request.state.v * np.nan)
    assert np.isnan(a).all()
    assert np.isnan(multipliers).all()
