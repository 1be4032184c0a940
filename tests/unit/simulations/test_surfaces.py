"""Surfaces at which forces jump."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.lowering.lower import lower
from lagcli.equations.derivation.lagrange import derive
from lagcli.errors import UsageError
from lagcli.simulations.surfaces import has_hidden_jumps, has_jumps


def text(force: str) -> str:
    return (
        "coordinates: [x, y]\nparameters: {h: 0.5}\nT: (x'^2 + y'^2)/2\n"
        f"Q: {{x: \"{force}\"}}\ninitial: {{x: 1, y: 0, x': 0, y': 0}}\n"
    )


@pytest.mark.parametrize(
    ("force", "jumps"),
    [
        ("-if(x > h, 1, 0)", True),
        ("sign(x' + y)", True),
        ("floor(x*x')", True),
        ("floor(2*x'^2)", True),  # at zero, too, where its argument has a double root
        ("-abs(x' - y)*x", False),
        ("max(x, y^2) + min(x', 0)", False),
        ("if(x > h, x - h, 0)^2", False),
        ("if(x > 0.5, sqrt(x - h), 0)", False),
        ("if(t < h, 1, 0)", True),
        ("-1e-6*if(x > h, 1, 0)", True),  # small, as is all of the force
        ("if(x > h, 1e4*(x - h) + 1e-3, 0)", True),  # small beside the slope
        ("if(x > 5 and y > 3, -x, 0)", True),  # a region that random states miss
        ("max(0, min(x - 50, y - 30))", False),
        # what the inner choice does where the outer one leaves it out counts
        ("if(x > 50, if(y > 30, min(x - 50, y - 30), 0), 0)", True),
        ("if(x^2 + y^2 < 1e-6*h, 1, 0)", True),  # a region that random lines miss
        ("floor(7*h)*x + if(h > 1, x, y)", False),
    ],
)
def test_forces_that_jump(force: str, jumps: bool) -> None:
    system = lower(derive(lagcli.load_text(text(force))))
    assert has_jumps(system, (0.5,)) == jumps


def test_sensitivities_take_kinks() -> None:
    # x'' = −2 (x − h) from x = 1: x = h + (1 − h) cos √2 t
    model = lagcli.load_text(text("-2*max(x - h, -3)"))
    found = lagcli.simulate(model, sensitivity=("h",), t_end=1.0, samples=2)
    assert found.dq[-1, 0, 0] == pytest.approx(1 - np.cos(np.sqrt(2)), rel=1e-8)


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
        ("if(lambda.rod < F, 0, 3)", False),  # a step ends there, too
        ("if(lambda.rod < F, 0, sqrt(lambda.rod - F) + 1)", True),
        ("floor(lambda.rod)", True),
        ("if(x > 0.5, sqrt(x - 0.5) + 1, 0)", True),
        ("1e-7*if(x > 0.5, sqrt(x - 0.5) + 1, 0)", True),
        ("floor(-F)*sqrt(max(x - 0.5, 0))", False),  # the parameter does not change
        ("-sign(x)*abs(x)^1.5", False),
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
    model = lagcli.load_text(ROD.format(force="floor(lambda.rod)"))
    with pytest.raises(UsageError, match="with a multiplier in `floor`"):
        lagcli.simulate(model, sensitivity=("g",), t_end=0.1)
