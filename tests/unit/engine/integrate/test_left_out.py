"""Redundant constraints that the elimination leaves out: the motion and λ of the dense solution.

Those of small models too, which are solved densely otherwise.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.engine.integrate import prepared, run
from lagcli.model.model import Model
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare
from tests.support import oracle
from tests.support.redundant_systems import check_like_dense, random_manifold, random_platform
from tests.support.shipped import PATHS

FOUND = Path(__file__).parents[3] / "found"


@pytest.fixture(autouse=True)
def _left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "LEAST_LEFT_OUT", 0)


@pytest.mark.parametrize("seed", [30, 106])
def test_a_motion_is_that_of_the_dense_solution_and_of_the_oracle(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = lagcli.load_text(random_manifold(seed))
    found = check_like_dense(model, monkeypatch)
    reference = oracle.motion(model, rtol=1e-10, atol=1e-11)
    size = np.abs(reference.q).max(axis=0)
    # the oracle drifts off the constraints
    np.testing.assert_array_less(np.abs(found.q - reference.q).max(axis=0), 1e-6 * size)


@pytest.mark.parametrize("method", ["Taylor", "Radau", "Rodas5P"])
def test_other_methods_leave_out_the_same_rows(
    method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    check_like_dense(lagcli.load_text(random_manifold(20)), monkeypatch, method=method)


def test_rows_that_are_dependent_in_passing_are_joined_by_the_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Cranks turn fully: any two lie in a line with the platform now and then, not all of them."""
    check_like_dense(lagcli.load_text(random_platform(6)), monkeypatch)


def _later(row: str) -> Model:
    return lagcli.load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {{one: x = sin(t), two: "{row}"}}
initial: {{x: {{guess: 0}}, x': {{guess: 1}}, y: 0, y': 0.5}}
""")


@pytest.mark.parametrize(
    "row",
    [
        "2*(x - sin(t)) = 1e-3*max(t - 0.7, 0)^3",  # another right side
        "x - sin(t) + max(t - 0.7, 0)^3*(y + 1) = 0",  # independent, and not met
    ],
)
def test_a_row_that_does_not_follow_any_more_ends_the_run(row: str) -> None:
    found = lagcli.simulate(_later(row), t_end=3, samples=301)
    assert found.status == "failed"
    assert "contradict" in found.message or "brought back onto" in found.message
    assert 0.7 <= found.time[-1] < 0.9
    position = np.abs(found.residual_position / found.scale_position)
    assert position.max() < 1e-6


def test_a_row_that_becomes_independent_and_holds_leaves_the_motion() -> None:
    """The motion satisfies it anyhow: λ of both is 0, however many rows there are."""
    found = lagcli.simulate(_later("x - sin(t) + max(t - 0.7, 0)^3*(x - sin(t))*y = 0"), t_end=2)
    assert found.status == "completed", found.message
    np.testing.assert_allclose(found.q[:, 0], np.sin(found.time), atol=1e-12)
    falls = 0.5 * found.time - 9.81 / 2 * found.time**2
    np.testing.assert_allclose(found.q[:, 1], falls, atol=1e-7)


def test_small_multipliers_of_other_units_are_accurate() -> None:
    """λ_i = c_i λ/(Σ c²): the force of the row in small units is 1e-12 of all."""
    text = """
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {small: 1e-6*(x^2 + y^2 - 1) = 0, rod: x^2 + y^2 = 1}
initial: {x: 1, y: 0, x': 0, y': 0}
"""
    found = lagcli.simulate(lagcli.load_text(text), t_end=1, samples=11)
    small, rod = found.multipliers.T
    np.testing.assert_allclose(small, 1e-6 * rod, rtol=1e-9)


def _eliminates(name: str, **settings: Any) -> bool:
    simulation = prepare(lagcli.load(PATHS[name]), SettingsOverrides(**settings))
    made = run.Integration(simulation.system, simulation.request, lambda block: None, None)
    return made.in_use.elimination is not None


def test_stabilization_without_projection_solves_densely(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing else would bring the rows that are left out back."""
    assert _eliminates("parallelogram")
    assert not _eliminates("parallelogram", formulation="baumgarte")
    monkeypatch.undo()
    assert not _eliminates("parallelogram")


def test_larger_models_leave_them_out_by_themselves(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    simulation = prepare(lagcli.load(FOUND / "bricard_a04.yaml"))
    made = run.Integration(simulation.system, simulation.request, lambda block: None, None)
    plan = made.in_use.elimination
    assert plan is not None
    assert len(plan.left_out(simulation.system)) == 1


@pytest.mark.parametrize("method", ["DOP853", "Taylor"])
@pytest.mark.parametrize("short", [1000, 0], ids=["unrolled", "in a loop"])
def test_loop_and_unrolled_elimination_agree(
    method: str, short: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prepared, "SHORT", short)
    check_like_dense(lagcli.load_text(random_manifold(10)), monkeypatch, method=method)
