"""JSON for programs: what commands print has the schema that the documentation gives."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import fastjsonschema
import pytest
from documented_schemas import schema
from shipped import PATHS, WRITTEN, every_model

import lagcli
from lagcli.cli import app
from lagcli.cli.app import COMMANDS, run

ROOT = Path(__file__).parents[2]
MODELS = sorted((ROOT / "models").rglob("*.yaml"))


DERIVE = schema("derive")


@pytest.mark.parametrize("name", every_model(few=WRITTEN))
def test_equations_of_shipped_models_have_the_schema(name: str) -> None:
    equations = lagcli.derive(lagcli.load(PATHS[name]))
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


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    """Run a command with --json and return the object that it prints."""
    assert run([*arguments, "--json"]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


WITH_JSON = [name for name in COMMANDS if any("--json" in x.opts for x in app.command(name).params)]


def described(part: Any) -> bool:
    """Return whether every property of a schema, and of its parts, has a description."""
    if isinstance(part, list):
        return all(map(described, part))
    if not isinstance(part, dict):
        return True
    properties = part.get("properties", {})
    documented = all("description" in x or "$ref" in x for x in properties.values())
    return documented and all(map(described, part.values()))


@pytest.mark.parametrize("command", WITH_JSON)
def test_every_command_with_json_has_a_schema_and_prints_its_errors(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / "docs" / "schemas" / f"{command}.json").read_text(encoding="utf-8")
    assert described(json.loads(text))
    assert f"(schemas/{command}.json)" in (ROOT / "docs" / "command-line.md").read_text()
    arguments = {"sweep": ["--vary", "m=1", "-o", "x.h5"], "models": []}.get(command, [])
    if command == "models":
        return
    assert run([command, "absent.h5", "--json", *arguments]) in (2, 4)
    found = json.loads(capsys.readouterr().out)
    schema("error")(found)


def test_errors_in_a_model_have_the_schema(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "wrong.yaml").write_text("coordinates: [x]\nT: m/2*x'^2\n", encoding="utf-8")
    assert run(["modes", str(tmp_path / "wrong.yaml"), "--json"]) == 2
    found = json.loads(capsys.readouterr().out)
    schema("error")(found)
    assert [x["line"] for x in found["diagnostics"]] == [1, 2]


def test_sweeps_and_what_info_says_of_them_have_the_schemas(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    measured, kept = str(tmp_path / "measured.h5"), str(tmp_path / "kept.h5")
    few = ["--t-end", "0.1", "--samples", "5", "--jobs", "1"]
    drawn = ["--vary", "l=0.2..0.3", "--sample", "sobol:4", "--measure", "peak=max(phi)"]
    grid = ["--vary", "l=0.2,0.3", "--vary", "phi'=1,2", "--keep", "trajectories"]
    for path, options in ((measured, drawn), (kept, grid)):
        summary = printed(capsys, "sweep", "slider_crank", *options, *few, "-o", path)
        schema("sweep")(summary)
        found = printed(capsys, "info", path)
        schema("info")(found)
        assert found["kind"] == "sweep"
    with pytest.raises(fastjsonschema.JsonSchemaValueException):
        schema("sweep")({**summary, "rows": "4"})
    with pytest.raises(fastjsonschema.JsonSchemaValueException):
        schema("info")({**found, "zip": 1})


@pytest.mark.parametrize(
    ("name", "output", "options"),
    [
        ("slider_crank", "run.h5", ["--sensitivity", "l"]),
        ("slider_crank", "alone.csv", []),
        ("slider_crank", "run.csv", ["--meta"]),
        ("bouncing_ball", "run.h5", []),
        ("bouncing_ball", "run.h5", ["--set", "h=0.1 m", "--sensitivity", "e"]),
        ("car_on_road", "run.h5", []),
        ("chaplygin_sleigh", "run.h5", []),
        ("parallelogram", "run.h5", []),
    ],
)
def test_what_info_says_of_runs_has_the_schema(
    name: str,
    output: str,
    options: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = str(tmp_path / output)
    assert run(["simulate", name, "--t-end", "0.2", "--quiet", "-o", path, *options]) == 0
    found = printed(capsys, "info", path)
    schema("info")(found)
    for spoil in ({"status": "done"}, {"unknown": 1}, {"multipliers": []}):
        with pytest.raises(fastjsonschema.JsonSchemaValueException):
            schema("info")({**found, **spoil})


def test_simulate_has_the_derivatives_of_event_times(capsys: pytest.CaptureFixture[str]) -> None:
    """A ball that falls h takes t = √(2 h/g): dt/dg = −t/2g, dt/dh = t/2h."""
    arguments = ("simulate", "bouncing_ball", "--t-end", "0.8", "--sensitivity", "g,h,e")
    found = printed(capsys, *arguments)
    schema("simulate")(found)
    (impact,) = found["events"]["dtime"]
    fall = math.sqrt(2 / 9.81)
    assert (impact["name"], impact["kind"]) == ("floor", "impact")
    assert impact["time"] == pytest.approx(fall, rel=1e-9)
    slopes = {"g": -fall / (2 * 9.81), "h": fall / 2, "e": 0.0}
    assert impact["dtime"] == pytest.approx(slopes, rel=1e-8)
    assert printed(capsys, *arguments[:4])["events"]["dtime"] is None


def test_what_info_says_of_analyses_has_the_schemas(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for command, arguments in (
        ("modes", ["chain", "--set", "N=2", "--equilibrium"]),
        ("linearize", ["chain", "--set", "N=2", "--equilibrium"]),
        ("equilibrium", ["pendulum_cartesian"]),
        ("compare", ["slider_crank", "--t-end", "0.1"]),
    ):
        path = str(tmp_path / f"{command}.h5")
        assert run([command, *arguments, "-o", path, "--json"]) == 0
        capsys.readouterr()
        found = printed(capsys, "info", path)
        schema("info")(found)
        schema(command)(found)
