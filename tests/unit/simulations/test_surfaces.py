"""Surfaces at which forces jump."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.lowering.lower import lower
from lagcli.engine.system import State
from lagcli.equations.derivation.lagrange import derive
from lagcli.errors import UsageError
from lagcli.simulations.surfaces import has_hidden_jumps, jumping_names


def text(force: str) -> str:
    return (
        "coordinates: [x, y]\nparameters: {h: 0.5}\nT: (x'^2 + y'^2)/2\n"
        f"Q: {{x: \"{force}\"}}\ninitial: {{x: 1, y: 0, x': 0, y': 0}}\n"
    )


@pytest.mark.parametrize(
    ("force", "names"),
    [
        ("-if(x > h, 1, 0)", ("x",)),
        ("sign(x' + y)", ("y", "x'")),
        ("floor(x*x')", ("x", "x'")),
        ("-abs(x' - y)*x", ()),
        ("max(x, y^2) + min(x', 0)", ()),
        ("if(x > h, x - h, 0)^2", ()),
        ("if(t < h, 1, 0)", ()),
    ],
)
def test_forces_that_jump(force: str, names: tuple[str, ...]) -> None:
    system = lower(derive(lagcli.load_text(text(force))))
    nothing = np.zeros(2)
    assert jumping_names(system, State(0.0, nothing, nothing, (0.5,))) == names


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
