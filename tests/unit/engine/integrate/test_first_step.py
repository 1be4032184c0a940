"""The first step of the reference engine."""

from __future__ import annotations

from pathlib import Path

import pytest

import lagcli
from lagcli.cli.app import run

PENDULUM = """
coordinates: [x]
T: x'^2/2
V: x^2/2
initial: {x: 1, x': 0}
simulation: {t_end: 1, samples: 3, engine: scipy, first_step: 1 us}
"""


def test_a_first_step_is_taken(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = lagcli.load_text(PENDULUM)
    short, usual = lagcli.simulate(model), lagcli.simulate(model, first_step=0.1)
    assert short.options["first_step"] == 1e-6
    assert short.counts["steps"] > usual.counts["steps"]
    path = tmp_path / "model.yaml"
    path.write_text(PENDULUM)
    assert run(["simulate", str(path), "--first-step", "0"]) == 2
    assert "first_step must be greater than 0" in capsys.readouterr().err
