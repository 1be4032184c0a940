"""`lagcli compare` from the shell."""

import json
from pathlib import Path

import pytest
from documented_schemas import schema

from lagcli.cli.app import run

ROOT = Path(__file__).parents[2]
PENDULUM, CRANK, TEXTBOOK = (
    str(ROOT / "models" / f"{name}.yaml")
    for name in ("pendulum_cartesian", "slider_crank", "slider_crank_textbook")
)
SCHEMA = json.loads((ROOT / "docs" / "schemas" / "compare.json").read_text(encoding="utf-8"))


def test_table_fits_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", PENDULUM, "--t-end", "1"]) == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    for name in ("index1", "GGL", "Maggi", "second kind", "Taylor", "Radau"):
        assert name in text


def test_a_motion_that_violates_the_constraints_is_noted(
    capsys: pytest.CaptureFixture[str],
) -> None:
    # without stabilization, at a tolerance that is too large, the rod changes its length
    arguments = ["--formulation", "projection,index1", "--t-end", "200", "--rtol", "1e-3"]
    assert run(["compare", PENDULUM, *arguments]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "note: index1, DOP853, rtol 1e-03: the constraints are violated by" in text
    assert "note: projection" not in text


def test_json_is_that_of_the_schema(capsys: pytest.CaptureFixture[str]) -> None:
    valid = schema("compare")
    assert run(["compare", PENDULUM, "--t-end", "1", "--json", "--formulation", "ggl"]) == 0
    assert len(valid(json.loads(capsys.readouterr().out))["runs"]) == 1
    assert run(["compare", CRANK, TEXTBOOK, "--t-end", "1", "--json"]) == 0
    found = valid(json.loads(capsys.readouterr().out))
    assert found["multipliers"][0]["explained"]
    assert found["other"] == "slider_crank_textbook"


def test_file_is_described_and_plotted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, picture = tmp_path / "c.h5", tmp_path / "c.svg"
    rows = ["--formulation", "projection,index1", "--rtol", "1e-6,1e-9"]
    assert run(["compare", PENDULUM, *rows, "-o", str(file)]) == 0
    said = capsys.readouterr().out
    assert run(["info", str(file)]) == 0
    assert capsys.readouterr().out.strip() in said
    assert run(["plot", str(file), "-o", str(picture)]) == 0
    assert "error of energy balance" in picture.read_text()
    assert "index1" in picture.read_text()
    capsys.readouterr()
    assert run(["compare", PENDULUM, *rows, "-o", str(file)]) == 4
    assert "exists" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--rtol", "small"], "--rtol 'small' is not a number"),
        (["--rtol", "1e-20"], "1e-13"),
        ([TEXTBOOK, "--method", "Radau"], "two models"),
        (["-o", "x.csv"], "use x.json or x.h5"),
    ],
)
def test_wrong_use_is_rejected(
    options: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["compare", CRANK, *options]) == 2
    assert said in capsys.readouterr().err
