"""An exported page in a real browser, opened from a file without a network."""

from __future__ import annotations

import re
from html import escape
from pathlib import Path

import numpy as np
import pytest
from page_checks import AXES, CONTRAST, TEXTS
from shipped import every_model

import lagcli
from lagcli.simulations.simulation import simulate

#: An answer has been drawn for the last request.
DRAWN = "page.number > 0 && page.drawn === page.number"


@pytest.fixture(scope="session")
def pages(tmp_path_factory):
    """Return the page of a shipped model, made once."""
    folder = tmp_path_factory.mktemp("pages")

    def of(name, lang="en"):
        path = folder / f"{name}-{lang}.html"
        if not path.exists():
            path.write_text(lagcli.live_page(lagcli.load(name), lang), encoding="utf-8")
        return path

    return of


@pytest.fixture
def opened(visit, until):
    """Open a page, and wait for its first run."""

    def of(path, **options):
        page = visit(path, reduced_motion="reduce", **options)
        until(page, DRAWN)
        return page

    return of


def enter(page, until, name, text):
    field = page.locator(f'.control[data-name="{name}"] input[type=text]')
    field.fill(text)
    field.press("Enter")
    until(page, DRAWN)


def curves(page, group):
    """Return the time and the curves of a plot, by name, as the page has them."""
    plot = page.evaluate(
        """(group) => {
          const { time, series } = page.answer.plots[group];
          const curves = series.map(({ name, values }) => [name, [...values]]);
          return { time: [...time], series: curves };
        }""",
        group,
    )
    return np.array(plot["time"]), {name: np.array(x) for name, x in plot["series"]}


def quantities(run, model):
    """Return what pages draw by group: q, v, and λ of the constraints that have one."""
    names = model.coordinate_names
    found = {
        "coordinates": dict(zip(names, run.q.T, strict=True)),
        "velocities": dict(zip([f"{q}_dot" for q in names], run.v.T, strict=True)),
    }
    if model.constraint_names:
        multipliers = [f"lambda.{name}" for name in model.constraint_names]
        found["multipliers"] = dict(zip(multipliers, run.multipliers.T, strict=True))
    return found


@pytest.mark.parametrize("name", every_model())
def test_the_page_shows_the_motion_of_simulate(name, pages, opened, until):
    path = pages(name)
    assert path.stat().st_size < 1_000_000
    page = opened(path)
    model = lagcli.load(name)
    run = simulate(model)
    instants = np.array([]) if run.events is None else run.events.time
    away = np.array([abs(instants - t).min(initial=1.0) > 1e-9 for t in run.time])
    for group, expected in quantities(run, model).items():
        page.locator(".slot select").first.select_option(group)
        until(page, f"{DRAWN} && {group!r} in page.answer.plots")
        time, found = curves(page, group)
        assert found, group
        scale = max(np.abs(column[away]).max() for column in expected.values())
        for curve, values in found.items():
            # a page has two more samples at each instant: the values before and after it
            same = np.interp(run.time, time, values)
            assert np.abs(same - expected[curve])[away].max() <= 1e-6 * scale, curve
    shown = page.evaluate("(page.answer.events?.entries ?? []).map(({ time }) => time)")
    np.testing.assert_allclose(shown, np.sort(instants)[: len(shown)], rtol=0, atol=1e-8)
    assert bool(len(shown)) == bool(len(instants))
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_a_slider_and_a_field_start_another_run(pages, opened, until):
    page = opened(pages("slider_crank"))
    enter(page, until, "m", "2")
    expected = simulate(lagcli.load("slider_crank", {"m": "2*1"})).multipliers[:, 0]
    _, found = curves(page, "multipliers")
    np.testing.assert_allclose(found["lambda.guide"], expected, rtol=0.0, atol=1e-5)
    assert "--set m=2" in page.locator("#command").inner_text()
    slider = page.locator('.control[data-name="m"] input[type=range]')
    slider.fill("1.5")  # both an input and a change
    until(page, DRAWN)
    assert page.evaluate("page.answer.values.m") == 1.5
    # the run of the change has the model's accuracy, after that of the input
    fine = page.evaluate("page.answer.counts.steps")
    moved = "{ type: 'input', target: { type: 'range' }, timeStamp: 0 }"
    page.evaluate(f"page.controls.changed({moved})")
    until(page, DRAWN)
    assert page.evaluate("page.answer.counts.steps") < 0.7 * fine


@pytest.mark.slow
def test_a_slider_redraws_within_50_ms(pages, opened, until):
    page = opened(pages("slider_crank"))
    slider = page.locator('.control[data-name="m"] input[type=range]')
    for i in range(40):
        slider.fill(str(1 + i / 40))
        until(page, DRAWN)
    delays = page.evaluate("page.delays")
    # the least: other programs of this machine make answers wait
    assert min(delays) < 50.0, delays


def test_a_failed_run_is_marked_and_a_wrong_value_is_named(pages, opened, until):
    page = opened(pages("slider_crank"))
    enter(page, until, "m", "two")
    notice = page.locator("#notice.error")
    assert "m: a value on this page is a number, not two" in notice.inner_text()
    assert "stale" in page.locator("#pictures").get_attribute("class")
    assert page.evaluate(CONTRAST) == []
    enter(page, until, "m", "1")
    assert page.locator("#notice").is_hidden()
    assert "stale" not in (page.locator("#pictures").get_attribute("class") or "")
    enter(page, until, "t_end", "-1")
    assert "t_end: the end is after the start" in notice.inner_text()
    ball = opened(pages("bouncing_ball"))
    enter(ball, until, "y", "-1")
    assert "violated" in ball.locator("#notice.error").inner_text()
    enter(ball, until, "y", "1")
    enter(ball, until, "e", "1.5")
    assert "must be between 0 and 1" in ball.locator("#notice.error").inner_text()


def test_the_link_holds_the_values(pages, opened, until):
    path = pages("slider_crank")
    page = opened(path)
    enter(page, until, "m", "2")
    enter(page, until, "psi", "0.2")
    until(page, "location.hash.includes('psi')")
    link = page.locator("#share input").input_value()
    assert link.endswith("#m=2&psi=0.2")
    page.goto("about:blank")
    page.goto(link)
    until(page, DRAWN)
    assert page.evaluate("[page.answer.values.m, page.answer.values.psi]") == [2, 0.2]
    page.goto("about:blank")
    page.goto(f"{path.as_uri()}#m=1.5&mass=3&phi=~0.1")
    until(page, DRAWN)
    assert page.evaluate("page.answer.values.m") == 1.5
    assert "mass" in page.locator("#unknown").inner_text()
    assert page.evaluate("page.controls.state()") == [
        ["m", {"text": "1.5", "free": False}],
        ["phi", {"text": "0.1", "free": True}],
    ]


def test_values_have_the_units_of_the_file(tmp_path, opened, until):
    """A frequency in rpm and an angle in degrees are given to the core in SI."""
    model = lagcli.load_text(
        "parameters: {m: 2 kg, l: 50 cm, omega: 60 rpm}\n"
        "coordinates: {phi: rad}\n"
        "T: m/2*l^2*phi'^2\n"
        "V: -m*9.81*l*cos(phi)\n"
        "outputs: {rate: omega}\n"
        "initial: {phi: 30 deg, phi': 0}\n"
        "simulation: {t_end: 1}\n"
    )
    target = tmp_path / "page.html"
    target.write_text(lagcli.live_page(model), encoding="utf-8")
    # without a view and without scripts, its curves are shown
    assert '<figure class="still"><img alt="φ over time"' in target.read_text("utf-8")
    page = opened(target)
    enter(page, until, "phi", "60")
    enter(page, until, "omega", "120")
    enter(page, until, "l", "25")
    shown = {"m": 2, "l": 25, "omega": 120, "phi": 60, "phi'": 0}
    assert page.evaluate("page.answer.values") == shown
    page.locator(".slot select").first.select_option("outputs")
    until(page, f"{DRAWN} && 'outputs' in page.answer.plots")
    assert curves(page, "outputs")[1]["rate"][0] == pytest.approx(4 * np.pi, rel=1e-15)
    assert curves(page, "coordinates")[1]["phi"][0] == pytest.approx(np.pi / 3, rel=1e-15)


PRESETS = """\
title: <Swing>
coordinates: {phi: rad}
parameters: {m: 1 kg, l: 30 cm, w: 2 rad/s, k: 2*m, g: 9.81 m/s^2}
T: m/2*l^2*phi'^2
V: -m*g*l*cos(phi) + k*g*l/100*phi^2
initial: {phi: 20 deg, phi': 0 rad/s}
simulation: {t_end: 1, samples: 21}
presets:
  <b>heavy</b> & long: {description: Much <i>heavier</i>., parameters: {m: 5 kg, l: 0.8 m}}
  Time: {initial: {phi: 90 deg, phi': {guess: 2*w}}}
  other spring: {parameters: {k: 3 kg}}
"""


@pytest.fixture(scope="module")
def swing(tmp_path_factory):
    """Return a model with presets, and its page."""
    path = tmp_path_factory.mktemp("presets") / "swing.yaml"
    path.write_text(PRESETS, encoding="utf-8")
    model = lagcli.load(path)
    page = path.with_suffix(".html")
    page.write_text(lagcli.live_page(model, "de"), encoding="utf-8")
    return path, page


def test_presets_are_runs_of_simulate(swing, opened, until):
    path, page = swing
    page = opened(page)
    buttons = page.locator("#presets button")
    names = ["<b>heavy</b> & long", "Time", "other spring"]
    assert buttons.all_inner_texts() == names
    assert page.locator("#presets h2").inner_text() == "Voreinstellungen"
    assert buttons.nth(2).is_disabled()
    assert buttons.nth(2).get_attribute("title") == "Diese Seite kann k nicht setzen"
    for place, name in enumerate(names[:2]):
        buttons.nth(place).click()
        until(page, DRAWN)
        pressed = [x.get_attribute("aria-pressed") for x in buttons.all()]
        assert pressed == [str(i == place).lower() for i in range(3)]
        run = simulate(lagcli.load(path, preset=name))
        found = curves(page, "coordinates")[1]["phi"]
        np.testing.assert_allclose(found, run.q[:, 0], rtol=0, atol=1e-7)
    assert page.evaluate("page.controls.changes().set_initial") == {
        "phi": "90",
        "phi'": "{guess: 4}",
    }
    # another value is no preset any more, and the description belongs to one
    enter(page, until, "l", "40")
    assert page.locator('#presets [aria-pressed="true"]').count() == 0
    buttons.first.click()
    until(page, DRAWN)
    assert page.locator(".preset-description").inner_text() == "Much <i>heavier</i>."
    assert page.evaluate("page.controls.changes()")["set"] == {"m": "5", "l": "80"}


def test_a_link_names_a_preset(swing, opened, until):
    path, file = swing
    page = opened(file)
    page.evaluate("location.hash = '#phi=45&preset=Time&preset=other%20spring'")
    page.locator("#unknown").wait_for()
    until(page, DRAWN)
    assert page.locator("#unknown").inner_text().endswith("preset=other spring")
    assert page.evaluate("page.controls.changes().set_initial") == {
        "phi": "45",
        "phi'": "{guess: 4}",
    }
    until(page, "location.hash.includes('phi') && !location.hash.includes('preset')")
    run = simulate(lagcli.load(path, preset="Time", set_initial={"phi": "45 deg"}))
    np.testing.assert_allclose(
        curves(page, "coordinates")[1]["phi"], run.q[:, 0], rtol=0, atol=1e-7
    )


def test_presets_work_in_a_sandboxed_frame_by_keyboard_on_a_narrow_screen(
    swing, tmp_path, visit, until
):
    _, page = swing
    frame = tmp_path / "frame.html"
    frame.write_text(
        f'<iframe src="{page.as_uri()}#preset=Time" width="390" height="800" style="border: 0"'
        ' sandbox="allow-scripts allow-downloads"></iframe>'
    )
    outer = visit(frame)
    outer.frame_locator("iframe").locator('#presets [aria-pressed="true"]').wait_for()
    inner = outer.frames[1]
    first = outer.frame_locator("iframe").locator("#presets button").first
    first.focus()
    first.press("Enter")
    until(inner, DRAWN)
    assert inner.evaluate("page.controls.changes().set") == {"m": "5", "l": "80"}
    assert first.get_attribute("aria-pressed") == "true"
    assert inner.evaluate("document.documentElement.scrollWidth") <= 390
    assert inner.evaluate(CONTRAST) == []


def test_texts_of_a_model_are_not_markup(tmp_path, opened):
    model = lagcli.load_text(
        "name: </script><b>bold</b> & co\n"
        "description: '<img src=x onerror=alert(1)> </script>'\n"
        "parameters: {m: 1}\n"
        "coordinates: {x: {unit: m, description: '<i>place</i>'}}\n"
        "T: m/2*x'^2\n"
        "initial: {x: 1, x': 0}\n"
    )
    target = tmp_path / "page.html"
    target.write_text(lagcli.live_page(model), encoding="utf-8")
    page = opened(target)
    assert page.title() == "</script><b>bold</b> & co"
    assert page.locator("h1").inner_text() == "</script><b>bold</b> & co"
    assert page.locator("b, i, img").count() == 0


def test_a_sandboxed_frame_simulates(pages, tmp_path, visit, until):
    frame = f'<iframe src="{pages("slider_crank").as_uri()}#m=3" sandbox="allow-scripts"></iframe>'
    outer = tmp_path / "outer.html"
    outer.write_text(f"<!doctype html><title>outer</title>{frame}", encoding="utf-8")
    page = visit(outer)
    inner = page.frames[1]
    until(inner, DRAWN)
    assert inner.evaluate("page.answer.values.m") == 3
    assert inner.evaluate("origin") == "null"


def test_the_code_of_a_frame_shows_the_page(pages, tmp_path, opened, visit, until):
    path = pages("slider_crank")
    page = opened(path)
    until(page, "page.frame.value !== ''")
    code = page.evaluate("page.frame.value")
    assert re.fullmatch(rf'<iframe src="{escape(path.name)}".*></iframe>', code)


def test_the_model_can_be_downloaded(pages, opened):
    page = opened(pages("slider_crank"))
    with page.expect_download() as event:
        page.get_by_role("button", name="Download the model").click()
    text = Path(event.value.path()).read_text("utf-8")
    assert text == lagcli.load("slider_crank").text


def test_a_body_is_dragged(pages, opened, until):
    page = opened(pages("four_bar"))
    before = page.evaluate("page.answer.start")
    box = page.locator("#player canvas").bounding_box()
    stage = "page.pictures.player.stage"
    x, y = page.evaluate(f"{stage}.camera.project({stage}.motion.point('C'))")[:2]
    page.mouse.move(box["x"] + x, box["y"] + y)
    page.mouse.down()
    page.mouse.move(box["x"] + x - 30, box["y"] + y + 5, steps=3)
    page.mouse.up()
    until(page, f"{DRAWN} && !page.pictures.dragging.active")
    state = dict(page.evaluate("page.controls.state()"))
    assert state
    assert page.locator("#notice.error").count() == 0
    assert page.evaluate("page.answer.start") != before


def test_a_narrow_and_a_wide_screen_have_room(pages, opened):
    for size in ({"width": 390, "height": 844}, {"width": 1280, "height": 800}):
        page = opened(pages("woodpecker"))
        page.set_viewport_size(size)
        page.wait_for_timeout(300)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert page.evaluate(TEXTS) == []
        assert page.evaluate(AXES) == []


def test_marks_of_sums_pass_below_the_picture_of_a_narrow_screen(pages, opened):
    """The player stays in sight while the page scrolls; the marks of a balance lay over it."""
    page = opened(pages("four_bar"))
    page.set_viewport_size({"width": 390, "height": 844})
    page.wait_for_timeout(300)
    above = page.evaluate("""() => {
      const mark = document.querySelector(".balance-zero");
      scrollBy(0, mark.getBoundingClientRect().top - 100);
      const { left, top } = mark.getBoundingClientRect();
      return document.elementFromPoint(left, top + 5).closest("#player") !== null;
    }""")
    assert above


def test_forbidden_webassembly_is_explained(pages, tmp_path, visit, until):
    text = pages("slider_crank").read_text("utf-8")
    path = tmp_path / "forbidden.html"
    path.write_text(text.replace(" 'wasm-unsafe-eval'", ""), encoding="utf-8")
    page = visit(path)
    until(page, "!document.getElementById('notice').hidden")
    assert "cannot simulate here" in page.locator("#notice").inner_text()


def test_a_page_speaks_another_language(pages, opened, until):
    path = pages("bouncing_ball", "de")
    assert '<html lang="de">' in path.read_text("utf-8")
    page = opened(path)
    assert page.get_by_role("button", name="Alles zurücksetzen").is_visible()
    until(page, "document.getElementById('status').textContent.includes('Schritte')")
    options = page.locator(".slot select").first.locator("option").all_inner_texts()
    assert "Energien" in options
    page.evaluate("document.getElementById('events').open = true")
    assert "Stoß" in page.locator("#events").inner_text()
    enter(page, until, "y", "-1")
    assert "am Anfang verletzt" in page.locator("#notice").inner_text()
    # texts of the model stay
    assert page.locator("h1").inner_text() == "Bouncing ball"


def test_without_javascript_a_picture_and_a_sentence_are_shown(pages, visit):
    page = visit(pages("slider_crank", "de"), java_script_enabled=False)
    assert page.locator("h1").inner_text() == "Slider-crank"
    image = page.locator(".still img")
    assert image.get_attribute("alt") == "Slider-crank"
    assert image.bounding_box()["width"] > 300
    assert "braucht dazu JavaScript" in page.locator(".still").inner_text()
    assert page.locator("main").is_hidden()


def test_a_large_family_has_a_panel_of_its_own(pages, opened):
    page = opened(pages("chain"))
    drawn = page.evaluate("page.answer.plots.coordinates.series.map((s) => [s.name, s.panel])")
    assert {(name.partition("[")[0], panel) for name, panel in drawn} == {("x", 0), ("y", 1)}


def test_the_motion_plays_by_itself(pages, visit, until):
    moving = visit(pages("slider_crank"))
    until(moving, f"{DRAWN} && page.pictures.player.playing && page.pictures.now > 0")


def test_paper_has_equations_and_values_and_is_light(pages, opened, tmp_path):
    page = opened(pages("slider_crank"), color_scheme="dark")
    page.locator("#equations > summary").click()
    page.locator("#controls > details > summary").first.click()
    drawn = "page.pictures.player.stage.colors.label"
    dark = page.evaluate(drawn)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.evaluate("page.pictures.slots[0].plots[0].chart.width") == 680
    page.emulate_media(media="print", color_scheme="dark")
    background = "getComputedStyle(document.body).backgroundColor"
    assert page.evaluate(background) == "rgb(255, 255, 255)"
    assert page.evaluate(drawn) != dark
    assert page.locator("#equations math").first.is_visible()
    assert page.locator('.control[data-name="m"] input[type=text]').is_visible()
    for hidden in ("#reset", "#share", '.control[data-name="m"] input[type=range]'):
        assert not page.locator(hidden).is_visible()
    page.emulate_media(media="null", color_scheme="dark")
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.evaluate(background) == "rgb(22, 25, 29)"
    assert page.evaluate(drawn) == dark
    assert page.locator("#equations:not([open])").count() == 1
    assert page.locator("#controls > details:not([open])").count() == 1
    made = tmp_path / "page.pdf"
    page.pdf(path=made, format="A4")
    assert 1 <= len(re.findall(rb"/Type */Page\b", made.read_bytes())) <= 3
