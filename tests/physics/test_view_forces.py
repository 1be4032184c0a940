"""The arrows of a view against closed forms: forces of constraints at points, velocities."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.errors import UsageError
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.scene import DrawnVector, Scene
from lagcli.pictures.scene.view_evaluator import scene_of
from lagcli.trajectory.trajectory import Trajectory

MODELS = Path(__file__).parents[2] / "models"

HANGING = """
coordinates: [x, y]
parameters: {m: 2, g: 9.81, l: 0.5}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints: {rod: x^2 + y^2 = l^2}
initial: {x: 0, x': 0, y: -l, y': 0}
view:
  points: {O: [0, 0], P: [x, y]}
  vectors: {rod: {at: P, force: rod}, both: {at: [O, P], force: rod}}
"""


def drawn(trajectory: Trajectory) -> Scene:
    scene = scene_of(RunFile(trajectory))
    assert scene is not None
    return scene


def run(name: str, view: str | None = None, **options: object) -> tuple[Trajectory, Scene]:
    text = (MODELS / f"{name}.yaml").read_text(encoding="utf-8")
    if view is not None:
        text = text.split("\nview:")[0] + "\nview:\n" + view
    trajectory = lagcli.simulate(lagcli.load_text(text), **options)
    return trajectory, drawn(trajectory)


def vector(scene: Scene, name: str, at: str | None = None) -> np.ndarray:
    found = [v for v in scene.vectors if v.name == name and at in (None, v.at)]
    assert len(found) == 1
    return components(found[0], len(scene.time))


def components(v: DrawnVector, count: int) -> np.ndarray:
    return np.stack([np.broadcast_to(x, (count,)) for x in v.components])


def test_a_hanging_mass_is_held_by_its_weight() -> None:
    trajectory = lagcli.simulate(lagcli.load_text(HANGING), t_end=0.1, samples=3)
    scene = drawn(trajectory)
    # lambda = -m g/(2 l), the force 2 lambda (x, y): the weight, upwards
    np.testing.assert_allclose(vector(scene, "rod"), [[0] * 3, [2 * 9.81] * 3], atol=1e-12)
    # the same force acts on the fixed point, downwards
    np.testing.assert_allclose(vector(scene, "both", "P"), vector(scene, "rod"), atol=1e-12)
    np.testing.assert_allclose(vector(scene, "both", "O"), -vector(scene, "rod"), atol=1e-12)


def test_the_rod_of_a_pendulum_pulls_with_its_tension() -> None:
    trajectory, scene = run("pendulum_cartesian", t_end=3.0, samples=101)
    x, y = trajectory.q.T
    speed = (trajectory.v**2).sum(axis=1)
    tension = speed - 9.81 * y  # m v^2/l + m g cos(theta), m = l = 1
    np.testing.assert_allclose(vector(scene, "rod"), -tension * np.stack((x, y)), atol=1e-7)


def test_the_guide_of_a_slider_crank_pushes_upright() -> None:
    trajectory, scene = run("slider_crank")
    guide = vector(scene, "guide")
    np.testing.assert_allclose(guide[0], 0, atol=1e-11)
    np.testing.assert_allclose(guide[1], trajectory.multipliers[:, 0], rtol=1e-12)
    # what the rod pulls at B, from B's acceleration alone, and B's weight, m = 1
    psi = trajectory.q[:, 1]
    tension = trajectory.outputs["rod_tension"]
    np.testing.assert_allclose(guide[1], 9.81 - tension * np.sin(psi), atol=1e-8)
    assert guide[1].min() > 0  # at this speed the guide only pushes up


def test_the_forces_of_a_rotating_hoop() -> None:
    trajectory, scene = run("bead_on_rotating_hoop", samples=201)
    theta, rate = trajectory.q[:, 1], trajectory.v[:, 1]
    phi = 4 * trajectory.time
    outward = np.stack((np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), -np.cos(theta)))
    around = np.stack((-np.sin(phi), np.cos(phi), 0 * phi))
    radial = -(rate**2 + 16 * np.sin(theta) ** 2 + 9.81 * np.cos(theta))
    np.testing.assert_allclose(vector(scene, "hoop"), radial * outward, atol=1e-7)
    moment = 2 * 4 * rate * np.sin(theta) * np.cos(theta)
    np.testing.assert_allclose(vector(scene, "drive") * np.sin(theta), moment * around, atol=1e-7)


def test_a_rod_between_two_masses_pulls_both() -> None:
    trajectory, scene = run("double_pendulum_cartesian", t_end=2.0, samples=101)
    x_1, y_1, x_2, y_2 = trajectory.q.T
    along = np.stack((x_2 - x_1, y_2 - y_1)) / 0.4
    tension = trajectory.outputs["tension_2"]
    np.testing.assert_allclose(vector(scene, "rod_2", "P_1"), tension * along, atol=1e-9)
    np.testing.assert_allclose(vector(scene, "rod_2", "P_2"), -tension * along, atol=1e-9)


def test_forces_of_a_family() -> None:
    view = (
        "  points: {'P[i = 0..N]': [x[i], y[i]]}\n"
        "  vectors: {'rod[i = 1..N]': {at: [P[i-1], P[i]], force: rod[i]}}\n"
    )
    text = (MODELS / "chain.yaml").read_text(encoding="utf-8").split("\nview:")[0]
    model = lagcli.load_text(f"{text}\nview:\n{view}", set={"N": 5})
    trajectory = lagcli.simulate(model, t_end=0.5, samples=21)
    scene = drawn(trajectory)
    assert len(scene.vectors) == 10
    for i in range(1, 6):
        up, down = (vector(scene, f"rod[{i}]", f"P[{j}]") for j in (i, i - 1))
        tension = trajectory.outputs[f"tension[{i}]"]
        np.testing.assert_allclose(np.hypot(*up), np.abs(tension), rtol=1e-9)
        np.testing.assert_allclose(up, -down, atol=1e-9)


@pytest.mark.parametrize("name", ["slider_crank", "rolling_disk", "heavy_top"])
def test_velocities_are_the_rates_of_the_points(name: str) -> None:
    head = (MODELS / f"{name}.yaml").read_text(encoding="utf-8").split("  vectors:")[0]
    point = "B" if name == "slider_crank" else "C"
    text = f"{head}  vectors: {{v: {{velocity: {point}}}}}\n"
    trajectory = lagcli.simulate(lagcli.load_text(text), t_end=0.02, samples=201)
    scene = drawn(trajectory)
    place = np.stack([np.broadcast_to(x, scene.time.shape) for x in scene.points[point]])
    t = scene.time
    # central differences of order 4 over 2e-4 s
    slope = (8 * (place[:, 3:-1] - place[:, 1:-3]) - (place[:, 4:] - place[:, :-4])) / (
        12 * (t[1] - t[0])
    )
    np.testing.assert_allclose(vector(scene, "v")[:, 2:-2], slope, atol=2e-6)


@pytest.mark.parametrize(
    ("points", "at", "why"),
    [
        # B written by the constraint: no force at a point that cannot move upwards moves psi
        ("B: [x_B, 0]", "B", "cannot produce λ b"),
        # A moves on a circle, B with it: six components from two numbers
        ("A: [x_A, y_A], B: [x_B, r*sin(phi) - l*sin(psi)]", "[A, B]", "is not unique"),
    ],
)
def test_a_force_that_cannot_stand_is_an_error(points: str, at: str, why: str) -> None:
    view = f"  points: {{{points}}}\n  vectors: {{guide: {{at: {at}, force: guide}}}}\n"
    with pytest.raises(UsageError, match=why) as caught:
        run("slider_crank", view, t_end=0.5, samples=21)
    assert "components" in str(caught.value)


def test_the_force_of_a_joint_of_minimal_coordinates_is_that_on_both_bodies() -> None:
    view = (
        "  points:\n"
        "    C: [a*cos(theta_1) + b*cos(theta_2), a*sin(theta_1) + b*sin(theta_2)]\n"
        "    C_2: [d + c*cos(theta_3), c*sin(theta_3)]\n"
        "  vectors: {joint: {at: [C, C_2], force: joint_x}}\n"
    )
    trajectory, scene = run("four_bar", view, t_end=0.2, samples=21)
    force = np.stack((trajectory.multipliers[:, 0], np.zeros(21)))
    size = np.abs(force).max()
    np.testing.assert_allclose(vector(scene, "joint", "C"), force, atol=1e-6 * size)
    np.testing.assert_allclose(vector(scene, "joint", "C_2"), -force, atol=1e-6 * size)


JOINT = """
coordinates: {r: point, e: quaternion}
parameters: {m: 2 kg, k: 3 kg*m^2, l: 0.5 m, g: 9.81 m/s^2}
T: body(m, diag(k, k, k), r, e)
V: m*g*r.z
constraints: {pin: "r + e*[0, 0, l] = [0, 0, 0]"}
initial: {r: [0, 0, -l], e: 1, r': 0, e': 0}
view:
  points: {P: "r + e*[0, 0, l]"}
  vectors: {pin: {at: P, force: pin}, side: {at: P, force: pin.x}}
"""


def test_a_vector_constraint_is_drawn_with_all_its_components() -> None:
    trajectory = lagcli.simulate(lagcli.load_text(JOINT), t_end=0.1, samples=3)
    scene = drawn(trajectory)
    expected = [[0] * 3, [0] * 3, [2 * 9.81] * 3]
    np.testing.assert_allclose(vector(scene, "pin"), expected, atol=1e-12)
    np.testing.assert_allclose(vector(scene, "side"), np.zeros((3, 3)), atol=1e-12)
