"""Projections of points to pictures."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from lagcli.pictures.scene.camera import OrbitCamera, PlaneCamera


def test_a_plane_fits_with_one_scale_and_its_middle_in_the_middle() -> None:
    camera = PlaneCamera(((0.0, 4.0), (-1.0, 1.0)), 200, 120, margin=10)
    assert camera.scale == pytest.approx(50)  # both would allow 50 pixels per unit of length
    places = camera.project(np.array([[2.0, 0.0], [4.0, 1.0]]))
    np.testing.assert_allclose(places, [[100, 60, 0], [200, 110, 0]])
    assert PlaneCamera(((1.0, 1.0), (2.0, 2.0)), 10, 10).scale == 1.0


def test_from_the_front_the_axes_are_right_and_up() -> None:
    # the eye on the negative y axis, level
    bounds = ((-1.0, 1.0),) * 3
    camera = OrbitCamera(bounds, 2**0.5, 100, 100, azimuth=-math.pi / 2, elevation=0.0)
    middle, right, up, near = camera.project(
        np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1], [0, -1, 0]])
    )
    np.testing.assert_allclose(middle, [50, 50, 0], atol=1e-12)
    assert right[0] > 50
    assert right[1] == pytest.approx(50)
    assert up[1] > 50
    assert up[0] == pytest.approx(50)
    assert near[2] < middle[2]  # depth grows away from the eye


def test_what_is_nearer_looks_larger() -> None:
    camera = OrbitCamera(((-1.0, 1.0),) * 3, 2**0.5, 100, 100, azimuth=-math.pi / 2, elevation=0.0)
    front, back = camera.project(np.array([[1.0, -1, 0], [1, 1, 0]]))
    assert front[0] > back[0] > 50


@pytest.mark.parametrize("azimuth", np.linspace(0, 2 * math.pi, 7))
def test_the_box_stays_in_the_picture_from_all_sides(azimuth: float) -> None:
    bounds = ((-1.0, 2.0), (0.0, 0.5), (-3.0, 1.0))
    camera = OrbitCamera(bounds, math.hypot(1.5, 0.25), 160, 90, margin=5, azimuth=azimuth)
    places = camera.project(np.array(list(itertools.product(*bounds))))
    assert (places[:, 0] >= 0).all()
    assert (places[:, 0] <= 160).all()
    assert (places[:, 1] >= 5).all()
    assert (places[:, 1] <= 85).all()
