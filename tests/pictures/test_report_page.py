"""The page of a report in a real browser, opened from a file without a network."""

import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.pictures.report import report

MODELS = Path(__file__).parents[2] / "models"
PLOTS = "document.querySelectorAll('.place canvas')"


@pytest.fixture
def crank(reports, visit):
    """The slider-crank's report."""
    opened = visit(reports("slider_crank"))
    opened.wait_for_selector(".uplot")
    return opened


@pytest.fixture(scope="session")
def run(result):
    return lagcli.read(result("slider_crank"))


def plot(opened, section):
    """Return the first plot of a section."""
    return opened.locator(f"#plots-{section} .plot").first


def picture(figure):
    return figure.locator("canvas").evaluate("canvas => canvas.toDataURL()")


def animation(opened):
    return opened.locator("#player canvas").evaluate("canvas => canvas.toDataURL()")


def time_of(opened):
    return float(opened.locator("#player input[type=range]").input_value())


def values(figure):
    """Return what the legend says, by the names of the curves."""
    found = figure.locator(".plot-legend button").evaluate_all(
        "all => all.map(b => [b.dataset.series, b.querySelector('.plot-value').textContent])"
    )
    return {name: number(text) for name, text in found}


def number(text):
    text = text.replace("−", "-").translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-"))
    return float(text.replace("·10", "e"))


def at(figure, part):
    """Return a place in a plot's drawing: a part of its width, and half of its height."""
    box = figure.locator(".u-over").bounding_box()
    return box["x"] + part * box["width"], box["y"] + 0.5 * box["height"]


def point_at(opened, figure, part):
    figure.scroll_into_view_if_needed()
    opened.mouse.move(*at(figure, part))


def test_animation_plays_and_takes_the_cursors_along(crank, until):
    before = animation(crank)
    multipliers = plot(crank, "multipliers")
    first = values(multipliers)
    crank.get_by_role("button", name="Play").click()
    until(crank, "Number(document.querySelector('#player input').value) > 0.2")
    crank.get_by_role("button", name="Pause").click()
    assert animation(crank) != before
    assert values(multipliers) != first


def test_hover_over_a_plot_moves_the_animation_and_every_cursor(crank, run):
    before = animation(crank)
    point_at(crank, plot(crank, "coordinates"), 0.5)
    assert time_of(crank) == pytest.approx(1.5, abs=0.02)
    assert animation(crank) != before
    now = time_of(crank)
    shown = values(plot(crank, "multipliers"))["lambda.guide"]
    assert shown == pytest.approx(np.interp(now, run.time, run.multipliers[:, 0]), rel=1e-4)
    shown = values(plot(crank, "velocities"))
    assert shown["phi_dot"] == pytest.approx(np.interp(now, run.time, run.v[:, 0]), rel=1e-4)


def test_a_playing_motion_is_not_carried_off_by_the_mouse_but_by_a_click(reports, visit, step):
    crank = visit(reports("slider_crank"), stepped=True)
    crank.wait_for_selector(".uplot")
    crank.set_viewport_size({"width": 1300, "height": 800})  # the animation beside the plots
    figure = plot(crank, "coordinates")
    figure.scroll_into_view_if_needed()
    crank.locator("#player canvas").focus()
    crank.keyboard.press("Space")
    step(crank, 0.25)
    crank.mouse.move(*at(figure, 0.9))
    assert time_of(crank) == pytest.approx(0.25)
    crank.mouse.down()
    step(crank, 0.25)
    crank.mouse.up()  # frames between down and up do not make a drag of it
    assert time_of(crank) == pytest.approx(2.7, abs=0.05)
    assert crank.get_by_role("button", name="Play").count() == 1  # it is paused


def test_scrubbing_moves_the_plots(crank, run):
    crank.locator("#player input[type=range]").fill("2.34")
    shown = values(plot(crank, "multipliers"))["lambda.guide"]
    assert shown == pytest.approx(run.multipliers[:, 0].min(), rel=1e-5)


def test_a_click_in_the_legend_hides_a_curve_and_shows_it_again(crank):
    figure = plot(crank, "coordinates")
    button = figure.locator("button[data-series=phi]")
    before = picture(figure)
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    hidden = picture(figure)
    assert hidden != before
    button.focus()
    crank.keyboard.press("Enter")
    assert button.get_attribute("aria-pressed") == "true"
    assert picture(figure) != hidden


def test_dragging_zooms_all_plots_and_a_button_shows_everything_again(crank, run):
    figures = [plot(crank, "coordinates"), plot(crank, "multipliers")]
    before = [picture(figure) for figure in figures]
    back = crank.locator("#zoom-out")
    assert not back.is_visible()
    point_at(crank, figures[0], 0.25)
    crank.mouse.down()
    crank.mouse.move(*at(figures[0], 0.4), steps=4)
    crank.mouse.move(*at(figures[0], 0.5), steps=4)
    crank.mouse.up()
    assert back.is_visible()
    assert all(picture(f) != b for f, b in zip(figures, before, strict=True))
    # the axis now runs from 0.75 s to 1.5 s
    point_at(crank, figures[1], 0.5)
    assert time_of(crank) == pytest.approx(1.125, abs=0.02)
    back.click()
    assert not back.is_visible()
    point_at(crank, figures[1], 0.5)
    assert time_of(crank) == pytest.approx(1.5, abs=0.02)


def test_the_keyboard_moves_the_time_and_zooms(crank):
    figure = plot(crank, "coordinates")
    figure.locator(".u-over").focus()
    for _ in range(3):
        crank.keyboard.press("ArrowRight")
    assert time_of(crank) == pytest.approx(0.09)
    crank.keyboard.press("End")
    assert time_of(crank) == pytest.approx(3)
    before = picture(figure)
    crank.keyboard.press("+")
    assert picture(figure) != before
    crank.keyboard.press("Escape")
    assert not crank.locator("#zoom-out").is_visible()


def test_a_time_in_the_table_can_be_gone_to(crank, run):
    crank.locator("#extremes summary").click()
    row = crank.locator("table.extremes tr", has_text="guide").first
    button = row.locator("button").first
    button.click()
    least = run.time[run.multipliers[:, 0].argmin()]
    assert time_of(crank) == pytest.approx(least)
    assert float(button.text_content()) == pytest.approx(least, rel=1e-5)


def test_dark_and_light(reports, visit):
    background = "getComputedStyle(document.body).backgroundColor"
    dark = visit(reports("slider_crank"), color_scheme="dark")
    assert dark.evaluate(background) == "rgb(22, 25, 29)"
    first = picture(plot(dark, "coordinates")), animation(dark)
    dark.locator("#theme").click()
    assert dark.evaluate(background) == "rgb(255, 255, 255)"
    second = picture(plot(dark, "coordinates")), animation(dark)
    assert first[0] != second[0]
    assert first[1] != second[1]


def test_plots_fill_a_phone_and_nothing_is_wider_than_it(reports, visit, until):
    opened = visit(reports("andrews_squeezer"))
    opened.set_viewport_size({"width": 360, "height": 700})
    # plots take their new sizes once the browser has laid out the page
    until(opened, "document.documentElement.scrollWidth <= 360")
    until(opened, f"[...{PLOTS}].every((c) => 300 < c.clientWidth && c.clientWidth <= 360)")


def test_formulas_are_broken_to_fit(reports, visit):
    opened = visit(reports("andrews_squeezer"))
    lines = "e => Math.round(e.getBoundingClientRect().height)"
    first = opened.locator("dl.equations .equation").first
    wide = first.evaluate(lines)
    opened.set_viewport_size({"width": 360, "height": 700})
    assert first.evaluate(lines) > wide
    scrolled = opened.locator(".equation").evaluate_all(
        "all => all.filter(e => e.scrollWidth > e.clientWidth + 1).length"
    )
    assert scrolled == 0


def test_print_shows_stills_light_plots_and_the_model(reports, visit, tmp_path):
    opened = visit(reports("slider_crank"), color_scheme="dark")
    opened.evaluate("addEventListener('beforeprint', () => { window.printed = true; })")
    opened.emulate_media(media="print")
    opened.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert opened.locator(".strip figure").count() == 4
    stills = opened.locator(".strip canvas").evaluate_all("all => all.map(c => c.toDataURL())")
    assert len(set(stills)) == 4
    assert opened.locator("details[open]").count() == opened.locator("details").count() > 4
    assert opened.evaluate("document.documentElement.dataset.theme") == "light"
    assert not opened.locator("#player").is_visible()
    opened.evaluate("dispatchEvent(new Event('afterprint'))")
    assert opened.evaluate("document.documentElement.dataset.theme") == "dark"
    assert not opened.locator("details[open]").count()


@pytest.mark.parametrize("name", ["heavy_top", "andrews_squeezer", "woodpecker"])
def test_no_printed_page_ends_with_a_heading_or_what_introduces_plots(
    name, reports, visit, tmp_path
):
    if shutil.which("pdftotext") is None:
        pytest.skip("pdftotext (poppler-utils) is not installed")
    opened = visit(reports(name))
    opened.wait_for_selector(".uplot")
    heads = opened.locator("h1, h2, h3, h4, h2 + p, h3 + p, h4 + p").all_text_contents()
    opened.pdf(path=tmp_path / "report.pdf", format="A4")
    command = ["pdftotext", "-layout", tmp_path / "report.pdf", "-"]
    text = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout
    last = [page.rstrip().splitlines()[-1].strip() for page in text.split("\f") if page.strip()]
    assert len(last) > 9
    ends = {squeezed(head)[-30:] for head in heads if head.strip()}
    assert not [line for line in last if squeezed(line)[-30:] in ends]
    assert not [line for line in last if len(line) > 40 and starts(line, heads)]


def squeezed(text):
    return "".join(text.split())


def starts(line, heads):
    """Whether one of the texts begins with the line: it goes on in the next page."""
    return any(squeezed(head).startswith(squeezed(line)) for head in heads)


def test_the_page_can_be_read_without_a_mouse_and_without_eyes(crank):
    assert crank.locator("main").count() == crank.locator("header").count() == 1
    assert crank.locator("h1").count() == 1
    levels = crank.locator("h1, h2, h3").evaluate_all("all => all.map(h => +h.tagName[1])")
    assert all(b - a <= 1 for a, b in pairwise(levels))
    for table in crank.locator("table").all():
        assert table.locator("caption").text_content()
    unnamed = crank.locator("button, input, select").evaluate_all(
        "all => all.filter(e => !e.textContent.trim() && !e.ariaLabel && !e.labels?.length).length"
    )
    assert unnamed == 0
    for over in crank.locator(".u-over").all():
        assert over.get_attribute("aria-label")
    for formula in crank.locator(".equation").all():
        assert formula.get_attribute("role") == "math"
        assert formula.get_attribute("aria-label")


def test_a_model_cannot_run_anything(visit, tmp_path):
    evil = "</script><script>document.title = 'taken'</script><img src=x onerror=alert(1)>"
    text = f"""
name: "{evil}"
description: "{evil}"
coordinates: {{x: {{unit: m, description: "{evil}"}}, y: {{unit: m}}}}
parameters: {{m: {{value: 1, description: "{evil}"}}}}
T: m/2*(x'^2 + y'^2)
V: m*y
constraints: {{rod: {{expr: x^2 + y^2 = 1, description: "{evil}"}}}}
initial: {{x: 1, y: 0, x': 0, y': 0}}
outputs: {{height: y}}
view:
  points: {{O: [0, 0], A: [x, y]}}
  rods: [O-A]
  labels: {{A: "{evil}"}}
# {evil}
"""
    trajectory = lagcli.simulate(lagcli.load_text(text), t_end=0.2, samples=5)
    report(trajectory, tmp_path / "evil.html")
    opened = visit(tmp_path / "evil.html")
    opened.wait_for_selector(".uplot")
    assert opened.title() == evil
    assert opened.locator("h1").text_content() == evil
    assert opened.locator("img").count() == 0
    assert opened.locator("script").count() == 2  # the data and the page's own


@pytest.mark.parametrize("name", ["heavy_top", "chain"])
def test_other_pages_open_without_a_word(reports, visit, name):
    opened = visit(reports(name))
    opened.wait_for_selector(".uplot")
    drawn = opened.locator(".place canvas").count()
    assert drawn == opened.locator(".place").count() > 3
    # a large family has a colour bar, and its legend is folded
    scales = opened.locator(".plot-family").count()
    assert bool(scales) == (name == "chain")
    assert opened.locator("details.plot-values:not([open])").count() == scales


def test_no_arm_is_said_where_a_multiplier_is_zero(reports, visit):
    """At first, the bird's upper contact is open."""
    opened = visit(reports("woodpecker"))
    opened.wait_for_selector(".uplot")
    assert [x.split()[0] for x in opened.locator("#arms li:visible").all_inner_texts()] == [
        "|lower|"
    ]


READ = """() => {
  const player = document.querySelector("#player").player;
  const places = [...document.querySelectorAll(".place figure")];
  const curves = places.flatMap(({ plot }) => plot.data.series.map(({ name }, i) => [
    name, plot.values[i].textContent, plot.data.log,
  ]));
  const { balance } = document.querySelector(".live");
  const { time } = places[0].plot.link;
  balance.seen = true; // it does not follow where it is out of sight
  balance.show(time);
  const forces = player.stage.vectors(player.read).filter((v) => v.quantity === "force");
  return {
    time, drawn: player.time, clock: player.clock.textContent,
    force: forces[0].value, curves, inertia: balance.now.values[0],
  };
}"""


def test_of_a_long_run_all_numbers_are_those_of_one_stored_sample(visit, tmp_path, step):
    """Of 20,001 samples, plots, animation and equations have different ones, and some in common."""
    long = lagcli.simulate(lagcli.load(MODELS / "slider_crank.yaml"), samples=20_001, t_end=20.0)
    report(long, tmp_path / "long.html")
    opened = visit(tmp_path / "long.html", stepped=True)
    opened.wait_for_selector(".uplot")
    opened.set_viewport_size({"width": 1300, "height": 1000})
    opened.wait_for_function("() => document.querySelector('.live').balance.seen", polling=20)
    columns = {"phi": long.q[:, 0], "psi": long.q[:, 1], "phi_dot": long.v[:, 0]}
    columns |= {"lambda.guide": long.multipliers[:, 0], "energy_total": long.energy_total}
    m, r = 1.0, 0.1
    inertia = 2 * m * r**2 * long.a[:, 0]  # the first term of the equation of phi

    def check():
        shown = opened.evaluate(READ)
        (k,) = np.flatnonzero(long.time == shown["time"])
        assert float(shown["clock"].split()[0]) == pytest.approx(long.time[k], abs=5e-4)
        force = long.multipliers[k, 0]
        assert shown["force"] == pytest.approx(abs(force), rel=1e-8)
        read = {name: number(text) for name, text, log in shown["curves"] if not log}
        for name, values in columns.items():
            assert read[name] == pytest.approx(values[k], rel=6e-6, abs=1e-12), (name, k)
        assert shown["inertia"] == pytest.approx(inertia[k], rel=1e-8, abs=1e-12)
        return shown

    for part in np.linspace(0.013, 0.987, 12):
        point_at(opened, plot(opened, "coordinates"), part)
        shown = check()
        assert shown["drawn"] == shown["time"]
    opened.locator("#extremes summary").click()
    rows = opened.locator("table.extremes tbody tr")
    for row, values in ((0, long.q[:, 0]), (4, long.multipliers[:, 0])):
        rows.nth(row).locator("button").first.click()
        shown = check()
        assert values[long.time == shown["time"]] == values.min()
    opened.locator("#player canvas").focus()
    opened.keyboard.press("Space")
    for _ in range(3):  # numbers while it moves, too
        step(opened, 0.1237)
        shown = check()
    opened.keyboard.press("Space")
    shown = check()
    assert shown["drawn"] == shown["time"]
    opened.keyboard.press("ArrowRight")
    assert check()["time"] > shown["time"]


def test_without_javascript_there_are_pictures_and_a_sentence(reports, browser):
    context = browser.new_context(java_script_enabled=False, viewport={"width": 390, "height": 800})
    try:
        opened = context.new_page()
        opened.goto(reports("slider_crank").resolve().as_uri())
        assert "JavaScript" in opened.locator(".still").inner_text()
        for image in opened.locator(".still img").all():
            box = image.bounding_box()
            assert box["width"] > 300
            assert box["height"] > 80
        assert [image.get_attribute("alt") for image in opened.locator(".still img").all()] == [
            "Slider-crank",
            "λ over time",
        ]
        # what scripts would fill is not there
        assert not opened.get_by_role("heading", name="Motion", exact=True).is_visible()
        assert not opened.get_by_role("link", name="Coordinates", exact=True).is_visible()
        assert opened.get_by_role("heading", name="Equations of motion").is_visible()
    finally:
        context.close()


@pytest.mark.parametrize(
    ("name", "arrow", "unit"), [("car_axis", "axis", "m"), ("slider_crank", "", "")]
)
def test_where_an_arrow_is_not_lambda_the_arm_is_said(name, arrow, unit, reports, visit, result):
    opened = visit(reports(name))
    opened.wait_for_selector(".uplot")
    run = lagcli.read(result(name))
    k = len(run.time) // 3
    go = "t => document.querySelector('#lambda').plot.link.setTime(t)"
    opened.evaluate(go, float(run.time[k]))
    lines = opened.locator("#arms li").all_inner_texts()
    if not arrow:
        assert not opened.locator("#arms").is_visible()
        return
    (line,) = lines
    # g = (x_l - x_r)² + (y_l - y_r)² - l² has the arm 2 l, and an arrow in N
    distance = 2.0 * run.parameters["L"]
    assert line.split() == [f"|{arrow}|", "=", f"{distance:.4g}", unit, "·", f"|λ{arrow}|"]
