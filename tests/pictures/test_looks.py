"""What a machine can see of pictures and pages: labels, contrast, colours, units."""

from __future__ import annotations

import json
import re
import warnings
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex
from page_checks import AXES, TEXTS
from random_cases import some

import lagcli
from lagcli.cli.app import run
from lagcli.pictures.plots import figure as figure_file
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.drawing import Moment, SceneDrawing, distances, label_place, label_size
from lagcli.pictures.scene.view_evaluator import scene_of
from lagcli.pictures.style import PALETTE, ROLES, constraint_colors

ASSETS = [files("lagcli.pictures") / "assets", files("lagcli.play") / "assets"]


def luminance(color: str) -> float:
    """Return the relative luminance of WCAG 2."""
    parts = [int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def contrast(one: str, other: str) -> float:
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def dark_roles() -> dict[str, str]:
    """Return the colours of scenes on dark pages."""
    text = (ASSETS[0] / "scene.js").read_text(encoding="utf-8")
    found = re.search(r"\bdark: \{(.*?)\}", text, re.DOTALL)
    assert found is not None
    return dict(re.findall(r'(\w+): "(#\w+)"', found[1]))


@pytest.mark.parametrize("roles", [ROLES, dark_roles()], ids=["light", "dark"])
def test_scenes_have_contrast(roles: dict[str, str]) -> None:
    """Text has 4.5, what must be seen 3 (WCAG 2.1, 1.4.3, 1.4.11); trails and guides are faint."""
    for role, color in roles.items():
        if role in ("label", "point", "ground"):
            assert contrast(color, roles["paper"]) >= 4.5, role
        elif role not in ("paper", "trail", "guide"):
            assert contrast(color, roles["paper"]) >= 2.9, role


def test_pages_have_one_palette(reports) -> None:
    for folder in ASSETS:
        for file in folder.iterdir():
            if file.name.endswith((".css", ".js")):
                assert not re.search(r"--scene-[a-z]+:", file.read_text()), file.name
    text = reports("slider_crank").read_text(encoding="utf-8")
    assert json.dumps(list(PALETTE), separators=(",", ":")) in text


@pytest.mark.parametrize(
    "name", ["slider_crank", "double_pendulum_cartesian", "four_bar", "particle_on_sphere"]
)
def test_labels_keep_off_rods_and_arrows(name: str, result) -> None:
    scene = scene_of(RunFile(result(name)))
    drawing = SceneDrawing(scene, 640, 480)
    unit = drawing.raster.unit
    for time in np.linspace(scene.time[0], scene.time[-1], 25):
        moment = Moment(scene, drawing.camera, drawing.raster, time, 0.1)
        lines = np.array(
            [(moment.places[s.start][:2], moment.places[s.end][:2]) for s in scene.segments]
        ).reshape(-1, 2, 2)
        for point, text in (scene.labels or {}).items():
            size, at = label_size(text, unit), moment.places[point][:2]
            middle = label_place(at, size, lines, unit)
            corners = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]) * size / 2
            if len(lines):
                assert distances(middle + corners, lines).min() > 1, (time, point)
            # the nearest place of the text, beyond the dot of a body
            nearest = np.clip(at, middle - np.array(size) / 2, middle + np.array(size) / 2)
            assert np.linalg.norm(nearest - at) > 8 * unit, (time, point)


def test_labels_keep_off_each_other() -> None:
    at, size = np.array([100.0, 100.0]), label_size("P1", 1.0)
    first = label_place(at, size, np.empty((0, 2, 2)), 1.0)
    assert first[0] > at[0]
    assert first[1] > at[1]
    side = np.array([size[0] / 2, 0])
    second = label_place(at, size, np.array([(first - side, first + side)]), 1.0)
    assert abs(second - first)[0] > size[0] or abs(second - first)[1] > size[1]


@pytest.mark.parametrize(
    "name",
    some(["slider_crank", "rolling_disk", "car_axis", "andrews_squeezer", "heavy_top", "chain"], 3),
)
def test_every_plot_of_a_report_has_a_unit(name: str, reports) -> None:
    text = reports(name).read_text(encoding="utf-8")
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert data is not None
    units = lagcli.load(name).units
    assert units.stated
    for plot in json.loads(data[1])["plots"]:
        assert plot["unit"] or plot["log"] or not units.throughout, [
            s["name"] for s in plot["series"]
        ]


def test_play_draws_labels_in_the_same_places(result, visit, tmp_path: Path) -> None:
    from lagcli.pictures.animation.animate import animate

    animate(result("slider_crank"), tmp_path / "page.html")
    opened = visit(tmp_path / "page.html")
    lines = [[10, 20, 110, 80], [60, 50, 60, 120]]
    found = opened.evaluate("(lines) => labelPlace([60, 50], 16, 13, lines, 1)", lines)
    flipped = np.array([[(a, -b), (c, -d)] for a, b, c, d in lines], dtype=float)
    expected = label_place(np.array([60.0, -50.0]), (16, 13), flipped, 1.0)
    assert [found[0], -found[1]] == pytest.approx(expected.tolist())


@pytest.mark.parametrize("name", ["slider_crank", "heavy_top", "chain", "woodpecker"])
def test_no_text_of_a_report_is_cut_off_or_overlaps(name: str, reports, visit) -> None:
    page = visit(reports(name))
    for width in (1280, 390):
        page.set_viewport_size({"width": width, "height": 800})
        page.evaluate("new Promise((done) => requestAnimationFrame(() => setTimeout(done, 50)))")
        assert page.evaluate(TEXTS) == []
        assert page.evaluate(AXES) == []


def test_what_is_rounding_is_shown_as_nothing(reports, visit) -> None:
    """At first, the springs of the squeezing mechanism press on one of its pins alone."""
    page = visit(reports("andrews_squeezer"), reduced_motion="reduce")
    page.evaluate("new Promise((done) => requestAnimationFrame(() => setTimeout(done, 50)))")
    shown = page.locator(".player-vectors li").all_text_contents()
    assert shown == ["pin_force_3 98.8 N", "pin_force_4 0 N", "pin_force_6 0 N"]
    values = page.locator("#plots-multipliers .plot-value").all_text_contents()
    assert values[0].startswith("−98.56")
    assert values[2:] == ["0"] * 4


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch):
    """Return the figure of a plot, as it is written."""
    figures = []
    monkeypatch.setattr(figure_file, "write_figure", lambda figure, *_: figures.append(figure))

    def of(*arguments: str | Path):
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert run(["plot", *map(str, arguments), "-o", "never.png"]) == 0
            figure = figures.pop()
            FigureCanvasAgg(figure).draw()
        return figure

    return of


def words_of(figure) -> list[tuple[str, np.ndarray]]:
    """Return the texts of a figure outside its panels, with their corners in pixels."""
    from matplotlib.text import Text

    found = []
    for text in figure.findobj(Text):
        if text.get_text().strip() and text.get_visible():
            box = text.get_window_extent()
            found.append((text.get_text(), np.array([box.min, box.max])))
    return found


@pytest.mark.parametrize("name", ["slider_crank", "heavy_top", "woodpecker", "pendulum_chain"])
def test_no_labels_of_a_plot_overlap_or_are_cut_off(name: str, result, drawn) -> None:
    figure = drawn(result(name))
    panels = [ax for ax in figure.axes if ax.get_label() != "<colorbar>"]  # of a family's index
    names = [ax.get_ylabel() for ax in panels] + [panels[-1].get_xlabel()]
    assert all(re.search(r"\[.+\]$", label) for label in names), names
    boxes = [(text, box) for text, box in words_of(figure) if text in names]
    assert len(boxes) == len(names)
    for i, (text, box) in enumerate(boxes):
        assert (box[0] >= -1).all(), text
        assert (box[1] <= figure.bbox.max + 1).all(), text
        for other, beside in boxes[i + 1 :]:
            apart = (box[0] >= beside[1]) | (beside[0] >= box[1])
            assert apart.any(), (text, other)


@pytest.mark.parametrize("name", ["parallelogram", "chain"])
def test_multipliers_have_the_colours_of_pages(name: str, result, reports, drawn) -> None:
    figure = drawn(result(name), "lambda")
    lines = [to_hex(x.get_color()).upper() for ax in figure.axes for x in ax.get_lines()]
    colors = constraint_colors(RunFile(result(name)).constraints)
    assert sorted(lines) == sorted(colors.values())
    data = json.loads(re.search(r'id="data">(.*?)</script>', reports(name).read_text())[1])
    assert data["colors"] == colors


def test_energies_of_other_sizes_have_their_own_panels(result, drawn) -> None:
    """A top's energy of motion is forty times that of its height, which would be a line."""
    labels = [ax.get_ylabel() for ax in drawn(result("heavy_top")).axes]
    assert labels[-2:] == ["$T$, $E$ [J]", "$V$ [J]"]
