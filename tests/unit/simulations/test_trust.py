"""A result that cannot be trusted says so; one that can does not."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.cli.app import run
from lagcli.results import read
from lagcli.simulations.simulation import prepare
from lagcli.simulations.trust import Trust
from lagcli.trajectory.samples import Samples

ROOT = Path(__file__).parents[3]
MODELS = sorted((ROOT / "models").rglob("*.yaml"))

FAST = """
name: a fast oscillator
coordinates: [x]
parameters: {w: 20}
T: x'^2/2
V: w^2*x^2/2
initial: {x: 1, x': 0}
simulation: {t_end: 20, samples: 101}
"""
NEGATIVE = """
name: a sign is wrong
coordinates: [x, y]
T: x'^2/2 - y'^2/2
V: x^2/2 - 2*y^2
initial: {x: 1, y: 1, x': 0, y': 0}
simulation: {t_end: 1, samples: 3}
"""


@pytest.mark.parametrize("path", MODELS, ids=lambda p: p.stem)
def test_shipped_models_are_trusted(path: Path) -> None:
    end = 0.1 * (lagcli.load(path).settings.t_end or 10.0)
    assert lagcli.simulate(lagcli.load(path), t_end=end, samples=21).warnings == ()


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("method", ["DOP853", "Rodas5P", "Radau"])
def test_what_a_tolerance_explains_is_no_warning(method: str, rtol: float) -> None:
    end = 0.5 if rtol < 1e-10 else 2.0
    run = lagcli.simulate(lagcli.load_text(FAST), method=method, rtol=rtol, t_end=end, samples=21)
    assert run.warnings == ()


def test_lost_energy_is_reported() -> None:
    run = lagcli.simulate(lagcli.load_text(FAST), rtol=0.1)
    assert run.status == "completed"
    assert any("energy balance has an error of" in warning for warning in run.warnings)


@pytest.mark.parametrize("rtol", [0.1, 0.01])
def test_lost_energy_is_reported_of_angles_of_many_turns(rtol: float) -> None:
    """A tolerance relative to an angle of 30 rad excuses no loss of energy."""
    run = lagcli.simulate(lagcli.load(ROOT / "models" / "slider_crank.yaml"), rtol=rtol)
    share = abs(run.energy_balance).max() / run.energy_kinetic.max()
    said = any("energy balance has an error of" in warning for warning in run.warnings)
    assert said == (share > 0.01)
    assert (share > 0.01) == (rtol == 0.1)


@pytest.mark.parametrize(
    "energies", ['T: x\'^2/2\nV: "if(x > 0, 0.2, 0)"', 'T: "if(x > 0, 2, 1)/2*x\'^2"']
)
def test_energies_that_jump_are_reported(energies: str) -> None:
    text = f"coordinates: [x]\n{energies}\ninitial: {{x: -1, x': 1}}\n"
    (warning,) = lagcli.simulate(lagcli.load_text(text), t_end=2.0).warnings
    assert "T or V has branches, and no force makes up for a jump of them" in warning


def test_a_coarse_absolute_tolerance_is_reported() -> None:
    run = lagcli.simulate(lagcli.load_text(FAST), atol=0.1)
    assert any("energy balance has an error of" in warning for warning in run.warnings)


def test_negative_inertia_is_reported_with_its_coordinate() -> None:
    (warning,) = lagcli.simulate(lagcli.load_text(NEGATIVE)).warnings
    assert "inertia of `y` is negative" in warning


def test_inertia_that_constraints_make_positive_is_no_warning() -> None:
    model = NEGATIVE.replace("initial:", "constraints: {c: x = 2*y}\ninitial:")
    model = model.replace("y: 1, x'", "y: 0.5, x'")
    assert lagcli.simulate(lagcli.load_text(model)).warnings == ()


CANCELLING = """
name: T, V and their sum are zero
coordinates: [x, y]
parameters: {w: 3}
T: x'^2/2 - y'^2/2
V: w^2*x^2/2 - w^2*y^2/2
initial: {x: 1, y: 1, x': 0, y': 0}
simulation: {t_end: 5, samples: 101}
"""
HELD = """
name: a body that cannot move
coordinates: [x, y]
parameters: {m: 1, g: 9.81, l: 0.3}
T: m*(x'^2 + y'^2)/2
V: m*g*(y + l*cos(0.7))
constraints: {rod: x^2 + y^2 = l^2, side: x = l*sin(0.7)}
initial: {x: {guess: 0.19}, y: {guess: -0.3}, x': 0, y': 0}
simulation: {t_end: 5, samples: 101}
"""


@pytest.mark.parametrize("method", ["DOP853", "Radau"])
def test_energies_that_cancel_are_no_warning(method: str) -> None:
    run = lagcli.simulate(lagcli.load_text(CANCELLING), method=method)
    assert 0 < abs(run.energy_balance).max() < 1e-14
    (warning,) = run.warnings
    assert "inertia of `y` is negative" in warning


@pytest.mark.parametrize("method", ["DOP853", "Radau"])
def test_what_cannot_move_is_trusted(method: str) -> None:
    assert lagcli.simulate(lagcli.load_text(HELD), method=method).warnings == ()


@pytest.mark.parametrize("suffix", ["h5", "csv"])
def test_a_warning_is_kept_and_strict_is_status_3(
    tmp_path: Path, suffix: str, capsys: pytest.CaptureFixture[str]
) -> None:
    model, target = tmp_path / "negative.yaml", tmp_path / f"run.{suffix}"
    model.write_text(NEGATIVE)
    command = ["simulate", str(model), "-o", str(target), *(["--meta"] if suffix == "csv" else [])]
    assert run([*command, "--json"]) == 0
    said = capsys.readouterr()
    assert "warning: the inertia of `y`" in said.err
    (warning,) = json.loads(said.out)["warnings"]
    assert read(target).warnings == (warning,)
    assert run(["info", str(target)]) == 0
    assert "warning" in capsys.readouterr().out
    assert run([*command, "--strict", "--force"]) == 3


ROD = """
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {rod: x^2 + y^2 = 1}
initial: {x: 1, y: 0, x': 0, y': 0}
simulation: {t_end: 1, samples: 5, rtol: 1e-9}
"""


def test_trust_is_in_the_samples_alone() -> None:
    run = prepare(lagcli.load_text(ROD))
    blocks: list[Samples] = []
    run.run(blocks.append)
    columns: Any = SimpleNamespace(scale_position=np.ones(1), scale_velocity=np.ones(1))

    def said(**changes: np.ndarray) -> tuple[str, ...]:
        trust = Trust(run.system, run.start.state.p)
        for block in blocks:
            trust.add(replace(block, **changes))
        return trust.warnings(run.settings, 50, columns)

    assert said() == ()
    # three times the tolerance in each of 50 steps is explained: 1.5e-7 of some 10 J
    off = np.array([0, 0, 0, 0, 1e-6])
    assert said(energy_balance=off) == ()
    (warning,) = said(energy_balance=10 * off)
    assert "the energy balance has an error of 1e-05 J" in warning
    (warning,) = said(residual_position=np.full((5, 1), 2e-9))
    assert warning == "the constraint `rod` is violated by 2e-09 of its terms"
