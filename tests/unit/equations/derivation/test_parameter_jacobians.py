"""Derivatives of the equations with respect to parameters, against closed forms and differences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import symengine as se

import lagcli
from lagcli.engine.lowering import lower
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.parameter_jacobians import differentiate_parameters

MODELS = Path(__file__).parents[4] / "models"

ROD = """
coordinates: [x, y]
parameters: {m: 2, l: 3, g: 9.81}
T: m*(x'^2 + y'^2)/2
V: m*g*y
constraints: {rod: x^2 + y^2 = l^2}
outputs: {tension: 2*lambda.rod*l}
initial: {x: 3, y: 0, x': 0, y': 0}
"""


def test_only_what_depends_on_a_parameter_has_a_derivative() -> None:
    found = differentiate_parameters(lagcli.derive(lagcli.load_text(ROD)), ["m", "l"])
    assert found.parameters == ("m", "l")
    # G_x = −m x'' + 2 λ x, G_y = −m g − m y'' + 2 λ y, φ = x² + y² − l²
    assert [dict(row) for row in found.force] == [
        {0: -se.Symbol("x''")},
        {0: -se.Symbol("g") - se.Symbol("y''")},
    ]
    assert [dict(row) for row in found.rhs] == [{}]
    assert [dict(row) for row in found.position] == [{1: -2 * se.Symbol("l")}]
    assert [dict(row) for row in found.velocity] == [{}]
    assert [dict(row) for row in found.outputs.values()] == [{1: 2 * se.Symbol("lambda.rod")}]


def test_an_unknown_parameter_is_rejected() -> None:
    equations = lagcli.derive(lagcli.load_text(ROD))
    with pytest.raises(KeyError, match="mass"):
        differentiate_parameters(equations, ["mass"])


@pytest.mark.parametrize("name", ["slider_crank.yaml", "rolling_disk.yaml"])
def test_they_are_the_differences_of_the_equations(name: str) -> None:
    model = lagcli.load(MODELS / name)
    system = lower(lagcli.derive(model))
    assert system.parameter_variation is not None
    tapes = system.parameter_variation(system.parameters)
    nq, nc, nh = len(system.coordinates), len(system.constraints), len(system.holonomic)
    rng = np.random.default_rng(7)
    t, q, v, a, x = 0.3, *(rng.uniform(0.2, 1, n) for n in (nq, nq, nq, nc))
    p = np.array(list(model.parameter_values.values()))

    def residuals(p: np.ndarray) -> np.ndarray:
        """Return G, Γ, φ and ψ, from the tapes of the equations."""
        at = system.counts
        out = np.array(ScalarTape(system.dynamics)((t, *q, *v, *p)))
        m, b = np.zeros((nq, nq)), np.zeros((nc, nq))
        for (i, j), value in zip(system.mass_pattern, out, strict=False):
            m[i, j] = value
        f, rest = out[at.nm : at.nm + nq], out[at.nm + nq :]
        for (i, j), value in zip(system.jacobian_pattern, rest, strict=False):
            b[i, j] = value
        rhs = rest[at.nb : at.nb + nc]
        own = np.array(ScalarTape(system.constraint)((t, *q, *v, *p)))
        drift = own[nh + at.nb : nh + at.nb + nc]
        return np.concatenate([f - m @ a + b.T @ x, rhs - b @ a, own[:nh], b @ v + drift])

    derivatives = np.zeros((nq + nc + nh + nc, len(p)))
    values = iter(ScalarTape(tapes.tape)((t, *q, *v, *a, *x, *p)))
    first = 0
    for pattern, rows in zip(
        (tapes.force, tapes.rhs, tapes.position, tapes.velocity), (nq, nc, nh, nc), strict=True
    ):
        for i, j in pattern:
            derivatives[first + i, j] = next(values)
        first += rows
    for j in range(len(p)):
        h = 1e-4 * abs(p[j]) or 1e-4
        step = h * np.eye(len(p))[j]
        near = (residuals(p + step) - residuals(p - step)) / (2 * h)
        far = (residuals(p + 2 * step) - residuals(p - 2 * step)) / (4 * h)
        # the error of Richardson's value is of order h⁴, rounding of 1e-16/h
        scale = np.abs(residuals(p)).max() / abs(p[j] or 1)
        np.testing.assert_allclose(derivatives[:, j], (4 * near - far) / 3, atol=1e-9 * scale)
