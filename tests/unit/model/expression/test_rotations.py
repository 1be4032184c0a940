"""Rotations near to matrices of rounded numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from random_cases import seeds
from scipy.spatial.transform import Rotation

from lagcli.model.expression.rotations import nearest_rotation, quaternion_text


def matrix_of(text: str) -> np.ndarray:
    """Return the matrix of ``quat(e0, e1, e2, e3)``."""
    e = np.array([float(x) for x in text.removeprefix("quat(").removesuffix(")").split(",")])
    assert abs(np.linalg.norm(e) - 1) < 1e-15
    assert e[np.nonzero(e)[0][0]] > 0
    return Rotation.from_quat([*e[1:], e[0]]).as_matrix()


@pytest.mark.parametrize("seed", seeds(100, 1000))
def test_the_nearest_rotation_is_that_of_the_singular_vectors(seed: int) -> None:
    rng = np.random.default_rng(seed)
    exact = Rotation.random(random_state=rng)
    if seed % 4 == 0:  # half turns and right angles, where components of the quaternion vanish
        exact = Rotation.from_euler("xyz", rng.choice([0, 30, 90, 180, 270], 3), degrees=True)
    digits = int(rng.integers(2, 17))
    rounded = np.round(exact.as_matrix(), digits)
    u, _, v = np.linalg.svd(rounded)
    nearest = nearest_rotation(rounded.tolist())
    text = quaternion_text(rounded.tolist())
    assert nearest is not None
    assert text is not None
    np.testing.assert_allclose(nearest, u @ v, atol=1e-14)
    np.testing.assert_allclose(matrix_of(text), u @ v, atol=1e-14)
    # an entry is rounded by half a unit of its last digit; the nearest moves by no more than twice
    np.testing.assert_allclose(matrix_of(text), exact.as_matrix(), atol=2 * 10.0**-digits + 1e-14)


@pytest.mark.parametrize(
    "matrix",
    [
        [[1, 0, 0], [0, 1, 0], [0, 0, -1]],  # a reflection
        [[1, 0, 0], [0, 1, 0], [0, 0, 1.1]],
        [[0, 0, 0], [0, 0, 0], [0, 0, 0]],
        [[1, 1, 0], [0, 1, 0], [0, 0, 1]],
        [[math.nan, 0, 0], [0, 1, 0], [0, 0, 1]],
    ],
)
def test_other_matrices_have_none(matrix: list[list[float]]) -> None:
    assert quaternion_text(matrix) is None
