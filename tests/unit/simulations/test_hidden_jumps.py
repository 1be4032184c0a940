"""Jumps at which no step ends are found, and kinks are not taken for jumps."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.engine.lowering.lower import lower
from lagcli.errors import UsageError
from lagcli.simulations.hidden_jumps import has_hidden_jumps

ROD = """
coordinates: [x, y]
parameters: {{m: 1, g: 10, l: 1, F: -3}}
T: m*(x'^2 + y'^2)/2
V: m*g*y
Q: {{x: "{force}"}}
constraints: {{rod: x^2 + y^2 = l^2}}
initial: {{x: l, y: 0, x': 0, y': {{guess: 0}}}}
"""


@pytest.mark.parametrize(
    ("force", "hidden"),
    [
        ("if(lambda.rod < F, 0, 3)", True),
        ("floor(lambda.rod)", True),
        ("if(x > 0.5, sqrt(x - 0.5) + 1, 0)", True),
        ("if(x > 0.5, 1, 0)", False),  # a step ends there
        ("floor(3*x)", False),
        ("abs(lambda.rod)/10", False),
        ("max(lambda.rod, F)/10", False),
        ("sqrt(max(x - 0.5, 0))", False),
        ("F", False),
    ],
)
def test_hidden_jumps(force: str, hidden: bool) -> None:
    model = lagcli.load_text(ROD.format(force=force))
    system = lower(lagcli.derive(model))
    assert has_hidden_jumps(system, tuple(model.parameter_values.values())) == hidden


def test_sensitivities_reject_them() -> None:
    model = lagcli.load_text(ROD.format(force="if(lambda.rod < F, 0, 3)"))
    with pytest.raises(UsageError, match="one jumps with a multiplier"):
        lagcli.simulate(model, sensitivity=("g",), t_end=0.1)
