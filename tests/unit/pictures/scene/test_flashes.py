"""Flashes at impacts, and forces of contacts that are closed alone."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import lagcli
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.drawing import SceneDrawing
from lagcli.pictures.scene.scene import LIFE, Scene, with_contacts
from lagcli.pictures.scene.view_evaluator import scene_of
from lagcli.trajectory.trajectory import Trajectory


@cache
def run(name: str) -> Trajectory:
    return lagcli.simulate(lagcli.load(name))


def scene(name: str) -> Scene:
    found = scene_of(RunFile(run(name)))
    assert found is not None
    return found


def test_a_ball_flashes_where_it_hits_the_floor() -> None:
    ball = scene("bouncing_ball")
    (flashes,) = ball.flashes
    fall = np.sqrt(2 / 9.81)
    expected = fall * (1 + 2 * np.cumsum(0.8 ** np.arange(1, 6)))
    np.testing.assert_allclose(flashes.times[:6], [fall, *expected], rtol=1e-9)
    np.testing.assert_allclose(flashes.strengths[:6], 0.8 ** np.arange(6), rtol=1e-9)
    assert np.abs(flashes.at[1]).max() < 0.02  # between samples, the floor is near
    assert flashes.life == LIFE * 5
    assert (flashes.strengths > 1e-3).all()


def test_forces_are_drawn_where_the_contact_is_closed() -> None:
    ball = scene("bouncing_ball")
    (force,) = (v for v in ball.vectors if v.name == "floor")
    rests = run("bouncing_ball").multipliers[:, 0] > 0
    assert (force.components[1] > 0).tolist() == rests.tolist()
    assert np.isfinite(force.components[1]).all()
    assert rests.any()
    (velocity,) = (v for v in ball.vectors if v.name == "v")
    assert np.isfinite(velocity.components[1]).all()


def test_a_force_between_two_bodies_flashes_in_their_middle() -> None:
    cradle = scene("newtons_cradle")
    assert [flashes.name for flashes in cradle.flashes] == ["hit[2]", "hit[3]"]
    # balls of 0.1 m: the first one, from -0.5 m at 1 m/s, meets the second at 0.1 m
    for flashes, x in zip(cradle.flashes, (0.05, 0.15), strict=True):
        assert flashes.times.tolist() == pytest.approx([0.5])
        assert flashes.at[0].tolist() == pytest.approx([x])
        assert flashes.strengths.tolist() == [1.0]


def test_a_run_without_contacts_has_none() -> None:
    plain = scene("slider_crank")
    assert plain.flashes == ()
    assert with_contacts(plain, None, ()) is plain


def test_the_film_shows_rings_that_fade() -> None:
    ball = scene("bouncing_ball")
    quiet = SceneDrawing(replace(ball, flashes=()), 320, 240)
    drawing = SceneDrawing(ball, 320, 240)
    first = float(ball.flashes[0].times[0])

    def painted(time: float) -> int:
        both = drawing.frame(time).astype(int), quiet.frame(time).astype(int)
        return int(np.abs(both[0] - both[1]).sum())

    assert painted(first - 1e-3) == 0
    assert painted(first + 0.1 * LIFE * 5) > painted(first + 0.9 * LIFE * 5) > 0
    assert painted(first + 1.1 * LIFE * 5) == 0
