"""Hints of `lagcli check` and `lagcli simulate`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lagcli.cli.app import run

FOUND = Path(__file__).parents[1] / "found"
ANGLE = "`theta` starts at 30 rad, 4.8 turns; an angle in degrees is written `30 deg`"
MASS = (
    "`T` gives `m` the inertia 2 m; the kinetic energy of a mass m is m/2 times its squared"
    " velocity"
)


@pytest.mark.parametrize(
    ("name", "message", "line"), [("angle", ANGLE, 6), ("sloppy", MASS, 4)], ids=["angle", "sloppy"]
)
def test_hints_are_notes(
    name: str, message: str, line: int, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(FOUND / f"{name}.yaml")
    assert run(["check", path]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert f"Hints {message} (line {line}, column " in text
    assert run(["check", path, "--json"]) == 0
    (hint,) = json.loads(capsys.readouterr().out)["hints"]
    assert (hint["message"], hint["place"]["line"]) == (message, line)
    short = ["simulate", path, "--t-end", "0.1", "--strict"]
    assert run(short) == 0
    assert capsys.readouterr().err == f"note: {path}:{line}: {message}\n"
    assert run([*short, "--quiet"]) == 0
    assert capsys.readouterr().err == ""


def test_an_initial_value_of_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    path = str(FOUND / "angle.yaml")
    short = ["simulate", path, "--t-end", "0.1", "--set-initial"]
    assert run([*short, "theta=-45"]) == 0
    assert "`theta` starts at -45 rad, 7.2 turns" in capsys.readouterr().err
    assert run([*short, "theta=-45 deg"]) == 0
    assert capsys.readouterr().err == ""


def test_models_without_a_hint(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "pendulum_cartesian", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["hints"] == []
    assert run(["check", "pendulum_cartesian"]) == 0
    assert "Hints" not in capsys.readouterr().out
