"""Matrices of a System at one state and at many, against formulas by hand."""

from __future__ import annotations

import math

import numpy as np
from lowered import lowered

import lagcli
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate.many_states import Batch

SYSTEM, P = lowered(
    lagcli.load_text("""
coordinates: [x, y]
parameters: {m: 2.0, w: 3.0}
T: m*(x'^2 + y'^2)/2 + m*x'*y'/4
V: 9.81*m*y
Q: {x: -0.5*x'}
constraints:
  rod: x^2 + y^2 = (1 + 0.1*sin(w*t))^2
  wheel: x' = t*y'
initial: {x: {guess: 1}, y: {guess: 0}, x': {guess: 0}, y': {guess: 0}}
""")
)
M, W = P
T, Q, V = 0.4, np.array([0.6, -0.7]), np.array([1.5, -0.2])
LENGTH = 1 + 0.1 * math.sin(W * T)
RATE, CURVE = 0.1 * W * math.cos(W * T), -0.1 * W**2 * math.sin(W * T)


def test_dynamics_by_hand() -> None:
    d = Evaluator(SYSTEM, P).dynamics(T, Q, V)
    np.testing.assert_allclose(d.mass_matrix, [[M, M / 4], [M / 4, M]])
    np.testing.assert_allclose(d.forcing, [-0.5 * V[0], -9.81 * M])
    np.testing.assert_allclose(d.jacobian, [2 * Q, [1, -T]])
    gamma = -2 * V @ V + 2 * (RATE**2 + LENGTH * CURVE)
    np.testing.assert_allclose(d.rhs, [gamma, V[1]])
    np.testing.assert_allclose(d.power, -0.5 * V[0] ** 2)
    assert d.finite


def test_constraints_by_hand() -> None:
    c = Evaluator(SYSTEM, P).constraints(T, Q, V)
    np.testing.assert_allclose(c.position, [Q @ Q - LENGTH**2])
    np.testing.assert_allclose(c.jacobian, [2 * Q, [1, -T]])
    np.testing.assert_allclose(c.drift, [-2 * LENGTH * RATE, 0.0])
    np.testing.assert_allclose(c.velocity(V), [2 * Q @ V - 2 * LENGTH * RATE, V[0] - T * V[1]])
    assert c.position_scale >= abs(Q @ Q + LENGTH**2) * (1 - 1e-15)
    np.testing.assert_allclose(c.velocity_scale[1], abs(V[0]) + abs(T * V[1]))
    assert c.finite


def test_values_that_are_not_finite_are_noticed() -> None:
    evaluator = Evaluator(SYSTEM, P)
    assert not evaluator.dynamics(T, Q, np.array([math.inf, 0.0])).finite
    assert not evaluator.constraints(T, np.array([math.nan, 0.0]), V).finite


def test_parameters_are_the_evaluators() -> None:
    doubled = Evaluator(SYSTEM, (2 * M, W))
    np.testing.assert_allclose(doubled.dynamics(T, Q, V).forcing[1], -9.81 * 2 * M)
    assert doubled.state(T, Q, V).p == (2 * M, W)


def test_states_keep_copies() -> None:
    q = Q.copy()
    state = Evaluator(SYSTEM, P).state(T, q, V)
    q[0] = 99.0
    np.testing.assert_array_equal(state.q, Q)


def test_sizes_and_lengths_have_no_units() -> None:
    evaluator = Evaluator(SYSTEM, P)
    sizes = evaluator.sizes(T, Q, V)
    np.testing.assert_allclose(sizes, 1 / math.sqrt(M))
    c = evaluator.constraints(T, Q, V)
    lengths = evaluator.row_lengths(T, Q, V, c, sizes)
    np.testing.assert_allclose(lengths, np.linalg.norm(c.jacobian * sizes, axis=1))
    # where a row vanishes, its terms say how long it may be
    origin = np.zeros(2)
    c = evaluator.constraints(T, origin, V)
    assert (evaluator.row_lengths(T, origin, V, c, sizes) > 0).all()


def test_many_states_are_evaluated_as_one_by_one() -> None:
    rng = np.random.default_rng(2)
    t, q, v = rng.random(5), rng.normal(size=(5, 2)), rng.normal(size=(5, 2))
    batch, evaluator = Batch(SYSTEM, P, t, q, v), Evaluator(SYSTEM, P)
    d, entries = batch.dynamics(), batch.entries()
    a, multipliers = rng.normal(size=(5, 2)), rng.normal(size=(5, 2))
    report = batch.report(a, multipliers)
    for i in range(5):
        one, c = evaluator.dynamics(t[i], q[i], v[i]), evaluator.constraints(t[i], q[i], v[i])
        for name in ("mass_matrix", "forcing", "jacobian", "rhs", "power"):
            np.testing.assert_allclose(getattr(d, name)[..., i], getattr(one, name), rtol=1e-13)
        np.testing.assert_allclose(entries.position[:, i], c.position, rtol=1e-13)
        np.testing.assert_allclose(entries.drift[:, i], c.drift, rtol=1e-13)
        np.testing.assert_allclose(entries.mass_matrix[:, i], one.mass_matrix.ravel())
        np.testing.assert_allclose(entries.jacobian[:, i], one.jacobian.ravel())
        kinetic = v[i] @ one.mass_matrix @ v[i] / 2
        potential = 9.81 * M * q[i, 1]
        expected = [kinetic, potential, kinetic + potential, -0.5 * v[i, 0] ** 2, 0.0]
        np.testing.assert_allclose(report[:, i], expected, rtol=1e-12, atol=1e-14)


def test_successive_calls_at_one_state_and_at_others() -> None:
    """Outputs are those of the state, the values of parameters and the sign of zero."""
    system, p = lowered(
        lagcli.load_text("""
coordinates: [x]
parameters: {m: 2.0}
T: m*x'^2/2
Q: {x: m*atan2(x, -1)}
initial: {x: 0, x': 0}
""")
    )
    evaluator, zero = Evaluator(system, p), np.zeros(1)
    other = evaluator.with_parameters((3.0,))
    for _ in range(2):
        for of, m in ((evaluator, 2.0), (other, 3.0)):
            for x, angle in ((0.0, math.pi), (-0.0, -math.pi), (1.0, 0.75 * math.pi)):
                d = of.dynamics(0.0, np.array([x]), zero)
                np.testing.assert_allclose(d.forcing, [m * angle], rtol=1e-15)
                np.testing.assert_array_equal(d.mass_matrix, [[m]])
                d.forcing[:] = np.nan  # its own numbers
    evaluator.p = (5.0,)
    np.testing.assert_array_equal(evaluator.dynamics(0.0, np.array([1.0]), zero).mass_matrix, [[5]])


def test_successive_calls_beside_a_jump_of_an_input() -> None:
    text = """
coordinates: [x]
T: x'^2/2
Q: {x: u}
inputs: {u: {times: [0, 1, 2], values: [0, 5, 7], interpolation: step}}
initial: {x: 0, x': 0}
"""
    system, p = lowered(lagcli.load_text(text))
    evaluator, zero = Evaluator(system, p), np.zeros(1)
    assert evaluator.dynamics(1.0, zero, zero).forcing == [5.0]
    evaluator.hold(0.5)
    assert evaluator.dynamics(1.0, zero, zero).forcing == [0.0]
