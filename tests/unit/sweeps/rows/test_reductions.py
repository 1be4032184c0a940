"""Measures of rows, against NumPy on the trajectories that `simulate` gives."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.errors import LagcliError
from lagcli.model.measures import read_measures
from lagcli.settings.settings import SettingsOverrides
from lagcli.sweeps.plan.plan import Spec, make_plan
from lagcli.sweeps.row_results import COMPLETED, ERROR, FAILED
from lagcli.sweeps.rows.rows import run_rows
from lagcli.trajectory.trajectory import Trajectory

MODELS = Path(__file__).parents[4] / "models"
CRANK = MODELS / "slider_crank.yaml"


def spec(
    model: Path | str,
    vary: Sequence[str],
    measures: Sequence[str],
    keep: str = "measures",
    sample: str | None = None,
    **settings: object,
) -> Spec:
    text = model.read_text() if isinstance(model, Path) else model
    plan = make_plan(lagcli.load_text(text), vary, sample)
    named = tuple((x, x) for x in measures)
    return Spec(text, "model.yaml", {}, {}, SettingsOverrides(**settings), plan, named, keep)  # type: ignore[arg-type]


SHORT = {"t_end": 1.0, "samples": 101, "rtol": 1e-8}
#: Runs in lanes and single ones estimate the size of accelerations by different means, and their
#: steps differ; at this tolerance their results do not.
ACCURATE = {**SHORT, "rtol": 1e-12}

MEASURES = {
    "max(abs(lambda.guide))": lambda r: np.abs(r.multipliers[:, 0]).max(),
    "min(lambda.guide)": lambda r: r.multipliers[:, 0].min(),
    "max(phi) - min(phi)": lambda r: np.ptp(r.q[:, 0]),
    "max(phi)/l": lambda r: r.q[:, 0].max() / r.parameters["l"],
    "mean(phi')": lambda r: np.trapezoid(r.v[:, 0], r.time) / (r.time[-1] - r.time[0]),
    "rms(phi_dot)": lambda r: np.sqrt(np.trapezoid(r.v[:, 0] ** 2, r.time) / r.time[-1]),
    "final(psi)": lambda r: r.q[-1, 1],
    "argmax(lambda.guide)": lambda r: r.time[r.multipliers[:, 0].argmax()],
    "argmin(psi)": lambda r: r.time[r.q[:, 1].argmin()],
    "time_of(phi > pi)": lambda r: r.time[np.argmax(r.q[:, 0] > np.pi)],
    "time_of(phi > 100)": lambda r: np.nan,
    "at(phi, 0.25)": lambda r: r.q[25, 0],
    "final(phi'')": lambda r: r.a[-1, 0],
    "max(x_B)": lambda r: r.outputs["slider"].max(),
    "max(slider)": lambda r: r.outputs["slider"].max(),
    "final(x_B')": lambda r: (
        -(
            r.parameters["r"] * np.sin(r.q[-1, 0]) * r.v[-1, 0]
            + r.parameters["l"] * np.sin(r.q[-1, 1]) * r.v[-1, 1]
        )
    ),
    "min(Qc.guide.phi)": lambda r: r.constraint_force_of("guide")[:, 0].min(),
    "max(Qc.psi)": lambda r: r.constraint_force[:, 1].max(),
    "final(energy_total)": lambda r: r.energy_total[-1],
    "max(energy_kinetic)": lambda r: r.energy_kinetic.max(),
    "min(energy_potential)": lambda r: r.energy_potential.min(),
    "max(abs(energy_balance))": lambda r: np.abs(r.energy_balance).max(),
    "mean(power_applied)": lambda r: np.trapezoid(r.power_applied, r.time) / r.time[-1],
    "max(power_constraint)": lambda r: r.power_constraint.max(),
    "max(power_time)": lambda r: 0.0,
    "max(power_friction)": lambda r: 0.0,
    "max(t)": lambda r: 1.0,
    "max(max(phi, 10*psi))": lambda r: np.maximum(r.q[:, 0], 10 * r.q[:, 1]).max(),
    "max(if(psi > 0, phi, 0))": lambda r: np.where(r.q[:, 1] > 0, r.q[:, 0], 0).max(),
    "sqrt(max(phi)^2 + m)": lambda r: np.hypot(r.q[:, 0].max(), np.sqrt(r.parameters["m"])),
}


@pytest.fixture(scope="module")
def crank() -> tuple[np.ndarray, list[Trajectory]]:
    sweep = spec(CRANK, ["l=0.2,0.3", "phi'=11,12", "c=0.1"], list(MEASURES), **ACCURATE)
    sweep = pickle.loads(pickle.dumps(sweep))
    results = run_rows(sweep, np.arange(4))
    assert (results.status == COMPLETED).all()
    runs = []
    for l, rate, c in sweep.plan.rows(np.arange(4)):
        model = lagcli.load(CRANK, set={"l": l, "c": c}, set_initial={"phi'": rate})
        runs.append(lagcli.simulate(model, **ACCURATE))
    return results.measures, runs


@pytest.mark.parametrize("text", MEASURES)
def test_measures_are_what_they_say(crank: tuple, text: str) -> None:
    measures, runs = crank
    place = list(MEASURES).index(text)
    for found, run in zip(measures[:, place], runs, strict=True):
        expected = MEASURES[text](run)
        # a balance is all error
        error = 1e-11 * max(1.0, abs(expected))
        assert found == pytest.approx(expected, rel=1e-8, abs=error, nan_ok=True)


def test_at_looks_between_samples_too() -> None:
    sweep = spec(CRANK, ["m=1"], ["at(phi, 0.123)", "max(t)", "mean(1 + 0*t)"], **SHORT)
    found = run_rows(sweep, np.arange(1)).measures[0]
    run = lagcli.simulate(lagcli.load(CRANK), t_end=1.0, times=(0.0, 0.123, 1.0), rtol=1e-8)
    assert found[0] == pytest.approx(run.q[1, 0], rel=1e-7)  # the runs' own tolerance
    assert found[1:].tolist() == pytest.approx([1.0, 1.0], rel=1e-14)


def test_residuals_are_those_of_the_equations() -> None:
    names = ["residual_position", "residual_velocity", "residual_equation"]
    asked = [f"max({name})" for name in names] + ["max(abs(residual_position.guide))"]
    index1 = {**SHORT, "formulation": "index1"}  # drifts, so that there is something to see
    found = run_rows(spec(CRANK, ["m=1"], asked, **index1), np.arange(1)).measures[0]
    run = lagcli.simulate(lagcli.load(CRANK), **index1)
    expected = [np.abs(getattr(run, name)).max() for name in names]
    assert expected[0] > 1e-12
    assert found[:2] == pytest.approx(expected[:2], rel=1e-3)
    assert found[2] < 1e-12
    assert found[3] == found[0]


def test_rows_do_not_depend_on_each_other() -> None:
    sweep = spec(CRANK, ["m=1:2:0.1", "phi'=0.5:14:4"], ["rms(phi')", "max(lambda.guide)"], **SHORT)
    n = sweep.plan.length
    whole = run_rows(sweep, np.arange(n))
    assert len(set(whole.measures[:, 0].tolist())) > n // 2
    for numbers in ([0], [n - 1, 3], list(range(5, 20))):
        some = run_rows(sweep, np.array(numbers))
        assert np.array_equal(some.measures, whole.measures[numbers])
        assert np.array_equal(some.counts, whole.counts[numbers])


def test_what_depends_on_a_varied_parameter_follows_it() -> None:
    text = CRANK.read_text().replace("r: {value: 0.1 m,", "r: {value: l/3, unit: m,")
    text = text.replace("  g: 9.81 m/s^2", "  g: 9.81 m/s^2\n  w: 36 rad/s")
    text = text.replace("phi': 12 rad/s", "phi': w*r/l")
    found = run_rows(spec(text, ["l=0.3,0.6"], ["at(phi', 0)", "max(r)"], **SHORT), np.arange(2))
    assert found.measures == pytest.approx(np.array([[12.0, 0.1], [12.0, 0.2]]), rel=1e-15)


def test_structures_are_derived_each() -> None:
    chain = MODELS / "chain.yaml"
    sweep = spec(chain, ["N=2,3", "g=9.81,5"], ["min(energy_potential)", "max(x[2])"], t_end=0.2)
    results = run_rows(sweep, np.arange(4))
    assert results.messages == [""] * 4
    for row, (count, g) in zip(results.measures, sweep.plan.rows(np.arange(4)), strict=True):
        model = lagcli.load(chain, set={"N": int(count), "g": g})
        run = lagcli.simulate(model, t_end=0.2)
        assert row[0] == pytest.approx(run.energy_potential.min(), rel=1e-7)
        x = run.q[:, run.coordinates.index("x[2]")]
        assert row[1] == pytest.approx(x.max(), rel=1e-7)


def test_settings_made_of_a_parameter_follow_it() -> None:
    text = CRANK.read_text().replace("t_end: 3,", "t_end: l/v,")
    text = text.replace("parameters:\n", "parameters:\n  v: 0.125 m/s\n")
    results = run_rows(spec(text, ["l=0.2,0.3"], ["max(t)"]), np.arange(2))
    assert results.measures[:, 0].tolist() == [1.6, 2.4]


def test_a_bad_row_is_a_row_with_a_message() -> None:
    sweep = spec(CRANK, ["m=0,1", "psi=0.3,0.9", "g=9.81"], ["max(phi)"], **SHORT)
    results = run_rows(sweep, np.arange(4))
    assert results.status.tolist() == [ERROR, ERROR, ERROR, ERROR]
    assert "violate the constraint `guide`" in results.messages[0]
    results = run_rows(spec(CRANK, ["m=0,1"], ["max(phi)"], **SHORT), np.arange(2))
    assert results.status.tolist() == [FAILED, COMPLETED]
    assert "no inertia" in results.messages[0]
    assert np.isnan(results.measures[0, 0])
    assert results.counts[0].tolist() == [0, 0, 0]


def test_a_value_that_the_model_cannot_have_is_explained() -> None:
    text = CRANK.read_text().replace("r: {value: 0.1 m,", "r: {value: 0.1/(l - 0.2), unit: m,")
    results = run_rows(spec(text, ["l=0.2,1.2"], ["max(r)"], **SHORT), np.arange(2))
    assert results.status.tolist() == [ERROR, COMPLETED]
    assert "error[not-a-number]: this is infinite" in results.messages[0]


def test_limits_end_a_row_and_keep_what_was_reached() -> None:
    sweep = spec(CRANK, ["m=1,2"], ["max(phi)"], "trajectories", max_steps=30, **SHORT)
    results = run_rows(sweep, np.arange(2))
    assert results.status.tolist() == [FAILED, FAILED]
    assert "--max-steps" in results.messages[0]
    assert np.isnan(results.measures).all()
    reached = ~np.isnan(results.kept[0, :, 0])
    assert 1 < reached.sum() < 101
    whole = lagcli.simulate(lagcli.load(CRANK), **SHORT)
    assert results.kept[0, reached, 0] == pytest.approx(whole.q[reached, 0], rel=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("phi", "varies along the run"),
        ("max(phi) + t", "varies along the run"),
        ("l + lambda.guide", "varies along the run"),
        ("max(phii)", "did you mean `phi`"),
        ("max(max(phi))", "combine them outside"),
        ("max(phi > 1)", "condition"),
        ("time_of(phi)", "condition"),
        ("at(phi, m)", "is a number"),
        ("at(phi)", "at(EXPRESSION, TIME)"),
        ("max(residual_position.rod)", "its constraints are guide"),
        ("max(lambda.rod)", "rod"),
        ("max(phi", "`(` is not closed"),
        ("", "missing"),
        ("mean(1/0)", "division by zero"),
        ("max([phi, psi])", "not a vector"),
        ("exec(phi)", "there is no function"),
        ("median(phi)", "there is no function"),
    ],
)
def test_wrong_measures_point_to_the_place(text: str, said: str) -> None:
    model = lagcli.load(CRANK)
    with pytest.raises(LagcliError) as error:
        read_measures(model, [("name", text)])
    assert "--measure name" in str(error.value)
    assert said in str(error.value)
    assert "^" in str(error.value) or not text


def test_a_nonholonomic_constraint_has_no_position() -> None:
    sweep = spec(MODELS / "knife_edge_incline.yaml", ["g=9,10"], [], t_end=0.1)
    name = lagcli.load_text(sweep.text).constraint_names[0]
    asked = Spec(**{**vars(sweep), "measures": (("x", f"max(residual_position.{name})"),)})
    results = run_rows(asked, np.arange(1))
    assert results.status.tolist() == [ERROR]
    assert f"residual_velocity.{name}" in results.messages[0]
