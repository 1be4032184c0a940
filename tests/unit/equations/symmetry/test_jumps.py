"""Jumps of functions of the state."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.equations.symmetry.jumps import jumps

CONTINUOUS = [
    "x^2",
    "abs(x)*y",
    "max(x, y - t)",
    "if(x > a, x - a, 0)",
    "if(x^2 + y^2 > 1, x^2 + y^2, 1)",
    "if(x > 0, 1, 2)*x^2",
    "sign(x - y)*(x - y)",
    "cbrt(x)",
    "floor(a)*x",
    "if(a > 3, 1, 0)*x",
    "sin(pi*t)*floor(t)",
    "u*max(x, 0)",
    "if(abs(x) > 20, (x - 20)^2*(x + 20)^2, 0)",
]
JUMPING = [
    "step(t - 0.4)*x^2",
    "floor(3*t)",
    "ceil(x)",
    "sign(x*y)",
    "if(t > 100, 1, 0)",
    "if(t < 0.001, 1, 2)*y",
    "if(x > 0 and y > 0, x, 0)",
    "if(x > 0, 1, if(y > a, 2, 3))",
    "if(x^2 + y^2 > 1, x^2 + y^2, 0)",
    "x'*step(x)",
    "1e-9*step(t - 0.4)",
    "if(u > 0.5, x, 0)",
]


def found(text: str) -> bool:
    model = lagcli.load_text(f"""
coordinates: [x, y]
parameters: {{a: 0.3}}
inputs: {{u: {{times: [0, 1, 2], values: [0, 1, 0]}}}}
T: x'^2 + y'^2
initial: {{x: 1, y: 1, x': 0, y': 0}}
simulation: {{t_end: 1}}
outputs: {{f: "{text}"}}
""")
    return jumps(lagcli.derive(model).outputs["f"], {"a": 0.3})


@pytest.mark.parametrize("text", CONTINUOUS)
def test_continuous_functions(text: str) -> None:
    assert not found(text)


@pytest.mark.parametrize("text", JUMPING)
def test_functions_that_jump(text: str) -> None:
    assert found(text)
