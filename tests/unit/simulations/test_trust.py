"""A result that cannot be trusted says so; one that can does not."""

from __future__ import annotations

import json
import math
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
from lagcli.simulations.trust import Trust, undefined_rows
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

PASSING = """
coordinates: [x, y]
parameters: {w: 7.3e-4, F: 8.98}
T: x'^2/2 + y'^2/2
Q: {x: F*(1/(1+exp(-(x - y + 1)/w)) - 1/(1+exp(1-(x - y + 1)/w)))}
initial: {x: 0, x': 0, y: -10, y': 1.637}
simulation: {t_end: 7}
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


def test_a_force_passed_within_a_step_is_reported_with_its_remedy() -> None:
    """y moves freely past x, which it pulls within 1 mm only; reference: SciPy, DOP853, 1e-11."""
    model = lagcli.load_text(PASSING)
    (warning,) = lagcli.simulate(model, method="DOP853").warnings
    assert warning.endswith("or a --max-step if a force acts for less than a step")
    resolved = lagcli.simulate(model, method="DOP853", max_step=1e-3)
    assert resolved.warnings == ()
    assert resolved.v[-1, 0] == pytest.approx(4.00943052e-3, rel=1e-8)


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
    ones = np.ones(1)
    columns: Any = SimpleNamespace(scale_position=ones, scale_velocity=ones, reach=ones)

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


OSCILLATOR = """
coordinates: [x]
parameters: {a: 1.5}
T: x'^2/2
V: x^2/2
initial: {x: 1, x': 0}
simulation: {t_end: 5, samples: 101}
"""
FOUND = Path(__file__).parents[2] / "found"


@pytest.mark.parametrize("method", ["DOP853", "Taylor", "Radau"])
def test_a_direction_cosine_of_a_spinning_body(method: str) -> None:
    text = (FOUND / "nan_output.yaml").read_text()
    text = text.replace("outputs: {", 'outputs: {other: "sqrt(1 - e[3,3]^2)", ')
    found = lagcli.simulate(lagcli.load_text(text), method=method)
    assert found.warnings == ()
    # e[3,3] is 1 within the residual of the unit length, 1e-14, of which acos takes the root
    for name in ("tilt", "other"):
        assert np.abs(found.outputs[name]).max() < 1e-6


@pytest.mark.parametrize("law", ["poisson", "newton"])
def test_rounding_errors_of_a_body_that_comes_to_rest_are_no_violation(law: str) -> None:
    """All terms of its constraints are rounding errors of the velocities before the impacts."""
    run = lagcli.simulate(lagcli.load(FOUND / "rest_warning.yaml"), t_end=1e-3, impacts=law)
    assert (run.status, run.warnings) == ("completed", ())
    assert np.abs(run.q).max() <= 1e-15
    k = run.constraints.index("b")
    for level in ("position", "velocity"):
        residual = getattr(run, f"residual_{level}")[:, k]
        assert np.abs(residual).max() <= 1e-12 * getattr(run, f"scale_{level}")[k]


def test_rounding_errors_of_a_body_that_stays_at_rest_are_no_violation() -> None:
    """Its weight changes the velocities by rounding errors, in a step."""
    text = """
coordinates: [x, y]
T: 0.301*(x'^2 + y'^2)
V: 4.11*y + 1.3*x
constraints:
  left: {expr: 0.7*x + 0.9*y >= 0}
  right: {expr: -1.3*x + 0.31*y >= 0}
  both: {expr: -0.6*x + 1.21*y >= 0}
initial: {x: 0, y: 0, x': 0, y': 0}
simulation: {t_end: 1, samples: 3}
"""
    run = lagcli.simulate(lagcli.load_text(text))
    assert (run.status, run.warnings) == ("completed", ())


@pytest.mark.parametrize("start", [1.0, 1e-30])
@pytest.mark.parametrize(("end", "diverges"), [(20, True), (10, False)])
def test_a_motion_that_diverges(start: float, end: int, *, diverges: bool) -> None:
    """x = x₀ cosh(10 t) grows by 3.6e86 in 20 s; by 1.3e43 in 10 s, as a perturbation may."""
    run = lagcli.simulate(
        lagcli.load_text(f"""
coordinates: {{x: m}}
T: x'^2/2
V: -50*x^2
initial: {{x: {start}, x': 0}}
simulation: {{t_end: {end}, samples: 3}}
""")
    )
    assert run.status == "completed"
    largest = f"the motion diverges: `x` grows to {start * math.cosh(10 * end):.2g}"
    assert [x.split(";")[0] for x in run.warnings] == [largest] * diverges


def test_a_perturbation_that_grows_is_no_divergence() -> None:
    """A start at an equilibrium reaches nothing, so that all growth would be infinite."""
    run = lagcli.simulate(
        lagcli.load_text("""
coordinates: {x: m}
T: x'^2/2
V: -50*x^2
initial: {x: 0, x': 0}
events: {kick: {when: t >= 1, set: {x': 1e-17}}}
simulation: {t_end: 5, samples: 3}
""")
    )
    assert (run.status, run.warnings) == ("completed", ())


def test_an_output_beyond_its_domain() -> None:
    text = OSCILLATOR + "outputs: {tilt: acos(a*x), wall: 1/(x - 1)}"
    found = lagcli.simulate(lagcli.load_text(text))
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


@pytest.mark.parametrize("rtol", [1e-9, 1e-12])
@pytest.mark.parametrize(("length", "end"), [(1.0, 1e3), (2e-3, 100.0), (2e-3, 1e4)])
def test_a_pendulum_at_rest_has_no_warning(length: float, end: float, rtol: float) -> None:
    # one step of any length, within which rounding errors of the tension do work
    text = (
        f"coordinates: [x, y]\nparameters: {{m: 0.011, L: {length}}}\nT: m/2*(x'^2 + y'^2)\n"
        "V: 9.81*m*y\nconstraints: {rod: x^2 + y^2 = L^2}\n"
        "initial: {x: 0, y: {guess: -L}, x': 0, y': {guess: 0}}\n"
    )
    assert lagcli.simulate(lagcli.load_text(text), t_end=end, rtol=rtol).warnings == ()


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
