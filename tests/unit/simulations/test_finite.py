"""Columns that are not finite are reported, with their number and the first time."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.cli.app import run
from lagcli.settings.resolve import compiled_available
from lagcli.simulations.finite import undefined_rows

ENGINES = ["compiled", "scipy"] if compiled_available() else ["scipy"]
OSCILLATOR = """
coordinates: [x]
parameters: {a: 1.5}
T: x'^2/2
V: x^2/2
initial: {x: 1, x': 0}
simulation: {t_end: 5, samples: 101}
"""
FOUND = Path(__file__).parents[2] / "found"


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", ["DOP853", "Taylor", "Radau"])
def test_a_direction_cosine_of_a_spinning_body(engine: str, method: str) -> None:
    if engine == "scipy" and method == "Taylor":
        pytest.skip("not a method of this engine")
    text = (FOUND / "nan_output.yaml").read_text()
    text = text.replace("outputs: {", 'outputs: {other: "sqrt(1 - e[3,3]^2)", ')
    found = lagcli.simulate(lagcli.load_text(text), engine=engine, method=method)
    assert found.warnings == ()
    # e[3,3] is 1 within the residual of the unit length, 1e-14, of which acos takes the root
    for name in ("tilt", "other"):
        assert np.abs(found.outputs[name]).max() < 1e-6


@pytest.mark.parametrize("engine", ENGINES)
def test_an_output_beyond_its_domain(engine: str) -> None:
    text = OSCILLATOR + "outputs: {tilt: acos(a*x), wall: 1/(x - 1)}"
    found = lagcli.simulate(lagcli.load_text(text), engine=engine)
    bad = np.abs(1.5 * np.cos(found.time)) > 1
    tilt, wall = found.warnings
    assert tilt == f"`tilt` is NaN at {bad.sum()} of 101 samples, first at t = 0"
    assert wall == "`wall` is infinite at 1 of 101 samples, first at t = 0"
    np.testing.assert_array_equal(np.isnan(found.outputs["tilt"]), bad)


def test_many_outputs_are_counted() -> None:
    outputs = ", ".join(f"o{k}: acos(2*x)" for k in range(9))
    found = lagcli.simulate(lagcli.load_text(OSCILLATOR + f"outputs: {{{outputs}}}"))
    assert len(found.warnings) == 6
    assert found.warnings[-1] == "4 more columns are not finite at some samples"


def test_the_residuals_of_an_open_contact_are_no_warning() -> None:
    text = """
coordinates: [y]
T: y'^2/2
V: 9.81*y
constraints: {floor: {expr: y >= 0, restitution: 0.5}}
initial: {y: 1, y': 0}
simulation: {t_end: 1}
"""
    found = lagcli.simulate(lagcli.load_text(text))
    assert np.isnan(found.residual_position).any()
    assert found.warnings == ()


def test_strict_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "model.yaml"
    path.write_text(OSCILLATOR + "outputs: {tilt: acos(a*x)}")
    assert run(["simulate", str(path), "--quiet"]) == 0
    assert "warning: `tilt` is NaN at" in capsys.readouterr().err
    assert run(["simulate", str(path), "--quiet", "--strict"]) == 3
    assert "error: `tilt` is NaN at" in capsys.readouterr().err


def test_rows_of_a_sweep() -> None:
    signals = np.ones((3, 2, 4))
    signals[1, 1, 2:] = math.nan
    signals[2, 0, 3] = math.inf
    assert undefined_rows(["u", "w"], np.arange(4.0), signals) == {
        1: "`w` is NaN at 2 of 4 samples, first at t = 2",
        2: "`u` is infinite at 1 of 4 samples, first at t = 3",
    }
