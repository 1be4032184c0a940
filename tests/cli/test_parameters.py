"""lagcli parameters."""

from __future__ import annotations

from pathlib import Path

import pytest

from lagcli.cli.app import run

MODELS = Path(__file__).parents[2] / "models"


def test_parameters_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["parameters", str(MODELS / "atwood.yaml")]) == 0
    assert "g = 9.81" in capsys.readouterr().out
    assert run(["parameters", "none.yaml"]) == 4
