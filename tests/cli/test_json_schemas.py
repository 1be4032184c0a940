"""JSON for programs: what commands print has the schema that the documentation gives."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fastjsonschema
import pytest

import lagcli
from lagcli.cli.app import run

ROOT = Path(__file__).parents[2]
MODELS = sorted((ROOT / "models").rglob("*.yaml"))


def schema(command: str) -> Callable[[Any], Any]:
    text = (ROOT / "docs" / "schemas" / f"{command}.json").read_text(encoding="utf-8")
    found: Callable[[Any], Any] = fastjsonschema.compile(json.loads(text))
    return found


DERIVE = schema("derive")


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_equations_of_shipped_models_have_the_schema(path: Path) -> None:
    equations = lagcli.derive(lagcli.load(path))
    DERIVE(json.loads(lagcli.render(equations, format="json")))


def test_all_kinds_and_steps_have_the_schema(capsys: pytest.CaptureFixture[str]) -> None:
    model = str(ROOT / "models" / "slider_crank_textbook.yaml")
    options = ["--kind", "first,second,maggi", "--independent", "phi", "--solve", "--steps"]
    assert run(["derive", model, "--json", *options]) == 0
    found = json.loads(capsys.readouterr().out)
    DERIVE(found)
    assert {"second", "maggi", "solved", "steps"} <= set(found)
    for spoil in ({"rank": "one"}, {"unknown": 1}, {"forcing": ["a"]}):
        with pytest.raises(fastjsonschema.JsonSchemaValueException):
            DERIVE({**found, **spoil})


@pytest.mark.parametrize("name", ["slider_crank", "parallelogram", "bouncing_ball", "heavy_top"])
def test_summaries_of_runs_have_the_schema(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["simulate", name, "--json", "--t-end", "0.1", "-o", str(tmp_path / "run.h5")]
    assert run(arguments) == 0
    found = json.loads(capsys.readouterr().out)
    schema("simulate")(found)
    with pytest.raises(fastjsonschema.JsonSchemaValueException):
        schema("simulate")({**found, "status": "done"})


def test_the_list_of_models_has_the_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["models", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    schema("models")(found)
    assert len(found["models"]) == len(MODELS)
