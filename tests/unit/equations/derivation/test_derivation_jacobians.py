"""Jacobians of the equations of motion, and what they are formed with, against differences."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
import symengine as se

import lagcli
from lagcli.engine.lowering.lower import lower
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.jacobians import Gradient, differentiate, differentiate_parameters
from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.derivation.motion import Motion, addends
from lagcli.equations.derivation.quadratic import QuadraticForms, QuadraticPart
from lagcli.model.model import TIME

PENDULUM_ON_A_CART = """
coordinates: [x, y, phi]
parameters: {m: 2 kg, M: 3 kg, g: 9.81, c: 0.3}
T: M*x'^2/2 + m*((x' + y'*cos(phi))^2 + (y*phi')^2)/2
V: m*g*y*sin(phi) + x^2*t
Q: {x: -c*x'*abs(x'), phi: sin(2*t)*y'}
constraints:
  rod: x^2 + y^2*cos(phi) = 2 + t^2
  skate: x'*sin(phi) - y*y' = t
initial: {x: 1, y: {guess: 1}, phi: {guess: 0.3}, x': {guess: 0}, y': {guess: 0}, phi': {guess: 0}}
"""


@pytest.fixture(scope="module")
def equations() -> Equations:
    return lagcli.derive(lagcli.load_text(PENDULUM_ON_A_CART))


@pytest.fixture
def values(equations: Equations) -> dict[se.Basic, float]:
    source = random.Random(3)
    symbols = (*equations.q, *equations.v, *equations.a, *equations.multipliers, TIME)
    at = {x: source.uniform(0.4, 1.4) for x in symbols}
    return at | {se.Symbol(n): x for n, x in equations.model.parameter_values.items()}


def number(expression: se.Basic, at: dict[se.Basic, float]) -> float:
    return float(expression.subs({x: se.RealDouble(v) for x, v in at.items()}).n(real=True))


def difference(expression: se.Basic, x: se.Basic, at: dict[se.Basic, float]) -> float:
    """Return ∂/∂x to some ten digits: a central difference of fourth order."""
    h = 1e-3

    def moved(k: int) -> float:
        return number(expression, at | {x: at[x] + k * h})

    return (8 * (moved(1) - moved(-1)) - (moved(2) - moved(-2))) / (12 * h)


def assert_gradient(
    gradient: Gradient, expression: se.Basic, eq: Equations, at: dict[se.Basic, float]
) -> None:
    for row, symbols in ((gradient.position, eq.q), (gradient.velocity, eq.v)):
        for i, x in enumerate(symbols):
            found = number(row.get(i, se.Integer(0)), at)
            assert found == pytest.approx(difference(expression, x, at), rel=1e-8, abs=1e-8)
    assert number(gradient.time, at) == pytest.approx(
        difference(expression, TIME, at), rel=1e-8, abs=1e-8
    )


def test_gradients_of_the_equations_at_fixed_accelerations_and_multipliers(
    equations: Equations, values: dict[se.Basic, float]
) -> None:
    eq, found = equations, differentiate(equations)
    for i, gradient in enumerate(found.force):
        defect = eq.forcing[i] - sum(m * eq.a[j] for j, m in eq.mass_matrix[i].items())
        for multiplier, c in zip(eq.multipliers, eq.constraints, strict=True):
            defect += multiplier * c.row.get(i, 0)
        assert_gradient(gradient, defect, eq, values)
    for gradient, c in zip(found.rhs, eq.constraints, strict=True):
        assert_gradient(gradient, c.rhs - sum(b * eq.a[j] for j, b in c.row.items()), eq, values)
    power = eq.time_power + sum(q * v for q, v in zip(eq.applied_forces, eq.v, strict=True))
    for multiplier, c in zip(eq.multipliers, eq.constraints, strict=True):
        power += multiplier * sum(b * eq.v[j] for j, b in c.row.items())
    assert_gradient(found.power, power, eq, values)


def test_derivatives_that_vanish_are_left_out() -> None:
    oscillators = lagcli.derive(
        lagcli.load_text(
            "coordinates: [x, y]\nT: (x'^2 + y'^2)/2\nV: x^2 + y^4\n"
            "initial: {x: 1, x': 0, y: 1, y': 0}\n"
        )
    )
    for i, gradient in enumerate(differentiate(oscillators).force):
        assert set(gradient.position) == {i}
        assert not gradient.velocity
        assert gradient.time == 0


def test_the_rate_without_accelerations_follows_the_chain_rule(
    equations: Equations, values: dict[se.Basic, float]
) -> None:
    x, _y, phi = equations.q
    motion = Motion.of(equations.model)
    expression = x**2 * se.sin(phi) + TIME * x
    wanted = difference(expression, TIME, values)
    for q, v in zip(equations.q, equations.v, strict=True):
        wanted += difference(expression, q, values) * values[v]
    assert number(motion.convective(expression), values) == pytest.approx(wanted, rel=1e-8)


def test_a_constant_times_a_sum_is_distributed() -> None:
    a, b, c, d = map(se.Symbol, "abcd")
    assert set(addends(d * (a + b + c) + a)) == {a * d, b * d, c * d, a}
    assert addends(d * (a + b)) == (d * (a + b),)  # two terms are cheaper as they are


@pytest.mark.parametrize(
    "kinetic",
    [
        lambda q, v: 3 * (v[0] + v[1] * se.cos(q[2])) ** 2,  # a velocity of a point: e = 0
        lambda q, v: 2 * (v[0] * se.sin(q[1]) + v[2]) ** 2,  # a rate of rotation: gyroscopic
        lambda q, v: q[2] ** 2 * (v[0] + TIME) ** 2,  # a factor that moves, and an offset
        lambda q, v: TIME * (v[0] + q[1] * v[2]) * (v[1] - q[0] * TIME),  # two different forms
    ],
)
def test_terms_of_second_degree_give_what_differentiation_gives(
    equations: Equations, values: dict[se.Basic, float], kinetic
) -> None:
    motion = Motion.of(equations.model)
    q, v = motion.q, motion.v
    energy = kinetic(q, v)
    terms, rest = QuadraticForms(motion).split(energy)
    assert terms
    assert sum(rest) == 0
    part = QuadraticPart(terms, motion)
    matrix, forces = part.mass_matrix(), part.forces()
    for i in range(3):
        momentum = energy.diff(v[i])
        for j in range(3):
            entry = number(matrix[i].get(j, se.Integer(0)), values)
            assert entry == pytest.approx(number(momentum.diff(v[j]), values), rel=1e-12, abs=1e-12)
        wanted = energy.diff(q[i]) - momentum.diff(TIME)
        wanted -= sum(momentum.diff(x) * rate for x, rate in zip(q, v, strict=True))
        found = number(se.Add(*forces[i]), values)
        assert found == pytest.approx(number(wanted, values), rel=1e-11, abs=1e-11)
    generalized = sum(rate * energy.diff(rate) for rate in v) - energy
    assert number(part.energy(), values) == pytest.approx(number(generalized, values), rel=1e-11)


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
