"""Integrability of the velocity constraints of a model, alone and together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import symengine as se

import lagcli
from lagcli.analysis.check.integrability import VelocityConstraint

MODELS = Path(__file__).parents[4] / "models"


def checked(constraints: str, coordinates: str = "x, y, z") -> dict[str, VelocityConstraint]:
    names = coordinates.split(", ")
    initial = ", ".join(f"{n}: {{guess: 0.5}}, {n}': {{guess: 0.1}}" for n in names)
    text = f"""
coordinates: [{coordinates}]
parameters: {{a: 0.7}}
T: {" + ".join(f"{n}'^2" for n in names)}
constraints: {{{constraints}}}
initial: {{{initial}}}
"""
    return dict(lagcli.check(lagcli.load_text(text)).velocity_constraints)


@pytest.mark.parametrize(
    "constraint",
    ["x' = y'", "x' = a*y'", "y*x' = x*y'", "y*x' + x*y' = 0", "x*x' + y*y' = cos(t)"],
)
def test_integrals_are_found_and_the_run_keeps_them(constraint: str) -> None:
    found = checked(f'c: "{constraint}"')["c"]
    assert found.integrable == "alone"
    assert found.integral is not None
    text = f"""
coordinates: [x, y, z]
parameters: {{a: 0.7}}
T: x'^2 + y'^2 + z'^2
V: x*y + z
constraints: {{c: "{constraint}"}}
initial:
  {{x: 0.5, y: 0.6, z: 0, x': {{guess: 0.3}}, y': {{guess: 0.2}}, z': 0}}
"""
    run = lagcli.simulate(lagcli.load_text(text), t_end=1.0, samples=11, rtol=1e-11)
    names = [*map(se.Symbol, ("x", "y", "z", "t", "a"))]
    function = se.Lambdify(names, [found.integral.expression])
    inputs = np.column_stack([run.q, run.time, np.full(11, 0.7)])
    values = np.array([function(row)[0] for row in inputs])
    assert np.ptp(run.q[:, 0]) > 1e-2
    assert np.ptp(values) < 1e-9


def test_a_knife_edge_is_not_integrable() -> None:
    found = lagcli.check(lagcli.load(MODELS / "knife_edge_incline.yaml")).velocity_constraints
    assert found["skate"].integrable == "no"
    assert found["skate"].integral is None


def test_a_knife_edge_in_a_straight_groove_is() -> None:
    found = checked("knife: y'*cos(z) = x'*sin(z), groove: z = 0.5")
    assert found["knife"].integrable == "together"
    assert "groove" not in found


def test_two_contact_forms_are_not() -> None:
    found = checked("c: \"x' = y*z'\", d: \"w' = u*z'\"", "x, y, z, u, w")
    assert {x.integrable for x in found.values()} == {"no"}


def test_a_disk_that_rolls_straight_on_is_integrable_with_its_heading() -> None:
    found = checked("roll: x' = a*cos(y)*z', heading: y' = 0")
    assert found["heading"].integrable == "alone"
    assert found["roll"].integrable == "together"
