"""Derivatives of jumps of the velocities, against closed forms and differences."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lagcli.engine.evaluator import Constraints, Dynamics
from lagcli.engine.sensitivity.impulsive import ImpulsiveRow, JumpMatrices, jump

NOTHING = np.zeros(1)
Array = NDArray[np.float64]


def matrices(mass: Array, jacobian: Array, drift: Array) -> tuple[Dynamics, Constraints]:
    none = np.zeros_like(drift)
    return (
        Dynamics(mass, np.zeros(len(mass)), jacobian, none, np.zeros(()), True),
        Constraints(none, jacobian, drift, none, none),
    )


def at(mass: Array, jacobian: Array, drift: Array, dm: Array, db: Array, dd: Array) -> JumpMatrices:
    slopes = matrices(dm[..., None], db[..., None], dd[..., None])
    return JumpMatrices(*matrices(mass, jacobian, drift), *slopes)


def test_a_body_that_hits_a_moving_wall() -> None:
    # γ = v − w: v⁺ = w − e (v − w)
    still = at(
        np.eye(1) * 2,
        np.ones((1, 1)),
        np.array([-3.0]),
        np.ones((1, 1)),
        np.zeros((1, 1)),
        np.array([-1.0]),
    )
    row = ImpulsiveRow(0, True, 0.5, np.array([0.1]))
    found = jump(still, np.array([1.0]), np.array([[0.2]]), [row])
    assert found.v.tolist() == [pytest.approx(4.0)]
    # by w: 1 + e, by e: −(v − w), by v: −e
    assert found.dv[0, 0] == pytest.approx(1.5 + 0.1 * 2 - 0.5 * 0.2)
    assert found.impulse[0] == pytest.approx(6.0)
    # Λ = m (v⁺ − v)
    assert found.dimpulse[0, 0] == pytest.approx(1.0 * 3.0 + 2 * (1.6 - 0.2))


@pytest.mark.parametrize("kind", ["sticks", "slips", "open"])
def test_differences_of_random_jumps(kind: str) -> None:
    rng = np.random.default_rng(7)
    n = 3
    root, droot = rng.normal(size=(2, n, n))
    b, db = rng.normal(size=(2, 2, n))
    drift, ddrift = rng.normal(size=(2, 2))
    v, dv = rng.normal(size=(2, n))
    force, dforce = rng.normal(size=(2, n))
    mu, dmu, e, de = 0.3, 0.7, 0.6, -0.4

    def solved(x: float) -> tuple[Array, Array, Array, Array]:
        mass = (root + x * droot) @ (root + x * droot).T + np.eye(n)
        change = (droot @ (root + x * droot).T) + (root + x * droot) @ droot.T
        first = ImpulsiveRow(0, True, e + x * de, np.array([de]))
        second = {
            "sticks": ImpulsiveRow(1, True, 0.0, NOTHING),
            "slips": ImpulsiveRow(1, False, -(mu + x * dmu), np.array([-dmu]), 0),
            "open": ImpulsiveRow(1, False, mu + x * dmu, np.array([dmu])),
        }[kind]
        matrix = at(mass, b + x * db, drift + x * ddrift, change, db, ddrift)
        given = force + x * dforce, dforce[:, None]
        found = jump(matrix, v + x * dv, dv[:, None], [first, second], given)
        return found.v, found.impulse, found.dv[:, 0], found.dimpulse[:, 0]

    h, weights = 1e-3, {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
    _, _, dv_found, dimpulse = solved(0.0)
    for place, found in ((0, dv_found), (1, dimpulse)):
        expected = sum(
            w * (solved(k * h)[place] - solved(-k * h)[place]) / h for k, w in weights.items()
        )
        np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
