"""A folder of pages with an index."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import lagcli
from lagcli.cli.app import run
from lagcli.errors import UsageError
from lagcli.live.course import course


def test_a_folder_has_a_page_of_each_model_and_an_index(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "course"
    models = ["atwood", "newtons_cradle"]
    assert run(["export", *models, "-o", f"{folder}/", "--lang", "fr"]) == 0
    assert "3 pages" in capsys.readouterr().err
    index = (folder / "index.html").read_text("utf-8")
    assert re.findall(r'href="([^"]+)"', index) == ["atwood.html", "newtons_cradle.html"]
    assert '<html lang="fr">' in index
    assert lagcli.load("atwood").title in index
    for name in models:
        assert '<html lang="fr">' in (folder / f"{name}.html").read_text("utf-8")
    # nothing is replaced unless that is asked for
    assert run(["export", *models, "-o", str(folder)]) == 4
    assert run(["export", *models, "-o", str(folder), "--force", "-q"]) == 0


def test_two_models_of_one_name_are_refused() -> None:
    model = lagcli.load("atwood")
    with pytest.raises(UsageError, match=r"atwood\.html"):
        course([model, model])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["atwood", "chain", "-o", "x.html"], "go to a folder"),
        (["atwood", "-o", "./", "--to", "c"], "a folder is for pages"),
        (["atwood", "-o", "./", "--fmi", "3.0"], "options of FMUs"),
        (["atwood", "-o", "x.c", "--lang", "de"], "an option of pages"),
    ],
)
def test_a_mistake_has_a_remedy(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["export", *arguments]) == 2
    assert message in capsys.readouterr().err
