"""The gallery, and the first picture of the documentation, show what they look like now."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from programs import program
from shipped import every_model

import lagcli
from lagcli.pictures import style
from lagcli.pictures.run_file import RunFile

ROOT = Path(__file__).parents[2]
GALLERY = ROOT / "docs" / "gallery"
MODELS = sorted(f.stem for f in (ROOT / "models").rglob("*.yaml"))

#: Of all pixels, those that may differ by more than soft edges do.
_TOLERANCE = 3e-4


@pytest.fixture(scope="module")
def build():
    """The program that makes the gallery."""
    return program(GALLERY / "build.py")


def different(first, second):
    """Return which part of the pixels differs by more than soft edges do."""
    first, second = (np.asarray(x.convert("RGB")).astype(int) for x in (first, second))
    assert first.shape == second.shape
    return float((np.abs(first - second).max(axis=2) > 64).mean())


@pytest.mark.parametrize("name", every_model())
def test_stored_pictures_are_those_of_the_models(name, build, result):
    drawn = build.picture(RunFile(result(name)))
    with Image.open(GALLERY / f"{name}.png") as stored:
        assert different(drawn, stored) < _TOLERANCE


def test_another_moment_is_another_picture(build, result, monkeypatch):
    monkeypatch.setattr(build, "MOMENT", build.MOMENT + 0.01)
    drawn = build.picture(RunFile(result("slider_crank")))
    with Image.open(GALLERY / "slider_crank.png") as stored:
        assert different(drawn, stored) > 5 * _TOLERANCE


def test_the_index_has_every_model(build):
    models = {name: lagcli.load(name) for name in MODELS}
    text = (GALLERY / "README.md").read_text(encoding="utf-8")
    assert text == build.INTRODUCTION + build.table(models)
    page = build.index(models)
    for name, model in models.items():
        assert model.description
        assert f'src="{name}.png"' in page
        assert f'href="pages/{name}-report.html"' in page


def test_what_the_repository_keeps_is_small():
    assert all(f.stat().st_size < 50_000 for f in GALLERY.glob("*.png"))
    film = GALLERY / "slider_crank.gif"
    assert film.stat().st_size < 300_000
    with Image.open(film) as frames:
        assert frames.n_frames > 30


def test_the_first_picture_is_what_the_program_derives_and_computes():
    drawn = program(GALLERY.parent / "first_picture.py")
    both = drawn.picture(), drawn.PICTURE.read_text(encoding="utf-8")
    number = re.compile(r"-?\d+\.?\d*")
    assert number.sub("#", both[0]) == number.sub("#", both[1])
    values = [np.array(number.findall(text), dtype=float) for text in both]
    # pixels, rounded to tenths
    np.testing.assert_allclose(*values, atol=0.15)


@pytest.mark.parametrize("name", ["plot", "fit"])
def test_pictures_beside_commands_have_the_colours_of_curves(name):
    # they are drawn by `make gallery`; a rule of colours that changes is noticed here
    with Image.open(ROOT / "docs" / "images" / f"{name}.png") as stored:
        pixels = np.unique(np.asarray(stored.convert("RGB")).reshape(-1, 3), axis=0).astype(int)
    for color in (style.PALETTE[0], style.constraint_colors(["guide"])["guide"]):
        wanted = [int(color[i : i + 2], 16) for i in (1, 3, 5)]
        assert np.abs(pixels - wanted).max(axis=1).min() < 8, color
