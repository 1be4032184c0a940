"""A box that falls on a floor: eight contacts, of which four redundant ones hold at the end."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.trajectory.trajectory import Trajectory

BOX = """
coordinates: {{r: point, e: quaternion}}
parameters: {{m: 1 kg, a: 0.1 m, b: 0.06 m, c: 0.04 m, g: 9.81 m/s^2, eps: {restitution}}}
T: body(m, m/3*diag(b^2 + c^2, a^2 + c^2, a^2 + b^2), r, e)
V: m*g*r.z
functions:
  corner(i, j, k): dot([0, 0, 1], r + e*[(2*i - 1)*a, (2*j - 1)*b, (2*k - 1)*c])
constraints:
  lower[i = 0..1, j = 0..1]: {{expr: "corner(i, j, 0) >= 0", restitution: eps}}
  upper[i = 0..1, j = 0..1]: {{expr: "corner(i, j, 1) >= 0", restitution: eps}}
initial:
  r: [0, 0, 0.5 m]
  e: rot_x({rotation[0]} deg)*rot_y({rotation[1]} deg)*rot_z({rotation[2]} deg)
  r': [0.3, 0, 0]
  e': {spin}
"""
HALF_EXTENTS = np.array([0.1, 0.06, 0.04])
MASS, G = 1.0, 9.81


def fall(restitution: float, rotation: list[float], spin: list[float], **settings: object) -> None:
    """Let the box fall for 4 s, and check its state of rest."""
    text = BOX.format(restitution=restitution, rotation=rotation, spin=spin)
    found = lagcli.simulate(lagcli.load_text(text), t_end=4, samples=41, **settings)
    assert found.status == "completed", found.message
    energy = np.abs(found.energy_total).max()
    # a closed contact moves the box by up to 1e-9 of the gap's terms
    assert np.abs(found.energy_balance).max() < 5e-8 * energy
    check_rest(found)


def check_rest(found: Trajectory) -> None:
    """A face lies on the floor, slides on without friction, and each of its corners bears m g/4."""
    rotation = rotation_matrix(found.q[-1, 3:7])
    heights = np.abs(rotation[2]) * HALF_EXTENTS
    assert found.q[-1, 2] == pytest.approx(heights.sum(), abs=1e-9)
    assert np.sort(np.abs(rotation[2])) == pytest.approx([0, 0, 1], abs=1e-8)
    forces = found.multipliers[-1, :8]
    assert np.sort(forces) == pytest.approx([0] * 4 + [MASS * G / 4] * 4, abs=1e-3)
    assert found.v[-1, :3] == pytest.approx([0.3, 0, 0], abs=1e-9)


def rotation_matrix(e: np.ndarray) -> np.ndarray:
    """Return the matrix of a unit quaternion."""
    w, x, y, z = e
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@pytest.mark.parametrize(
    ("restitution", "rotation", "spin"),
    [
        (0.3, [20, 35, 0], [1, 2, 3]),  # two corners come to rest by turns
        (0.1, [166.392, 25.301, -118.254], [5.884, 7.58, 3.264]),  # a step tried beyond all bounds
        (0, [42.546, -10.665, -164.455], [3.293, -3.348, 7.354]),  # a pivot vanishes at an instant
        (0.5, [0, 0, 0], [0, 0, 0]),  # all corners at once
    ],
)
def test_box_comes_to_rest_on_a_face(
    restitution: float, rotation: list[float], spin: list[float]
) -> None:
    fall(restitution, rotation, spin)


@pytest.mark.slow
def test_boxes_come_to_rest_however_they_fall() -> None:
    random = np.random.default_rng(1)
    for _ in range(100):
        fall(
            float(random.choice([0, 0.1, 0.3, 0.5, 0.7])),
            np.round(random.uniform(-180, 180, 3), 3).tolist(),
            np.round(random.uniform(-8, 8, 3), 3).tolist(),
        )
