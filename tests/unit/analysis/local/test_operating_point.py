"""Tangent spaces, independent coordinates, and the response of accelerations and multipliers."""

from __future__ import annotations

import numpy as np
import pytest

from lagcli.analysis.local.operating_point import (
    Response,
    independent,
    least,
    multipliers_of,
    tangent_of,
)
from lagcli.engine.linear import dense

RANDOM = np.random.default_rng(5)
#: The third row is the sum of the others.
REDUNDANT = np.array([[1.0, 2, 0, 0, 1], [0, 1, -1, 3, 0], [1, 3, -1, 3, 1]])


def test_independent_coordinates_have_rows_of_the_identity() -> None:
    null = dense.decompose(REDUNDANT).null
    chosen, basis = independent(null, np.ones(5))
    assert len(chosen) == 3
    np.testing.assert_array_equal(basis[list(chosen)], np.eye(3))
    np.testing.assert_allclose(REDUNDANT @ basis, 0, atol=1e-14)


def test_preferred_coordinates_are_chosen_where_they_are_independent() -> None:
    null = dense.decompose(np.array([[1.0, 1e-3, 0], [0, 0, 1]])).null
    assert independent(null, np.ones(3))[0] == (1,)
    assert independent(null, np.ones(3), (0,))[0] == (0,)
    assert independent(null, np.ones(3), (2,))[0] == (1,)  # which is fixed
    assert independent(null, np.ones(3), (), (0,))[0] == (1,)  # not worth an ill-chosen basis
    assert independent(np.zeros((3, 0)), np.ones(3)) == ((), pytest.approx(np.zeros((3, 0))))


def test_tangent_space_satisfies_the_constraints_on_velocities() -> None:
    whole = dense.decompose(REDUNDANT)
    holonomic = dense.decompose(REDUNDANT[:1])
    gradient = RANDOM.standard_normal((2, 5))
    gradient = np.vstack([gradient, gradient.sum(axis=0)])
    found = tangent_of(whole, holonomic, gradient)
    assert (len(found.positions), len(found.velocities)) == (4, 3)
    np.testing.assert_allclose(REDUNDANT[:1] @ found.position_basis, 0, atol=1e-14)
    rates = REDUNDANT @ found.velocity_by_position + gradient @ found.position_basis
    np.testing.assert_allclose(rates, 0, atol=1e-13)
    assert not found.velocity_by_position[list(found.velocities)].any()


def test_response_solves_the_equations_with_least_multipliers() -> None:
    root = RANDOM.standard_normal((5, 5))
    mass = root @ root.T
    whole = dense.decompose(REDUNDANT)
    tangent = tangent_of(whole, whole, np.zeros((3, 5)))
    forces, rates = RANDOM.standard_normal((5, 2)), RANDOM.standard_normal((2, 2))
    rates = np.vstack([rates, rates.sum(axis=0)])
    a, multipliers = Response(mass, tangent)(forces, rates)
    np.testing.assert_allclose(REDUNDANT @ a, rates, atol=1e-12)
    np.testing.assert_allclose(mass @ a - REDUNDANT.T @ multipliers, forces, atol=1e-11)
    np.testing.assert_allclose(np.array([1, 1, -1]) @ multipliers, 0, atol=1e-12)
    np.testing.assert_allclose(multipliers_of(whole, REDUNDANT.T @ multipliers), multipliers)
    np.testing.assert_allclose(REDUNDANT @ least(whole, rates), rates, atol=1e-13)


def test_motion_without_inertia_is_an_error() -> None:
    whole = dense.decompose(np.array([[1.0, 0.0]]))
    tangent = tangent_of(whole, whole, np.zeros((1, 2)))
    with pytest.raises(dense.SingularSystem):
        Response(np.diag([1.0, 0.0]), tangent)(np.ones((2, 1)), np.ones((1, 1)))
