"""The text of a live page."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import lagcli
from lagcli.cli.app import run
from lagcli.errors import UsageError

#: A parameter that follows another one, a guess, and units other than SI.
MODEL = """\
parameters: {m: 2 kg, l: 50 cm, J: m*l^2}
coordinates: {x: m, y: m}
T: m/2*(x'^2 + y'^2)
V: m*9.81*y
constraints: {rod: x^2 + y^2 = l^2}
initial: {x: 0.3, y: {guess: -0.4}, x': 0, y': {guess: 0}}
simulation: {t_end: 2}
"""


def content(text: str) -> dict:
    found = re.search(r'<script type="application/json" id="content">(.*?)</script>', text, re.S)
    assert found is not None
    return json.loads(found[1])


def test_the_same_model_gives_the_same_page() -> None:
    one, other = (lagcli.live_page(lagcli.load_text(MODEL)) for _ in range(2))
    assert one == other
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', one)
    assert policy is not None
    assert "'wasm-unsafe-eval'; style-src" in policy[1]
    assert "worker-src blob:" in policy[1]
    assert "unsafe-inline" not in policy[1]


def test_the_page_of_a_run_has_its_values_and_settings(tmp_path: Path) -> None:
    model = tmp_path / "pendulum.yaml"
    model.write_text(MODEL, encoding="utf-8")
    result, page = tmp_path / "run.h5", tmp_path / "run.html"
    changed = ["--set", "l=40 cm", "--set-initial", "x=0.1", "--t-end", "1", "--samples", "51"]
    assert run(["simulate", str(model), *changed, "-o", str(result), "-q"]) == 0
    assert run(["report", str(result), "--live", "--lang", "de", "-o", str(page), "-q"]) == 0
    text = page.read_text("utf-8")
    assert '<html lang="de">' in text
    data = content(text)
    assert data["settings"]["t_end"] == 1.0
    assert data["settings"]["count"] == 51
    shown = {control["name"]: control for control in data["hello"]["controls"]}
    assert shown["l"]["value"] == pytest.approx(40.0)
    assert shown["x"]["value"] == pytest.approx(0.1)
    assert shown["J"]["follows"]
    assert data["guesses"] == ["y", "y'"]


def test_the_page_of_a_run_has_its_number_of_members(tmp_path: Path) -> None:
    result, page = tmp_path / "run.h5", tmp_path / "run.html"
    assert run(["simulate", "chain", "--set", "N=3", "-o", str(result), "-q"]) == 0
    assert run(["report", str(result), "--live", "-o", str(page), "-q"]) == 0
    assert len(content(page.read_text("utf-8"))["names"]["coordinates"]) == 6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--live", "--modes", "start", "-o", "x.html"], "has neither"),
        (["--live", "-o", "x.pdf"], "ends in .html"),
    ],
)
def test_a_mistake_has_a_remedy(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["report", "run.h5", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_structural_parameters_and_singular_motions_are_left_to_lagcli() -> None:
    chain = content(lagcli.live_page(lagcli.load("chain")))
    assert "N" not in {control["name"] for control in chain["hello"]["controls"]}
    failing = lagcli.load_text(MODEL.replace("m*9.81*y", "m*9.81*l*log(x/l)"))
    with pytest.raises(UsageError, match="completed"):
        lagcli.live_page(failing)
