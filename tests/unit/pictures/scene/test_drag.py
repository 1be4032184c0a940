"""Drag: a point of the view is moved, and the initial state follows."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.pictures.scene.automatic_view import with_view
from lagcli.pictures.scene.drag import Drag, places
from lagcli.simulations.simulation import Simulation, prepare

MODELS = Path(__file__).parents[4] / "models"


def drag(name: str, weights: dict[str, float], q: list[float] | None = None) -> Drag:
    model = with_view(lagcli.load(MODELS / f"{name}.yaml"))
    assert model.view is not None
    simulation = prepare(model)
    start = simulation.start.state.q if q is None else np.array(q)
    return Drag(simulation, model.view, weights, start)


def values(simulation: Simulation, *names: str) -> list[float]:
    return [simulation.initial[name] for name in names]


def test_points_of_the_ground_do_not_move() -> None:
    model = lagcli.load(MODELS / "slider_crank.yaml")
    assert model.view is not None
    found = places(model, model.view)
    assert [name for name, moves in found.items() if moves] == ["A", "B"]
    assert {"O", "L", "R"} <= found.keys()


def test_the_slider_takes_the_crank_and_the_rod_with_it() -> None:
    moved = drag("slider_crank", {"B": 1}).to([0.33, 0.0], None, 0.5)
    phi, psi, phi_dot, psi_dot = values(moved, "phi", "psi", "phi'", "psi'")
    assert 0.1 * math.cos(phi) + 0.3 * math.cos(psi) == pytest.approx(0.33, abs=1e-6)
    assert 0.1 * math.sin(phi) == pytest.approx(0.3 * math.sin(psi), abs=1e-14)
    assert 0 < phi < math.pi  # the branch on which it was
    # the fixed velocity stays, the other follows
    assert phi_dot == 12
    assert psi_dot == pytest.approx(12 * 0.1 * math.cos(phi) / (0.3 * math.cos(psi)), rel=1e-12)


def test_fixed_velocities_that_do_not_fit_change_as_little_as_possible() -> None:
    model = lagcli.load(
        MODELS / "pendulum_cartesian.yaml",
        set_initial={"x": 0, "y": -1, "x'": 2, "y'": 0},
        set={"l": 1},
    )
    assert model.view is not None
    simulation = prepare(model)
    found = Drag(simulation, model.view, {"P": 1}, simulation.start.state.q)
    angle = math.radians(40)
    moved = found.to([math.sin(angle), -math.cos(angle)], None, 2.0)
    x, y, vx, vy = values(moved, "x", "y", "x'", "y'")
    # within the part of the picture by which nobody sees a difference
    assert (x, y) == pytest.approx((math.sin(angle), -math.cos(angle)), abs=4e-6)
    # the projection of (2, 0) onto the tangent (cos, sin)
    speed = 2 * math.cos(angle)
    expected = (speed * math.cos(angle), speed * math.sin(angle))
    assert (vx, vy) == pytest.approx(expected, abs=1e-5)


def test_a_place_on_a_rod_is_a_mean_of_its_ends() -> None:
    found = drag("slider_crank", {"A": 0.5, "B": 0.5})
    start = found.to([0.0, 0.0], None, 0.5)  # not far enough, but nearest
    phi, psi = values(start, "phi", "psi")
    x = 0.1 * math.cos(phi) + 0.15 * math.cos(psi)
    y = 0.1 * math.sin(phi) - 0.15 * math.sin(psi)
    h = 1e-4
    for other in (phi - h, phi + h):
        rod = math.asin(math.sin(other) / 3)
        rod = rod if math.cos(psi) > 0 else math.pi - rod
        x_o = 0.1 * math.cos(other) + 0.15 * math.cos(rod)
        y_o = 0.1 * math.sin(other) - 0.15 * math.sin(rod)
        assert math.hypot(x_o, y_o) > math.hypot(x, y) - 1e-6


def test_along_the_line_of_sight_the_point_is_free() -> None:
    found = drag("charged_pendulum", {"P": 1})
    eye, target = np.array([0.3, -8.0, 0.2]), np.array([0.3, 0.0, -0.4])
    moved = found.to(target.tolist(), eye.tolist(), 2.0)
    point = np.array(values(moved, "x", "y", "z"))
    sight = (target - eye) / np.linalg.norm(target - eye)
    away = (point - eye) - sight * ((point - eye) @ sight)
    np.testing.assert_allclose(away, 0, atol=1e-5)
    length = moved.model.parameters["l"].value
    assert point @ point == pytest.approx(length**2, rel=1e-13)


def test_whole_turns_are_left_out_where_they_mean_nothing() -> None:
    turned = drag("slider_crank", {"A": 1}, [0.7 + 6 * math.pi, math.asin(math.sin(0.7) / 3)])
    moved = turned.to([0.1 * math.cos(0.8), 0.1 * math.sin(0.8)], None, 0.5)
    assert values(moved, "phi") == pytest.approx([0.8], abs=1e-5)
    # a disc that rolls has gone as far as it has turned
    model = lagcli.load_text(
        "coordinates: {x: {unit: m}, a: {unit: rad}}\n"
        "parameters: {m: 1 kg, r: 1 m, g: 9.81 m/s^2}\n"
        "T: m/2*x'^2 + m*r^2/4*a'^2\nconstraints: {roll: x = r*a}\n"
        "initial: {x: 0 m, a: {guess: 0 rad}, x': 0 m/s, a': {guess: 0 rad/s}}\n"
        "view: {points: {C: [x, r]}, discs: {d: {center: C, radius: r, angle: -a}}}\n"
    )
    assert model.view is not None
    rolled = Drag(prepare(model), model.view, {"C": 1}, np.array([7.0, 7.0]))
    assert values(rolled.to([7.5, 1.0], None, 10.0), "x", "a") == pytest.approx([7.5, 7.5])
