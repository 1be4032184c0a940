"""Derivatives of consistent starts, and what they need."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.engine.sensitivity.switched_run import SwitchedProblem
from lagcli.errors import ModelError, UsageError
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.sensitivity import Sensitivity
from lagcli.simulations.simulation import Simulation, prepare

FOUND = Path(__file__).parents[2] / "found"
CIRCLE = """
coordinates: [x, y]
parameters: {{l: 2, F: 1}}
T: (x'^2 + y'^2)/2
Q: {{x: {force}}}
constraints: {{rod: x^2 + y^2 = l^2}}
initial: {{x: {x}, y: {y}, x': {{guess: 0}}, y': {{guess: 0}}}}
"""


def derivatives(names: tuple[str, ...], **entries: str) -> tuple[Simulation, np.ndarray]:
    """Return a simulation, and ∂q/∂θ at its start."""
    given = {"force": "F", "x": "{guess: 1}", "y": "1.2", **entries}
    run = prepare(lagcli.load_text(CIRCLE.format(**given)), SettingsOverrides(sensitivity=names))
    assert run.sensitivity is not None
    scales = run.sensitivity.sensitivity.directions.scales
    return run, run.sensitivity.start.q / scales[:, None]


def test_a_start_that_the_constraints_determine_follows_them() -> None:
    # x = √(l² − y²) = 1.6
    run, found = derivatives(("l", "y", "F"))
    np.testing.assert_allclose(found, [[2 / 1.6, 0], [-1.2 / 1.6, 1], [0, 0]], atol=1e-14)
    assert run.sensitivity is not None
    assert run.sensitivity.sensitivity.determined(run.start) is False  # x' and y' are free


def test_a_start_that_is_chosen_has_the_derivatives_of_the_choice() -> None:
    # the nearest point of the circle to (3, 4): (0.6, 0.8) l
    run, found = derivatives(("l",), x="{guess: 3}", y="{guess: 4}")
    assert run.sensitivity is not None
    assert not run.sensitivity.sensitivity.determined(run.start)
    # differences of sixth order with a step of 2e-3
    np.testing.assert_allclose(found, [[0.6, 0.8]], rtol=1e-9)


def test_a_start_near_another_stays_on_its_branch() -> None:
    run, _ = derivatives(("l",), x="{guess: -1}")
    assert run.sensitivity is not None
    sensitivity = run.sensitivity.sensitivity
    given = sensitivity.directions.state(0.0, [1.25])
    assert sensitivity.consistent(given, run.start).state.q[0] == pytest.approx(-0.35)


def test_fixed_values_that_hold_for_one_value_alone() -> None:
    with pytest.raises(ModelError, match="for this value of `l` only") as error:
        derivatives(("l",), x="1.6")
    (found,) = error.value.diagnostics
    assert "`x: {guess: 1.6}`" in found.help
    # nothing is free that could follow
    with pytest.raises(ModelError) as error:
        derivatives(("x", "y"), x="1.6")
    assert "name other quantities than `" in error.value.diagnostics[0].help


@pytest.mark.parametrize("name", ["l4", "l2", "e3"])
def test_a_constraint_that_does_not_change_with_a_parameter(name: str) -> None:
    """Neither `O` nor its coordinates depend on the last bars: only rounding errors do."""
    text = (FOUND / "press.yaml").read_text(encoding="utf-8")
    model = lagcli.load_text(text)
    found = lagcli.simulate(model, t_end=0.01, samples=2, sensitivity=(name,))
    assert found.dq is not None
    assert found.dv is not None
    value, step = model.parameters[name].value, 1e-5
    beside = [
        prepare(lagcli.load_text(text, set={name: f"{value + h!r} m"})).start.state
        for h in (-step, step)
    ]
    for derivative, (low, high) in (
        (found.dq[0, :, 0], [x.q for x in beside]),
        (found.dv[0, :, 0], [x.v for x in beside]),
    ):
        exact = (high - low) / (2 * step)
        # differences of second order with steps of 1e-5/0.4
        np.testing.assert_allclose(derivative, exact, rtol=0, atol=1e-7 * np.abs(exact).max())


@pytest.mark.parametrize(
    ("force", "jumps"),
    [
        ("F*abs(x)", False),  # a kink is no jump
        ("F*floor(x)", True),
        ('"if(t < F, 1, 0)"', True),
    ],
)
def test_where_forces_jump_derivatives_do(force: str, jumps: bool) -> None:
    run, _ = derivatives(("F",), force=force)
    assert run.sensitivity is not None
    assert isinstance(run.sensitivity.sensitivity.problem, SwitchedProblem) == jumps


def test_methods_that_need_exact_jacobians_are_rejected() -> None:
    run, _ = derivatives(("l",))
    settings = run.settings.replace(method="Rodas5P")
    with pytest.raises(UsageError, match="give --method Radau"):
        Sensitivity(run.equations, run.system, settings, ("l",))
