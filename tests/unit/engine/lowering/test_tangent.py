"""The right sides of the variational equations, against the derivatives they are made of."""

from __future__ import annotations

import numpy as np
import symengine as se

import lagcli
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


def test_the_right_sides_are_the_derivatives_along_each_direction() -> None:
    tapes = lower_tangent(ROD, DIRECTIONS)
    found = ScalarTape(tapes.dynamics)((*WHOLE, *MOTION, *P))
    expected = []
    for k, of_mass in enumerate((1.0, 0.0)):
        s, u = np.array(CHANGES[2 * k : 2 * k + 2]), np.array(CHANGES[4 + 2 * k : 6 + 2 * k])
        expected += [2 * -3.0 * s[0] - of_mass * 1.0, 2 * -3.0 * s[1] - of_mass * (9.81 + 2.0)]
        # Γ = −2 (x'² + y'²) − 2 (x x'' + y y'')
        expected.append(-4 * (0.3 * u[0] + 0.4 * u[1]) - 2 * (s[0] * 1.0 + s[1] * 2.0))
    np.testing.assert_allclose(found, expected, rtol=1e-14)


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
