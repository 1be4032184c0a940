"""Scenes: the view along a run, from files and from memory."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from trajectories import all_terms

import lagcli
from lagcli.errors import UsageError
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.drawing import Moment, SceneDrawing, joints, vector_ends
from lagcli.pictures.scene.scene import (
    LIFE,
    LONG,
    MARGIN,
    DrawnVector,
    Scene,
    frames,
    scaled,
    with_contacts,
)
from lagcli.pictures.scene.view_evaluator import ViewEvaluator, scene_of
from lagcli.trajectory.trajectory import Trajectory

MODELS = Path(__file__).parents[4] / "models"
NAMES = sorted(path.stem for path in MODELS.rglob("*.yaml"))


@cache
def short(name: str) -> Trajectory:
    model = lagcli.load(name)
    end = (model.settings.t_end or 1.0) / 10
    return lagcli.simulate(model, t_end=end, samples=25)


def drawn(run: RunFile, **options: object) -> Scene:
    scene = scene_of(run, **options)
    assert scene is not None
    return scene


@pytest.mark.parametrize("name", NAMES)
def test_every_shipped_model_has_a_scene(name: str) -> None:
    scene = drawn(RunFile(short(name)))
    json.dumps(scene.to_json(), allow_nan=False)
    count = len(scene.time)
    assert count == 25
    shown = {p for s in scene.segments for p in (s.start, s.end)}
    shown |= {d.center for d in scene.discs} | {v.at for v in scene.vectors}
    shown |= {*scene.grounds, *scene.trails, *(scene.labels or {})}
    shown |= {*scene.sliders, *scene.masses, *(p for plate in scene.plates for p in plate.points)}
    assert shown == set(scene.points)  # a point that nothing is drawn at is a slip
    for place in scene.points.values():
        assert len(place) == scene.dimension
        assert all(len(x) in (1, count) and np.isfinite(x).all() for x in place)
        for x, (low, high) in zip(place, scene.bounds, strict=True):
            assert low < x.min() <= x.max() < high
    moving = [x for place in scene.points.values() for x in place]
    moving += [d.angle for d in scene.discs if d.angle is not None]
    assert any(len(x) == count for x in moving)


@pytest.mark.parametrize("name", NAMES)
def test_rods_keep_their_length(name: str) -> None:
    # what is drawn as a rod is one: a check of the points against the constraints
    scene = drawn(RunFile(short(name)))
    for s in scene.segments:
        if s.kind == "rod":
            square = sum(
                (a - b) ** 2
                for a, b in zip(scene.points[s.start], scene.points[s.end], strict=True)
            )
            length = np.sqrt(square)
            if name == "atwood":  # ropes that run over the pulley
                continue
            assert np.ptp(length) < 1e-9 * length.max()


def test_a_file_alone_gives_the_same_scene(tmp_path: Path) -> None:
    trajectory = short("slider_crank")
    lagcli.write(trajectory, tmp_path / "run.h5")
    lagcli.write(trajectory, tmp_path / "run.csv", meta=True)
    expected = drawn(RunFile(trajectory)).to_json()
    assert drawn(RunFile(tmp_path / "run.h5")).to_json() == expected
    assert drawn(RunFile(tmp_path / "run.csv")).to_json() == expected


def test_some_samples_alone(tmp_path: Path) -> None:
    lagcli.write(short("slider_crank"), tmp_path / "run.h5")
    run = RunFile(tmp_path / "run.h5")
    every, some = drawn(run), drawn(run, samples=np.array([0, 7, 24]))
    assert run.count == 25
    assert np.array_equal(some.time, every.time[[0, 7, 24]])
    assert np.array_equal(some.points["B"][0], every.points["B"][0][[0, 7, 24]])


def test_csv_alone_holds_no_model(tmp_path: Path) -> None:
    lagcli.write(short("slider_crank"), tmp_path / "run.csv")
    with pytest.raises(UsageError, match=r"contains no model.*--model"):
        scene_of(RunFile(tmp_path / "run.csv"))
    scene = drawn(RunFile(tmp_path / "run.csv", str(MODELS / "slider_crank.yaml")))
    assert "B" in scene.points


def test_another_model_is_rejected(tmp_path: Path) -> None:
    lagcli.write(short("slider_crank"), tmp_path / "run.h5")
    with pytest.raises(UsageError, match="is not the model of"):
        scene_of(RunFile(tmp_path / "run.h5", str(MODELS / "atwood.yaml")))


def test_the_values_of_the_run_are_those_of_the_picture(tmp_path: Path) -> None:
    path = MODELS / "slider_crank.yaml"
    model = lagcli.load(path, set={"l": "50 cm", "r": "l/4"})
    lagcli.write(lagcli.simulate(model, t_end=0.1, samples=3), tmp_path / "run.h5")
    scene = drawn(RunFile(tmp_path / "run.h5"))
    x, y = scene.points["A"]
    np.testing.assert_allclose(np.hypot(x, y), 0.125, rtol=1e-12)


def test_a_family_of_another_length(tmp_path: Path) -> None:
    model = lagcli.load(MODELS / "chain.yaml", set={"N": 4, "theta_0": "10 deg"})
    lagcli.write(lagcli.simulate(model, t_end=0.1, samples=3), tmp_path / "run.h5")
    assert len(drawn(RunFile(tmp_path / "run.h5")).points) == 5


def test_initial_values_from_the_command_line_alone(tmp_path: Path) -> None:
    text = (
        "coordinates: [x]\nparameters: {k: {unit: N/m}}\nT: x'^2/2\nV: k*x^2/2\n"
        "initial: {x: 1}\nview: {points: {P: [x, 0]}}\n"
    )
    model = lagcli.load_text(text, set={"k": 2}, set_initial={"x'": 3})
    lagcli.write(lagcli.simulate(model, t_end=0.1, samples=3), tmp_path / "run.h5")
    assert drawn(RunFile(tmp_path / "run.h5")).points["P"][1].tolist() == [0]


def test_without_a_view_there_is_no_scene() -> None:
    text = "coordinates: [phi]\nT: phi'^2/2\ninitial: {phi: 1, phi': 0}\n"
    trajectory = lagcli.simulate(lagcli.load_text(text), t_end=0.1, samples=3)
    assert scene_of(RunFile(trajectory)) is None


def test_one_stage_for_many_values() -> None:
    model = lagcli.load(MODELS / "slider_crank.yaml")
    evaluator = ViewEvaluator(model)
    assert set(evaluator.needs) == {"time", "q", "v", "constraint_force_by"}
    scene = evaluator.scene(
        {
            "time": np.zeros(1),
            "q": np.array([[np.pi / 2, 0.0]]),
            "v": np.array([[2.0, 0.0]]),
            "constraint_force_by": np.zeros((1, 2)),
        },
        all_terms(1, 2),
        model.parameter_values | {"r": 3.0},
    )
    assert scene.at("A", 0) == pytest.approx((0, 3))
    velocity = next(v for v in scene.vectors if v.name == "v_A")
    assert [float(x[0]) for x in velocity.components] == pytest.approx([-6, 0])


def test_a_force_at_a_dead_centre_is_that_beside_it() -> None:
    model = lagcli.load(MODELS / "slider_crank.yaml")
    phi, psi = np.array([0.0, 1e-7, 0.5]), np.array([0.0, 1e-7 / 3, np.arcsin(np.sin(0.5) / 3)])
    work = 2.0 * np.stack((0.1 * np.cos(phi), -0.3 * np.cos(psi)), axis=1)  # lambda = 2
    scene = ViewEvaluator(model).scene(
        {
            "time": np.arange(3.0),
            "q": np.stack((phi, psi), axis=1),
            "v": np.zeros((3, 2)),
            "constraint_force_by": work,
        },
        all_terms(1, 2),
    )
    guide = next(v for v in scene.vectors if v.name == "guide")
    np.testing.assert_allclose(guide.components[0], 0, atol=1e-7)
    np.testing.assert_allclose(guide.components[1], 2, rtol=1e-12)


# bounds and scales


def point(*places: list[float]) -> tuple[np.ndarray, ...]:
    return tuple(np.array(x) for x in places)


def test_bounds_hold_points_and_discs_and_are_no_line() -> None:
    scene = Scene(2, np.zeros(2), {"P": point([0.0, 10.0], [1.0])})
    (low, high), (bottom, top) = scene.bounds
    assert (low, high) == pytest.approx((-10 * MARGIN, 10 + 10 * MARGIN))
    assert top - bottom == pytest.approx(3 + 20 * MARGIN)
    assert (top + bottom) / 2 == pytest.approx(1)


def test_bounds_of_what_does_not_move_and_of_undefined_places() -> None:
    still = Scene(2, np.zeros(1), {"P": point([2.0], [1.0])})
    assert all(high > low for low, high in still.bounds)
    undefined = Scene(2, np.zeros(2), {"P": point([np.nan, 1.0], [np.nan, np.inf])})
    assert np.isfinite(undefined.bounds).all()
    assert undefined.to_json()["points"]["P"] == [[None, 1.0], [None, None]]


def vectors(*components: tuple[list[float], list[float], str]) -> list[DrawnVector]:
    return [
        DrawnVector(f"v{i}", "vector", "P", point(x, y), unit)
        for i, (x, y, unit) in enumerate(components)
    ]


def test_vectors_of_one_unit_share_a_scale() -> None:
    found = scaled(
        vectors(([3.0], [4.0], "N"), ([0.0], [1.0], "N"), ([0.0], [100.0], "m/s")),
        [(0.0, 2.0), (0.0, 1.0)],
    )
    lengths = [float(np.hypot(*v.drawn())[0]) for v in found]
    assert found[0].scale == found[1].scale
    assert lengths == pytest.approx([2 * LONG, 0.4 * LONG, 2 * LONG])


def test_a_rare_peak_does_not_shrink_a_vector_and_nothing_is_nothing() -> None:
    peaked = np.ones(1000)
    peaked[3] = 1e6
    small, nothing = scaled(
        [
            DrawnVector("f", "force", "P", (peaked * 0, peaked), "N"),
            DrawnVector("g", "vector", "P", (peaked * 0, peaked * np.nan), ""),
        ],
        [(0.0, 1.0), (0.0, 1.0)],
    )
    assert small.scale > 0.3 / 1e6 * 5
    assert nothing.scale == 1


def test_frames_of_discs() -> None:
    first, second = frames(point([0.0, 0.0, 1.0], [0.0, 2.0, 0.0], [3.0, 0.0, 0.0]))
    np.testing.assert_allclose(first, [[1, 0, 0], [-1, 0, 0], [0, 1, 0]], atol=1e-15)
    np.testing.assert_allclose(second, [[0, 1, 0], [0, 0, 1], [0, 0, 1]], atol=1e-15)


@pytest.mark.filterwarnings("error")
def test_a_vector_too_long_for_numbers_has_no_part_in_the_scale() -> None:
    usual, long = np.array([1.0, 2.0]), np.array([1.0, 1e308])
    extent = [(0.0, 10.0)]
    (alone,) = scaled([DrawnVector("F", "force", "A", (usual,), "N")], extent)
    (beside,) = scaled([DrawnVector("F", "force", "A", (long,), "N")], extent)
    assert alone.scale * 2.0 == pytest.approx(beside.scale * 1.0)


@cache
def contact_run(name: str) -> Trajectory:
    return lagcli.simulate(lagcli.load(name))


def contact_scene(name: str) -> Scene:
    found = scene_of(RunFile(contact_run(name)))
    assert found is not None
    return found


def test_a_ball_flashes_where_it_hits_the_floor() -> None:
    ball = contact_scene("bouncing_ball")
    (flashes,) = ball.flashes
    fall = np.sqrt(2 / 9.81)
    expected = fall * (1 + 2 * np.cumsum(0.8 ** np.arange(1, 6)))
    np.testing.assert_allclose(flashes.times[:6], [fall, *expected], rtol=1e-9)
    np.testing.assert_allclose(flashes.strengths[:6], 0.8 ** np.arange(6), rtol=1e-9)
    assert np.abs(flashes.at[1]).max() < 0.02  # between samples, the floor is near
    assert flashes.life == LIFE * 5
    assert (flashes.strengths > 1e-3).all()


def test_forces_are_drawn_where_the_contact_is_closed() -> None:
    ball = contact_scene("bouncing_ball")
    (force,) = (v for v in ball.vectors if v.name == "floor")
    rests = contact_run("bouncing_ball").multipliers[:, 0] > 0
    assert (force.components[1] > 0).tolist() == rests.tolist()
    assert np.isfinite(force.components[1]).all()
    assert rests.any()
    (velocity,) = (v for v in ball.vectors if v.name == "v")
    assert np.isfinite(velocity.components[1]).all()


def test_a_force_between_two_bodies_flashes_in_their_middle() -> None:
    cradle = contact_scene("newtons_cradle")
    assert [flashes.name for flashes in cradle.flashes] == ["hit[2]", "hit[3]"]
    # balls of 0.1 m: the first one, from -0.5 m at 1 m/s, meets the second at 0.1 m
    for flashes, x in zip(cradle.flashes, (0.05, 0.15), strict=True):
        assert flashes.times.tolist() == pytest.approx([0.5])
        assert flashes.at[0].tolist() == pytest.approx([x])
        assert flashes.strengths.tolist() == [1.0]


def test_a_run_without_contacts_has_none() -> None:
    plain = contact_scene("slider_crank")
    assert plain.flashes == ()
    assert with_contacts(plain, None, ()) is plain


def test_the_film_shows_rings_that_fade() -> None:
    ball = contact_scene("bouncing_ball")
    quiet = SceneDrawing(replace(ball, flashes=()), 320, 240)
    drawing = SceneDrawing(ball, 320, 240)
    first = float(ball.flashes[0].times[0])

    def painted(time: float) -> int:
        both = drawing.frame(time).astype(int), quiet.frame(time).astype(int)
        return int(np.abs(both[0] - both[1]).sum())

    assert painted(first - 1e-3) == 0
    assert painted(first + 0.1 * LIFE * 5) > painted(first + 0.9 * LIFE * 5) > 0
    assert painted(first + 1.1 * LIFE * 5) == 0


# masses, pins, and arrows beside lines


@pytest.mark.parametrize(
    ("name", "masses", "pins"),
    [
        # C and C_2 are the same joint on two bars
        ("four_bar", {"M"}, {"O", "A", "C", "D"}),
        ("slider_crank", {"A", "B"}, {"O"}),
        ("chain", {f"P[{i}]" for i in range(1, 21)}, {"P[0]"}),
        ("atwood", {"W_1", "W_2"}, {"C"}),  # no pins at the ends of ropes
        ("bouncing_ball", set(), set()),
        ("heavy_top", set(), {"O"}),
    ],
)
def test_dots_are_masses_and_rings_are_pins(name: str, masses: set[str], pins: set[str]) -> None:
    scene = drawn(RunFile(short(name)))
    assert set(scene.masses) == masses
    assert set(scene.pins) == pins
    assert set(joints(scene)) == masses | pins


def test_a_force_along_a_rod_is_drawn_beside_it() -> None:
    scene = drawn(RunFile(short("pendulum_cartesian")))
    drawing = SceneDrawing(scene, 420, 420)
    moment = Moment(scene, drawing.camera, drawing.raster, float(scene.time[10]), 1.0)
    o, p = moment.places["O"][:2], moment.places["P"][:2]
    across = np.array([o[1] - p[1], p[0] - o[0]]) / np.linalg.norm(p - o)
    for vector in scene.vectors:
        ends = vector_ends(moment, vector)[:, :2]
        away = (ends - p) @ across
        if vector.quantity == "velocity":  # from P
            np.testing.assert_allclose(ends[0], p)
        else:  # parallel to the rod
            np.testing.assert_allclose(np.abs(away), 8.0 * drawing.raster.unit, atol=1e-6)


def test_everything_is_within_reach() -> None:
    scene = drawn(RunFile(short("rolling_disk")))
    x, y = (sum(pair) / 2 for pair in scene.bounds[:2])
    away = [np.hypot(p[0] - x, p[1] - y).max() for p in scene.points.values()]
    half = np.hypot(*(np.ptp(pair) / 2 for pair in scene.bounds[:2]))
    assert max(away) < scene.reach < 1.5 * half
