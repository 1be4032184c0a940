"""The player and its canvas, in a real browser without a network."""

import re

import numpy as np
import pytest

from lagcli.pictures.animation.animate import animate
from lagcli.pictures.page import PLAYER_SCRIPTS, PLAYER_STYLES, asset, page, script_data
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.camera import OrbitCamera, PlaneCamera
from lagcli.pictures.scene.drawing import Moment, SceneDrawing, vector_ends
from lagcli.pictures.scene.view_evaluator import scene_of
from lagcli.pictures.style import ROLES

PICTURE = "player.stage.canvas.toDataURL()"


@pytest.fixture(scope="session")
def pages(result, tmp_path_factory):
    """Return the page of a shipped model, made once."""
    folder = tmp_path_factory.mktemp("pages")

    def of(name, **options):
        path = folder / f"{name}{''.join(f'-{k}{v}' for k, v in options.items())}.html"
        if not path.exists():
            animate(result(name), path, **options)
        return path

    return of


@pytest.fixture
def slider_crank(pages, visit):
    """The slider-crank's page, at rest at its beginning."""
    opened = visit(pages("slider_crank"))
    opened.evaluate("player.pause(); player.setTime(0)")
    return opened


@pytest.fixture
def stepped(pages, visit):
    """The slider-crank's page, which plays by the frames that a test requests."""
    return visit(pages("slider_crank"), stepped=True)


def picture(opened):
    """Return the canvas as a reader sees it, once the page has its final sizes."""
    settled = "shown(() => shown(() => done({})))"
    settled = f"const shown = window.shownFrame ?? requestAnimationFrame; {settled}"
    return opened.evaluate(f"new Promise((done) => {{ {settled.format(PICTURE)} }})")


def time(opened):
    return opened.evaluate("player.time")


def test_plays_by_itself(pages, visit, until):
    opened = visit(pages("slider_crank"))
    first = picture(opened)
    until(opened, "player.time > 0.2")
    assert picture(opened) != first


def test_plays_in_real_time_and_pauses(stepped, step):
    first = picture(stepped)
    step(stepped, 0.5)
    assert time(stepped) == pytest.approx(0.5)
    assert picture(stepped) != first
    # frames longer than a tenth of a second, after which the reader was elsewhere, are cut
    step(stepped, 2, length=2)
    assert time(stepped) == pytest.approx(0.6)
    stepped.get_by_role("button", name="Pause").click()
    still = picture(stepped)
    step(stepped, 0.5)
    assert picture(stepped) == still
    stepped.get_by_role("button", name="Play", exact=True).click()
    step(stepped, 0.25)
    assert time(stepped) == pytest.approx(0.85)
    assert picture(stepped) != still


def test_does_not_move_by_itself_for_readers_who_prefer_that(pages, visit, step):
    opened = visit(pages("slider_crank"), reduced_motion="reduce", stepped=True)
    step(opened, 0.5)
    assert time(opened) == 0
    opened.get_by_role("button", name="Play", exact=True).click()
    step(opened, 0.5)
    assert time(opened) == pytest.approx(0.5)


def test_scrubbing_moves_the_mechanism(slider_crank):
    first = picture(slider_crank)
    line = slider_crank.get_by_role("slider", name="Time")
    box = line.bounding_box()
    line.click(position={"x": 0.75 * box["width"], "y": box["height"] / 2})
    assert time(slider_crank) == pytest.approx(0.75 * 3, abs=0.05)
    assert picture(slider_crank) != first
    shown = slider_crank.locator(".player-time").text_content()
    assert float(shown.removesuffix(" s")) == pytest.approx(time(slider_crank), abs=1e-3)


def test_space_and_arrows_act_on_the_whole_page(slider_crank):
    assert slider_crank.evaluate("document.activeElement.tagName") == "BODY"
    slider_crank.keyboard.press("ArrowRight")
    assert 0 < time(slider_crank) < 0.1
    slider_crank.keyboard.press("ArrowLeft")
    assert time(slider_crank) == 0
    slider_crank.keyboard.press("Space")
    assert slider_crank.evaluate("player.playing")
    slider_crank.keyboard.press("Space")
    assert not slider_crank.evaluate("player.playing")
    # a button keeps its own key: it is pressed once, and nothing else happens
    slider_crank.get_by_role("button", name="Loop").focus()
    slider_crank.keyboard.press("Space")
    assert not slider_crank.evaluate("player.playing")
    assert not slider_crank.evaluate("player.loop")


def test_without_javascript_there_are_a_picture_and_a_sentence(pages, browser, result):
    context = browser.new_context(java_script_enabled=False)
    try:
        opened = context.new_page()
        opened.goto(pages("slider_crank").resolve().as_uri())
        assert opened.locator(".still img").evaluate("x => x.naturalWidth") == 640
        assert "JavaScript" in opened.locator(".still").inner_text()
    finally:
        context.close()


def test_keys(slider_crank, until):
    first = picture(slider_crank)
    slider_crank.locator("canvas").focus()
    press = slider_crank.keyboard.press
    press("ArrowRight")
    assert time(slider_crank) == 0.035  # the sample nearest to a frame, 1/30 s
    second = picture(slider_crank)
    assert second != first
    press("ArrowLeft")
    assert (time(slider_crank), picture(slider_crank)) == (0, first)
    press("End")
    assert time(slider_crank) == 3
    press("Home")
    assert time(slider_crank) == 0
    press("PageUp")
    assert time(slider_crank) == pytest.approx(0.3)
    press("Space")
    until(slider_crank, "player.playing && player.time > 0.4")
    press("Space")
    assert not slider_crank.evaluate("player.playing")
    slider_crank.get_by_label("Speed").focus()
    before = time(slider_crank)
    press("ArrowDown")  # belongs to the list of speeds
    assert time(slider_crank) == before


def test_forces_are_shown_and_hidden(slider_crank):
    slider_crank.evaluate("player.setTime(0.4)")
    first = picture(slider_crank)
    forces = slider_crank.get_by_role("button", name="Forces")
    assert forces.get_attribute("aria-pressed") == "true"
    force = slider_crank.get_by_role("listitem").filter(has_text="guide")
    assert re.fullmatch(r"guide [\d.]+ N", force.text_content())
    forces.click()
    without = picture(slider_crank)
    assert without != first
    assert forces.get_attribute("aria-pressed") == "false"
    assert not force.is_visible()
    slider_crank.get_by_role("button", name="Velocities").click()
    assert picture(slider_crank) not in (first, without)
    slider_crank.get_by_role("button", name="Velocities").click()
    slider_crank.keyboard.press("f")
    assert picture(slider_crank) == first


def test_forces_are_hidden_at_first_where_wanted(pages, visit):
    opened = visit(pages("slider_crank", forces=False))
    forces = opened.get_by_role("button", name="Forces")
    assert forces.get_attribute("aria-pressed") == "false"


def test_magnitudes_are_those_of_the_run(slider_crank, result):
    scene = scene_of(RunFile(result("slider_crank")))
    sample = 137
    slider_crank.evaluate(f"player.setTime({scene.time[sample]})")
    shown = slider_crank.evaluate("player.stage.vectors()")
    assert [v["name"] for v in shown] == [v.name for v in scene.vectors]
    for found, vector in zip(shown, scene.vectors, strict=True):
        components = [x[sample if len(x) > 1 else 0] for x in vector.components]
        assert found["value"] == pytest.approx(np.hypot(*components), rel=1e-7)


def test_without_loop_it_stops_at_the_end_and_starts_again(stepped, step):
    stepped.get_by_role("button", name="Loop").click()
    stepped.evaluate("player.setTime(2.75)")
    step(stepped, 0.5)
    assert time(stepped) == 3
    assert not stepped.evaluate("player.playing")
    stepped.get_by_role("button", name="Play", exact=True).click()
    step(stepped, 0.5)
    assert time(stepped) == pytest.approx(0.5)


def test_with_loop_it_begins_again(stepped, step):
    stepped.evaluate("player.setTime(2.75)")
    step(stepped, 0.5)
    assert time(stepped) == pytest.approx(0.25)


def test_speed(stepped, step):
    stepped.get_by_label("Speed").select_option("× 1/10")
    step(stepped, 0.5)
    assert time(stepped) == pytest.approx(0.05)


def test_words_for_those_who_cannot_see_it(slider_crank):
    assert slider_crank.get_by_role("group", name="Player: Slider-crank").count() == 1
    canvas = slider_crank.get_by_role("img", name="Animation of Slider-crank")
    assert "O, A, B" in canvas.get_attribute("aria-label")
    line = slider_crank.get_by_role("slider", name="Time")
    line.focus()
    slider_crank.keyboard.press("End")
    assert line.get_attribute("aria-valuetext") == "3.000 s of 3.000 s"
    assert slider_crank.get_by_role("status").text_content() == "3.000 s of 3.000 s"
    assert slider_crank.get_by_label("Speed").count() == 1


def test_the_time_is_linked_both_ways(slider_crank):
    slider_crank.evaluate("window.reported = []; player.onTime = (t) => reported.push(t); 0")
    slider_crank.evaluate("player.setTime(1.25)")
    assert slider_crank.evaluate("reported") == []
    slider_crank.locator("canvas").focus()
    slider_crank.keyboard.press("Home")
    assert slider_crank.evaluate("reported") == [0]


def test_another_scene_takes_the_place_of_one(slider_crank):
    slider_crank.evaluate("player.setTime(1)")
    first = picture(slider_crank)
    longer = """player.setScene({...data, time: data.time.map((t) => 2 * t),
        shapes: data.shapes.filter((shape) => shape.kind !== "vector")})"""
    slider_crank.evaluate(longer)
    assert time(slider_crank) == 1
    assert slider_crank.evaluate("player.end") == 6
    assert picture(slider_crank) != first
    assert not slider_crank.get_by_role("button", name="Forces").is_visible()


def test_dragging_turns_a_scene_of_three_dimensions(pages, visit):
    opened = visit(pages("rolling_disk"))
    opened.evaluate("player.pause(); player.setTime(1)")
    first = picture(opened)
    box = opened.locator("canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    opened.mouse.move(x, y)
    opened.mouse.down()
    opened.mouse.move(x + 80, y + 30)
    opened.mouse.up()
    turned = picture(opened)
    assert turned != first
    opened.mouse.move(x, y)
    assert picture(opened) == turned
    opened.get_by_role("button", name="Reset view").click()
    assert picture(opened) == first
    opened.locator("canvas").focus()
    opened.keyboard.press("Shift+ArrowLeft")
    assert picture(opened) != first
    assert time(opened) == 1
    opened.keyboard.press("Shift+ArrowRight")
    assert opened.evaluate("player.stage.camera.azimuth") == pytest.approx(-np.pi / 3)


def test_a_finger_turns_it_too(pages, visit, until):
    opened = visit(pages("rolling_disk"), has_touch=True)
    opened.evaluate("player.pause(); player.setTime(1)")
    first = picture(opened)
    box = opened.locator("canvas").bounding_box()
    touch = opened.context.new_cdp_session(opened)
    for kind, shift in (
        ("touchStart", 0),
        ("touchMove", 40),
        ("touchMove", 80),
        ("touchEnd", None),
    ):
        points = [{"x": box["x"] + 200 + shift, "y": box["y"] + 100}] if shift is not None else []
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    until(opened, f"{PICTURE} !== {first!r}")


def test_a_plane_scene_does_not_turn(slider_crank):
    first = picture(slider_crank)
    box = slider_crank.locator("canvas").bounding_box()
    slider_crank.mouse.move(box["x"] + 200, box["y"] + 100)
    slider_crank.mouse.down()
    slider_crank.mouse.move(box["x"] + 260, box["y"] + 140)
    slider_crank.mouse.up()
    assert picture(slider_crank) == first
    assert not slider_crank.get_by_role("button", name="Reset view").is_visible()


def test_sharp_on_dense_screens_and_drawn_again_in_another_size(pages, visit, until):
    opened = visit(pages("slider_crank"), device_scale_factor=2)
    opened.evaluate("player.pause()")
    wide = "[player.stage.canvas.width, player.stage.canvas.clientWidth]"
    drawn, shown = opened.evaluate(wide)
    assert drawn == 2 * shown
    opened.set_viewport_size({"width": 420, "height": 640})
    until(opened, f"player.stage.canvas.width < {drawn}")
    drawn, shown = opened.evaluate(wide)
    assert drawn == 2 * shown
    assert opened.evaluate("document.documentElement.scrollWidth") <= 420


def test_dark_pages_have_light_lines(pages, visit, until):
    opened = visit(pages("slider_crank"), color_scheme="light")
    opened.evaluate("player.pause()")
    assert opened.evaluate("player.stage.colors.rod") == "#404040"
    light = picture(opened)
    opened.emulate_media(color_scheme="dark")
    until(opened, f"{PICTURE} !== {light!r}")
    assert opened.evaluate("player.stage.colors.rod") != "#404040"


def test_colours_are_those_of_all_pictures(slider_crank):
    assert slider_crank.evaluate("Scene.COLORS.light") == ROLES
    assert slider_crank.evaluate("Object.keys(Scene.COLORS.dark)") == list(ROLES)


@pytest.mark.parametrize("name", ["slider_crank", "heavy_top", "pendulum_cartesian"])
def test_films_and_pages_put_points_in_the_same_places(name, pages, visit, result):
    """Two programs draw: in Python for films, in JavaScript for pages."""
    opened = visit(pages(name))
    opened.evaluate("player.pause(); player.setTime(0.4321)")
    width, height, places = opened.evaluate(
        """[player.stage.width, player.stage.height,
            Object.fromEntries(Object.keys(data.points).map((name) =>
              [name, player.stage.camera.project(player.stage.motion.point(name))]))]"""
    )
    scene = scene_of(RunFile(result(name)))
    drawing = SceneDrawing(scene, width, height)
    drawing.camera = (
        PlaneCamera(scene.bounds, width, height, 26)
        if scene.dimension == 2
        else OrbitCamera(scene.bounds, scene.reach, width, height)
    )
    ends = opened.evaluate(
        """data.shapes.filter(({ kind }) => kind === "vector").map((x) => player.stage.ends(x))"""
    )
    drawing.raster.unit = opened.evaluate(
        "Math.max(0.6, Math.min(1.6, Math.min(player.stage.width, player.stage.height) / 420))"
    )
    moment = Moment(scene, drawing.camera, drawing.raster, 0.4321, 1.0)
    assert len(ends) == len(scene.vectors) > 0
    for vector, (foot, tip) in zip(scene.vectors, ends, strict=True):
        expected = vector_ends(moment, vector)
        seen = [[right, height - down] for right, down, _ in (foot, tip)]
        np.testing.assert_allclose(seen, expected[:, :2], atol=1e-2)
    for point, (right, down, depth) in places.items():
        series = scene.points[point]
        at = [np.interp(0.4321, scene.time, np.broadcast_to(x, len(scene.time))) for x in series]
        expected = drawing.camera.project(np.array(at))
        assert [right, height - down] == pytest.approx(expected[:2].tolist(), abs=1e-2)
        assert depth == pytest.approx(expected[2], abs=1e-4)


def test_what_is_not_finite_is_not_drawn(visit, tmp_path):
    nan = float("nan")
    data = {
        "dimension": 2,
        "bounds": [[-1, 1], [-1, 1]],
        "time": [0.0, 1.0, 2.0],
        "points": {"O": [[0], [0]], "A": [[0.5, nan, 0.5], [0.5]], "C": [[-0.5], [nan]]},
        "shapes": [
            {"kind": "rod", "name": "r", "from": "O", "to": "A"},
            {"kind": "spring", "name": "s", "from": "O", "to": "A"},
            {"kind": "guide", "name": "g", "from": "O", "to": "A"},
            {"kind": "disc", "name": "d", "center": "C", "radius": [1], "angle": [0]},
            {"kind": "ground", "at": "C"},
            {"kind": "trail", "of": "A"},
            {"kind": "label", "at": "C", "text": "C"},
            {"kind": "vector", "name": "v", "quantity": "vector", "at": "A", "unit": "",
             "components": [[1], [nan]], "scale": 1},
        ],
    }  # fmt: skip
    start = f"""const player = new Player(document.querySelector("div"), {script_data(data)})"""
    path = tmp_path / "page.html"
    text = page(
        "</title><script>console.log('title')</script>",
        '<div id="player"></div>',
        styles=[*map(asset, PLAYER_STYLES), "#player { height: 400px }"],
        scripts=[asset(name) for name in PLAYER_SCRIPTS],
        start=start,
    )
    path.write_text(text)
    opened = visit(path)
    there = picture(opened)
    opened.evaluate("player.setTime(1)")
    assert picture(opened) != there
    opened.evaluate("player.setTime(2)")
    assert opened.locator(".player-vectors li").text_content() == "v –"


def test_text_of_a_model_is_text_and_nothing_else(visit, tmp_path):
    import lagcli

    evil = "</script><script>console.log('run')</script><img src=x onerror=console.log(1)> & <b>"
    text = f"""
name: free
description: "{evil}"
coordinates: [x]
T: x'^2/2
V: 0
initial: {{x: 0, x': 1}}
view:
  points: {{P: [x, 0], O: [0, 0]}}
  rods: [O-P]
  labels: {{P: "{evil}"}}
"""
    path = tmp_path / "evil.h5"
    lagcli.write(lagcli.simulate(lagcli.load_text(text), t_end=1, samples=11), path)
    animate(path, tmp_path / "evil.html")
    opened = visit(tmp_path / "evil.html")
    assert evil in opened.locator("p").first.text_content()
