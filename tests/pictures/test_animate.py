"""Animations: their times, films, pages, and the command."""

import base64
import hashlib
import re
import shutil
import warnings
from base64 import b64decode
from dataclasses import replace
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from shipped import every_model

import lagcli
from lagcli.cli.app import run as lagcli_run
from lagcli.errors import FileError, UsageError
from lagcli.pictures.animation.animate import animate
from lagcli.pictures.animation.film import check_film
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.drawing import SceneDrawing, round_number, three_digits
from lagcli.pictures.scene.timing import Timing, timing, usual_speed
from lagcli.pictures.scene.view_evaluator import scene_of
from lagcli.pictures.style import PALETTE

# times


@pytest.mark.parametrize(
    ("span", "speed"),
    [
        (1.0, 1),
        (3.0, 1),
        (60.0, 1),
        (0.5, 0.1),
        (0.03, 0.005),
        (0.999, 0.2),
        (61.0, 2),
        (1e4, 200),
        (3e-9, 5e-10),
        (0.0, 1),
    ],
)
def test_usual_speed_is_real_time_where_that_can_be_seen(span, speed):
    assert usual_speed(span) == speed
    if span:
        assert 1 <= span / speed <= 60


def test_frames_are_evenly_spaced_and_have_both_ends():
    times = Timing(1.0, 3.0, 1.0).frames(25)
    assert len(times) == 51
    assert (times[0], times[-1]) == (1.0, 3.0)
    assert np.diff(times) == pytest.approx(0.04)
    slow = Timing(0.0, 0.5, 0.1).frames(10)
    assert np.diff(slow) == pytest.approx(0.01)
    assert len(slow) == 51


def test_the_last_frame_is_the_end_where_frames_do_not_meet_it():
    times = Timing(0.0, 1.01, 1.0).frames(10)
    assert times[-2:] == pytest.approx([1.0, 1.01])
    assert Timing(2.0, 2.0, 1.0).frames(25).tolist() == [2.0]


def test_part_and_pace_of_a_motion():
    assert timing(0, 10, start=2, end=4) == Timing(2, 4, 1)
    assert timing(0, 10, start=-1, end=99) == Timing(0, 10, 1)
    assert timing(0, 10, duration=5) == Timing(0, 10, 2)
    assert timing(0, 10, speed=0.25).pace == "slowed down × 4"
    assert timing(0, 10, speed=3).pace == "sped up × 3"
    assert timing(0, 10).pace == ""
    assert timing(5, 5) == Timing(5, 5, 1)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start": 11}, "there is no motion from 11 to 10 s; the run goes from 0 to 10 s"),
        ({"start": 3, "end": 3}, "no motion from 3 to 3 s"),
        ({"end": -1}, "no motion from 0 to -1 s"),
        ({"speed": 0}, "--speed must be greater than 0, not 0"),
        ({"speed": float("inf")}, "--speed must be greater than 0, not inf"),
        ({"duration": -2}, "--duration must be greater than 0, not -2"),
        ({"start": float("nan")}, "--from must be a time in seconds, not nan"),
        ({"speed": 1, "duration": 1}, "contradict each other"),
    ],
)
def test_wishes_that_make_no_sense(options, message):
    with pytest.raises(UsageError, match=message):
        timing(0, 10, **options)


def test_endless_films_are_rejected():
    with pytest.raises(UsageError, match="higher --speed"):
        Timing(0, 10, 1e-6).frames(25)


def test_round_numbers():
    assert [round_number(x) for x in (0.034, 0.99, 1, 1.9, 2, 7, 12)] == pytest.approx(
        [0.02, 0.5, 1, 1, 2, 5, 10]
    )


# drawings


def test_magnitudes_have_three_digits():
    values = (826.3, 1234.5, 0.01234, 7.0, 2e6, 0.0)
    shown = ["826", "1230", "0.0123", "7.00", "2.00e+06", "0"]
    assert [three_digits(x) for x in values] == shown


def test_the_mechanism_is_where_its_coordinates_say(result):
    path = result("pendulum_cartesian")
    trajectory = lagcli.read(path)
    scene = replace(scene_of(RunFile(path)), vectors=())  # arrows would cover the bob
    drawing = SceneDrawing(scene, 400, 400)
    for sample in (0, 300, 999):
        x, y = trajectory.q[sample]
        image = drawing.frame(trajectory.time[sample])
        right, up, _ = drawing.camera.project(np.array([x, y]))
        assert image.shape == (400, 400, 3)
        bob = image[round(400 - up) - 1, round(right)]
        assert bob.tolist() == [0x20, 0x20, 0x20]
        middle = image[round(400 - (up + drawing.camera.project(np.zeros(2))[1]) / 2) - 1]
        assert (middle < 0x60).any()  # the rod crosses this line
    lengths = [drawing.camera.project(np.array(p))[:2] for p in ([0, 0], [1, 0], [0, 1])]
    across, upward = (np.linalg.norm(p - lengths[0]) for p in lengths[1:])
    assert across == pytest.approx(upward)


def test_between_samples_it_moves(result):
    scene = scene_of(RunFile(result("slider_crank")))
    drawing = SceneDrawing(scene, 320, 240)
    first, between, second = (drawing.frame(t) for t in (0.1, 0.1025, 0.105))
    assert (first != between).any()
    assert (between != second).any()


def test_forces_can_be_left_out(result):
    scene = scene_of(RunFile(result("slider_crank")))
    orange = (0xD5, 0x5E, 0x00)

    def has_orange(image):
        return bool((image == orange).all(axis=2).any())

    assert has_orange(SceneDrawing(scene, 320, 240).frame(0.4))
    assert not has_orange(SceneDrawing(scene, 320, 240, forces=False).frame(0.4))


# films


def test_gif_plays_in_real_time_and_repeats(result, tmp_path):
    out = tmp_path / "run.gif"
    made = animate(result("slider_crank"), out, size=(200, 160), fps=30)
    with Image.open(out) as film:
        assert film.size == (200, 160)
        assert film.info["loop"] == 0
        seconds, pictures = 0.0, []
        for frame in range(film.n_frames):
            film.seek(frame)
            seconds += film.info["duration"] / 1000
            pictures.append(np.asarray(film.convert("RGB")))
    # hundredths of a second, but 30 frames are a second
    assert made.frames == len(pictures) == 91
    assert seconds == pytest.approx(91 / 30, abs=0.011)
    moving = [(a != b).any() for a, b in pairwise(pictures)]
    assert all(moving)


def test_gif_shows_the_requested_part_at_the_requested_speed(result, tmp_path):
    path = result("slider_crank")
    made = animate(path, tmp_path / "a.gif", start=1, end=2, speed=2, fps=20, size=(64, 64))
    assert (made.start, made.end, made.speed, made.frames) == (1, 2, 2, 11)
    made = animate(path, tmp_path / "b.gif", duration=0.5, fps=20, size=(64, 64))
    assert (made.speed, made.frames) == (6, 11)


def test_mp4(result, tmp_path, probe):
    made = animate(result("slider_crank"), tmp_path / "run.mp4", size=(200, 160), end=1, fps=20)
    found = probe(made.output)
    assert (found["width"], found["height"]) == ("200", "160")
    assert (found["codec_name"], found["pix_fmt"]) == ("h264", "yuv420p")
    assert int(found["nb_read_frames"]) == made.frames == 21
    assert float(found["duration"]) == pytest.approx(21 / 20, abs=0.01)


def test_without_ffmpeg_the_package_is_named(result, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UsageError, match="apt install ffmpeg"):
        animate(result("atwood"), tmp_path / "run.mp4")
    assert not list(tmp_path.iterdir())


def test_a_failing_ffmpeg_is_an_error_and_leaves_no_file(result, tmp_path, monkeypatch):
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\necho 'Unknown encoder libx264' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(FileError, match="Unknown encoder libx264"):
        animate(result("atwood"), tmp_path / "run.mp4")
    assert [p.name for p in tmp_path.iterdir()] == ["ffmpeg"]


@pytest.mark.parametrize(
    ("suffix", "frames", "size", "fps", "message"),
    [
        (".gif", 10, (640, 480), 60, "no more than 50 frames per second"),
        (".gif", 10_000, (640, 480), 25, "too large to be made"),
        (".mp4", 10, (641, 480), 25, "even numbers of pixels.*--size 642x480"),
    ],
)
def test_films_that_cannot_be_made(suffix, frames, size, fps, message):
    with pytest.raises(UsageError, match=message):
        check_film(suffix, frames, size, fps)


FFMPEG = pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")


@pytest.mark.parametrize("suffix", ["gif", pytest.param("mp4", marks=FFMPEG)])
def test_an_interrupted_film_leaves_no_file(suffix, result, tmp_path):
    from contextlib import contextmanager

    @contextmanager
    def progress(start, end):
        def reached(time):
            if time > start + 0.3 * (end - start):
                raise KeyboardInterrupt

        yield reached

    with pytest.raises(KeyboardInterrupt):
        animate(result("atwood"), tmp_path / f"run.{suffix}", size=(64, 64), progress=progress)
    assert not list(tmp_path.iterdir())


# every shipped model


def painted(opened):
    """Return how many pixels of the canvas are not blank."""
    text = opened.evaluate("player.stage.canvas.toDataURL()").partition(",")[2]
    with Image.open(BytesIO(b64decode(text))) as picture:
        return int((np.asarray(picture)[:, :, 3] > 0).sum())


@pytest.mark.parametrize("name", every_model())
def test_every_shipped_model_is_animated_without_a_warning(name, result, tmp_path, visit):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        film = animate(result(name), tmp_path / "run.gif", size=(160, 120), duration=0.3, fps=10)
        page = animate(result(name), tmp_path / "run.html")
    assert film.frames == 4
    assert page.frames >= 100
    with Image.open(film.output) as frames:
        colors = frames.convert("RGB").getcolors(100_000)
    assert len(colors) > 5
    opened = visit(page.output)
    opened.evaluate("player.pause(); player.setTime(player.end / 2)")
    with_shapes = painted(opened)
    opened.evaluate("player.setScene({...data, shapes: []})")
    assert with_shapes > painted(opened) + 200


def test_impacts_flash_on_the_page(result, tmp_path, visit):
    page = animate(result("bouncing_ball"), tmp_path / "run.html")
    opened = visit(page.output)
    (flashes,) = opened.evaluate("data.shapes.filter(({ kind }) => kind === 'flash')")
    first, life = flashes["times"][0], flashes["life"]

    def shown(time):
        opened.evaluate(f"player.pause(); player.setTime({time})")
        with_flash = painted(opened)
        quiet = "player.setScene({...data, shapes: data.shapes.filter((s) => s.kind !== 'flash')})"
        opened.evaluate(f"{quiet}; player.setTime({time})")
        without = painted(opened)
        opened.evaluate("player.setScene(data)")
        return with_flash - without

    assert shown(first - 0.01) == 0
    assert shown(first + 0.3 * life) > 50
    assert shown(first + 1.1 * life) == 0


def test_a_run_in_memory_is_animated(tmp_path):
    model = lagcli.load(Path(__file__).parents[2] / "models" / "atwood.yaml")
    made = lagcli.animate(lagcli.simulate(model), tmp_path / "run.html")
    assert made.frames == 101


def test_one_sample_is_shown_without_a_trail(tmp_path):
    model = lagcli.load(Path(__file__).parents[2] / "models" / "double_pendulum_cartesian.yaml")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = lagcli.animate(lagcli.simulate(model, samples=1), tmp_path / "run.html")
    assert made.frames == 1


@pytest.mark.parametrize("times", [(1.0, 1.0, 1.0), (0.0, 1e300, 2e300)])
def test_times_that_a_damaged_file_may_have_are_drawn(times, tmp_path):
    model = lagcli.load(Path(__file__).parents[2] / "models" / "slider_crank.yaml")
    run = lagcli.simulate(model, samples=3)
    forces = np.full_like(run.multipliers, 1e200)
    damaged = replace(run, time=np.array(times), multipliers=forces)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lagcli.report(damaged, tmp_path / "run.html")


def test_the_page_runs_its_own_script_alone(result, tmp_path):
    lagcli.animate(result("atwood"), tmp_path / "run.html")
    text = (tmp_path / "run.html").read_text(encoding="utf-8")
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)[1]
    for kind, element in (("script", "script"), ("style", "style")):
        (content,) = re.findall(rf"<{element}>(.*?)</{element}>", text, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        assert f"{kind}-src 'sha256-{digest}'" in policy
    assert policy.startswith("default-src 'none'; ")
    assert "unsafe" not in policy
    assert "base-uri 'none'; form-action 'none'" in policy


def test_trails_are_what_can_be_followed():
    assert Timing(0, 3, 1).trail == pytest.approx(0.9)
    assert Timing(0, 60, 1).trail == 3
    assert Timing(0, 1000, 20).trail == 60


# the command


def test_the_command_says_what_it_made(result, tmp_path, capsys):
    out = tmp_path / "run.html"
    assert lagcli_run(["animate", str(result("andrews_squeezer")), "-o", str(out)]) == 0
    said = capsys.readouterr()
    assert said.out.startswith(f"{out}: t = 0 to 0.03 s, slowed down × 200, 301 samples, ")
    assert said.err == ""
    assert lagcli_run(["animate", str(result("andrews_squeezer")), "-o", str(out)]) == 4
    assert "--force" in capsys.readouterr().err
    again = ["animate", str(result("andrews_squeezer")), "-o", str(out), "--force", "-q"]
    assert lagcli_run(again) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["-o", "run.avi"], 2, "run.avi: the suffix .avi is not an animation format"),
        (["-o", "run"], 2, "use run.html"),
        (["-o", "run.gif", "--size", "wide"], 2, "--size 'wide' is not a size"),
        (["-o", "run.gif", "--size", "٤٠٠x٣٠٠"], 2, "is not a size"),
        (["-o", "run.gif", "--size", "10x10"], 2, "between 64 and 8192 pixels, not 10"),
        (["-o", "run.gif", "--fps", "0"], 2, "--fps must lie between 0 and 1000, not 0"),
        (["-o", "run.html", "--fps", "30"], 2, "--fps is for films"),
        (["-o", "run.html", "--size", "64x64"], 2, "--size is for films"),
        (["-o", "run.gif", "--from", "9"], 2, "the run goes from 0 to 1 s"),
        (["-o", "no/run.gif"], 4, "mkdir -p no"),
    ],
)
def test_wrong_calls(arguments, status, message, result, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert lagcli_run(["animate", str(result("atwood")), *arguments]) == status
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_run_that_failed_is_shown_as_far_as_it_came(tmp_path, visit, capsys):
    model = lagcli.load(Path(__file__).parents[2] / "models" / "slider_crank.yaml")
    failed = lagcli.simulate(model, max_steps=40)
    assert failed.status == "failed"
    lagcli.write(failed, tmp_path / "run.h5")
    out = tmp_path / "run.html"
    assert lagcli_run(["animate", str(tmp_path / "run.h5"), "-o", str(out)]) == 0
    last = f"{failed.time[-1]:.6g}"
    assert f"note: the run failed at t = {last} s" in capsys.readouterr().err
    opened = visit(out)
    assert f"The run failed at t = {last} s" in opened.get_by_role("note").text_content()
    assert opened.evaluate("player.end") == pytest.approx(failed.time[-1])


def test_a_page_holds_as_many_samples_as_it_needs(result, tmp_path):
    long = animate(result("pendulum_cartesian", t_end=100, samples=20001), tmp_path / "a.html")
    assert long.speed == 2
    assert long.frames == 3000  # 50 s at 60 per second
    assert (tmp_path / "a.html").stat().st_size < 400_000


# models without a view

WITHOUT_VIEW = """
name: two_springs
coordinates: {s: {unit: m}, theta: {unit: rad}}
T: s'^2/2 + theta'^2/20
V: 10*s^2 + 3/2*theta^2
initial: {s: 0.1, s': 0, theta: 1, theta': 0}
simulation: {t_end: 5, samples: 501}
"""


@pytest.fixture(scope="session")
def without_view(tmp_path_factory):
    """Results of a model without a view: with the model, and without."""
    folder = tmp_path_factory.mktemp("plain")
    trajectory = lagcli.simulate(lagcli.load_text(WITHOUT_VIEW))
    for name in ("run.h5", "run.csv"):
        lagcli.write(trajectory, folder / name)
    return folder


@pytest.mark.parametrize(
    ("name", "note"),
    [
        ("run.h5", "its model has no view, and no point is recognized; coordinates are drawn"),
        ("run.csv", "the result contains no model, and therefore no view; coordinates are drawn"),
    ],
)
def test_without_a_view_coordinates_are_played(name, note, without_view, tmp_path, visit):
    made = animate(without_view / name, tmp_path / "run.html")
    assert note in made.notes[0]
    opened = visit(tmp_path / "run.html")
    opened.evaluate("player.pause(); player.setTime(0)")
    assert opened.get_by_role("group", name="Coordinates over time").count() == 1
    cursor = opened.locator(".u-cursor-x").first
    first = cursor.bounding_box()["x"]
    opened.get_by_role("slider", name="Time").focus()
    opened.keyboard.press("PageUp")
    plot = opened.locator(".u-over").first.bounding_box()
    assert cursor.bounding_box()["x"] - first == pytest.approx(0.1 * plot["width"], abs=2)
    opened.mouse.click(plot["x"] + 0.5 * plot["width"], plot["y"] + 20)
    assert opened.evaluate("player.time") == pytest.approx(2.5, abs=0.05)
    x = opened.locator("[data-series=s] .plot-value").text_content()
    assert float(x.replace("−", "-")) == pytest.approx(0.1 * np.cos(np.sqrt(20) * 2.5), abs=2e-3)


def test_without_a_view_films_show_coordinates(without_view, tmp_path):
    made = animate(without_view / "run.h5", tmp_path / "a.gif", duration=0.4, fps=10)
    frames = []
    with Image.open(made.output) as film:
        for frame in range(film.n_frames):
            film.seek(frame)
            frames.append(np.asarray(film.convert("RGB")).astype(int))
    assert len(frames) == 5
    # a curve, in the first colour of the palette, runs through the whole picture
    color = [int(PALETTE[0][k : k + 2], 16) for k in (1, 3, 5)]
    columns = (np.abs(frames[0] - color).max(axis=2) < 8).any(axis=0)
    assert columns[100:600].mean() > 0.95
    # the mark is a line from top to bottom that goes on by the same way in each frame
    marks = [np.argmin(f[60:200].sum(axis=2).mean(axis=0)[80:625]) + 80 for f in frames[1:4]]
    steps = np.diff(marks)
    assert (steps > 80).all()
    assert steps == pytest.approx([steps[0]] * 2, abs=2)


def test_a_model_is_no_result(tmp_path, capsys):
    model = str(Path(__file__).parents[2] / "models" / "atwood.yaml")
    assert lagcli_run(["animate", model, "-o", str(tmp_path / "run.gif")]) == 2
    assert f"{model} is a model file, not a result" in capsys.readouterr().err
