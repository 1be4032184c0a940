"""The right sides of the variational equations, against the derivatives they are made of."""

from __future__ import annotations

import numpy as np
import pytest
import symengine as se
from shipped import PATHS

import lagcli
from lagcli.engine.lowering import right_sides
from lagcli.engine.lowering.tangent import lower_observed, lower_tangent
from lagcli.engine.tape.interpreter import ScalarTape

# G = (−m x'' + 2 λ x, −m g − m y'' + 2 λ y), γ = −2 (x'² + y'²)
ROD = lagcli.derive(
    lagcli.load_text("""
coordinates: [x, y]
parameters: {m: 2, l: 3, g: 9.81}
T: m*(x'^2 + y'^2)/2
V: m*g*y
constraints: {rod: x^2 + y^2 = l^2}
initial: {x: 3, y: 0, x': 0, y': 0}
""")
)
DIRECTIONS = [{"m": se.Integer(1)}, {"l": se.Integer(1)}]
STATE = (0.0, 0.6, -0.8, 0.3, 0.4)  # t, q, v
MOTION = (1.0, 2.0, -3.0)  # a, λ
CHANGES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)  # s of both directions, then ṡ
WHOLE = (*STATE[:3], *CHANGES[:4], *STATE[3:], *CHANGES[4:])  # t, q, s, v, ṡ
P = (2.0, 3.0, 9.81)


@pytest.mark.parametrize("longer", [0.0, 1e9])
def test_the_right_sides_are_the_derivatives_along_each_direction(
    longer: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(right_sides, "_LONGER", longer)  # by differentiation, and as written
    tapes = lower_tangent(ROD, DIRECTIONS)
    found = ScalarTape(tapes.dynamics)((*WHOLE, *MOTION, *P))
    expected = []
    for k, of_mass in enumerate((1.0, 0.0)):
        s, u = np.array(CHANGES[2 * k : 2 * k + 2]), np.array(CHANGES[4 + 2 * k : 6 + 2 * k])
        expected += [2 * -3.0 * s[0] - of_mass * 1.0, 2 * -3.0 * s[1] - of_mass * (9.81 + 2.0)]
        # Γ = −2 (x'² + y'²) − 2 (x x'' + y y'')
        expected.append(-4 * (0.3 * u[0] + 0.4 * u[1]) - 2 * (s[0] * 1.0 + s[1] * 2.0))
    np.testing.assert_allclose(found, expected, rtol=1e-14)


@pytest.mark.parametrize(
    "name", ["andrews_squeezer", "bead_on_rotating_hoop", "car_axis", "four_bar", "heavy_top"]
)
def test_models_have_the_derivatives_that_are_written(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    equations = lagcli.derive(lagcli.load(PATHS[name]))
    names = list(equations.model.parameters)
    symbols = [se.Symbol(x) for x in names]
    directions = [{names[0]: se.Integer(1)}, {names[-1]: symbols[0] ** 2, names[1]: symbols[1]}, {}]
    values = list(equations.model.parameter_values.values())
    draw = np.random.default_rng(3)
    tapes = []
    for longer in (0.0, 1e9):
        monkeypatch.setattr(right_sides, "_LONGER", longer)
        tapes.append(ScalarTape(lower_tangent(equations, directions).dynamics))
    nq, nc = len(equations.q), len(equations.constraints)
    for _ in range(20):
        inputs = [*draw.uniform(-1, 1, 1 + 2 * nq * 4 + nq + nc), *values]
        found, written = (tape(inputs) for tape in tapes)
        size = np.abs(written).max()
        np.testing.assert_allclose(found, written, rtol=1e-10, atol=1e-12 * size)


def test_constraints_are_linearized_with_their_scales() -> None:
    found = ScalarTape(lower_tangent(ROD, DIRECTIONS).constraint)((*WHOLE, *P))
    phi = [2 * (0.6 * 0.1 - 0.8 * 0.2), 2 * (0.6 * 0.3 - 0.8 * 0.4) - 6.0]
    drift = [2 * (0.3 * 0.1 + 0.4 * 0.2), 2 * (0.3 * 0.3 + 0.4 * 0.4)]
    np.testing.assert_allclose(found[:4], [*phi, *drift], rtol=1e-14)
    sizes = [2 * (0.6 * 0.1 + 0.8 * 0.2), 2 * (0.6 * 0.3 + 0.8 * 0.4) + 6.0]
    np.testing.assert_allclose(found[4:6], sizes, rtol=1e-14)


def test_observed_expressions_and_their_derivatives() -> None:
    multiplier, x, m = se.Symbol("lambda.rod"), se.Symbol("x"), se.Symbol("m")
    values, slopes = lower_observed(ROD, [multiplier * x * m], DIRECTIONS)
    assert ScalarTape(values)((*STATE, *MOTION, *P)) == [-3.0 * 0.6 * 2.0]
    later = (0.0, 0.0, 0.0, 0.0, 7.0, 11.0)  # s̈ of both directions, λ_θ of both
    found = ScalarTape(slopes)((*STATE, *MOTION, *CHANGES, *later, *P))
    expected = [
        7.0 * 0.6 * 2.0 + -3.0 * 0.1 * 2.0 + -3.0 * 0.6,
        11.0 * 0.6 * 2.0 + -3.0 * 0.3 * 2.0,
    ]
    np.testing.assert_allclose(found, expected, rtol=1e-14)
