"""Random mechanisms in space move like the same ones in a space that is turned."""

from __future__ import annotations

import numpy as np
import pytest
from mechanisms import Mechanism, matrix, product, random_mechanism, unit

import lagcli
from lagcli.trajectory.trajectory import Trajectory

T_END, SAMPLES = 0.5, 6
#: In the normal suite: chains and loops, along the frame's axes and not.
FEW = range(4)
MANY = range(4, 200)


def run(mechanism: Mechanism, **options: object) -> Trajectory:
    model = lagcli.load_text(mechanism.text(T_END, SAMPLES))
    return lagcli.simulate(model, rtol=1e-10, atol=1e-12, **options)


def turn_back(columns: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Return coordinates, velocities or forces of the turned mechanism, turned back."""
    back = columns.copy()
    inverse = e * [1, -1, -1, -1]
    for first in range(0, columns.shape[1], 7):
        back[:, first : first + 3] = columns[:, first : first + 3] @ matrix(e)
        for row in back:
            row[first + 3 : first + 7] = product(inverse, row[first + 3 : first + 7])
    return back


def worst_residual(t: Trajectory) -> float:
    position = np.nanmax(np.abs(t.residual_position / t.scale_position))
    return float(max(position, np.abs(t.residual_velocity / t.scale_velocity).max()))


def check(seed: int) -> None:
    mechanism = random_mechanism(seed)
    e = unit(np.random.default_rng(1000 + seed).normal(size=4))
    one, other = run(mechanism), run(mechanism.turned(e))
    assert one.status == other.status == "completed", (one.message, other.message)
    for trajectory in (one, other):
        assert worst_residual(trajectory) <= 1e-12
    # the error of two runs at rtol = 1e-10, as the motion spreads it; lengths and masses are near
    # 1, so that speeds are of some m/s and forces of 10 N
    exchanged = max(1.0, np.abs(one.energy_kinetic).max())
    for x, y, least in (
        (one.q, other.q, 1.0),
        (one.v, other.v, 1.0),
        (one.constraint_force, other.constraint_force, 10.0),
    ):
        size = max(least, np.abs(x).max())
        np.testing.assert_allclose(turn_back(y, e), x, rtol=0, atol=1e-6 * size)
    energy = one.energy_kinetic, other.energy_kinetic
    np.testing.assert_allclose(*energy, rtol=0, atol=1e-6 * exchanged)
    assert np.abs(one.energy_balance).max() <= 1e-7 * exchanged


@pytest.mark.parametrize("seed", FEW)
def test_turned_space(seed: int) -> None:
    check(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", MANY)
def test_turned_space_more(seed: int) -> None:
    check(seed)
