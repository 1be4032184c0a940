"""Frobenius' condition on constraints between velocities."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.equations.derivation.integrability import integrable


def found(constraint: str, coordinates: str = "x, y, z") -> bool | None:
    names = coordinates.split(", ")
    initial = ", ".join(f"{n}: {{guess: 0.5}}, {n}': {{guess: 0}}" for n in names)
    equations = lagcli.derive(
        lagcli.load_text(f"""
coordinates: [{coordinates}]
parameters: {{a: 0.7}}
T: {" + ".join(f"{n}'^2" for n in names)}
constraints: {{c: "{constraint}"}}
initial: {{{initial}}}
""")
    )
    (only,) = equations.constraints
    return integrable(only, equations)


@pytest.mark.parametrize(
    "constraint",
    [
        "x' = a*y'",  # x = a y + const
        "y*x' + x*y' = 0",  # x y = const
        "y*x' - x*y' = 0",  # x/y = const, by an integrating factor
        "x*x' + y*y' + z*z' = sin(t)",
        "exp(z)*(x' + y') = 0",
        "2*sin(x)*cos(x)*y' = sin(2*x)*z'",  # does not cancel before numbers are tried
    ],
)
def test_derivatives_of_positions_are_integrable(constraint: str) -> None:
    assert found(constraint) is True


@pytest.mark.parametrize(
    "constraint",
    [
        "x' = y*z'",  # the contact form
        "cos(z)*x' + sin(z)*y' = 0",  # a knife edge
        "x' = x*y*t + y'",  # the drift counts as well
    ],
)
def test_velocities_alone_are_restricted_otherwise(constraint: str) -> None:
    assert found(constraint) is False


@pytest.mark.parametrize(
    "constraint",
    [
        "x' = floor(z)*y'",  # leaves all positions accessible, by paths across z = 1
        "x' = step(t - 0.5)*y'",
        "x' = if(z > 0, 1, 2)*y'",
        "x' = max(z - 2, 0)*y'",  # zero on one branch
        "(1 + step(z))*x' = y'",
    ],
)
def test_branches_of_other_variables_are_not_tested(constraint: str) -> None:
    assert found(constraint) is None


def test_branches_of_their_own_variable_do_not_matter() -> None:
    assert found("x' = abs(y)*y' + floor(t)") is True
    assert found("max(x - 2, 0)*x' + z*y' = z'") is False
    assert found("x' = max(z, 0)*y'") is False


def test_too_many_variables_are_not_tested() -> None:
    names = [f"q{i}" for i in range(15)]
    terms = " + ".join(f"{n}'" for n in names)
    assert found(f"{terms} = 0", ", ".join(names)) is None
