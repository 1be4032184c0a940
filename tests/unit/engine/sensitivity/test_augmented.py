"""The System of the motion and its derivatives: names, patterns, tapes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import symengine as se

import lagcli
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear.dense import solve_regular
from lagcli.engine.sensitivity.augmented import with_derivatives
from lagcli.engine.sensitivity.tangent import lower_tangent
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.simulations.simulation import prepare

MODELS = Path(__file__).parents[4] / "models"
SIMULATION = prepare(lagcli.load(MODELS / "slider_crank.yaml"))
DIRECTIONS = [{"m": se.Integer(1)}, {"l": se.Integer(1)}]


def made() -> System:
    tangent = lower_tangent(SIMULATION.equations, DIRECTIONS)
    return with_derivatives(SIMULATION.system, tangent, ("m", "l"))


def test_names_and_patterns_repeat_in_blocks() -> None:
    system = made()
    assert system.coordinates == ("phi", "psi", "dphi/dm", "dpsi/dm", "dphi/dl", "dpsi/dl")
    assert system.constraints == ("guide", "dguide/dm", "dguide/dl")
    assert system.holonomic == (0, 1, 2)
    assert {(i // 2, j // 2) for i, j in system.mass_pattern} == {(0, 0), (1, 1), (2, 2)}
    assert {(i, j // 2) for i, j in system.jacobian_pattern} == {(0, 0), (1, 1), (2, 2)}


def test_accelerations_solve_the_variational_equations() -> None:
    system, own = made(), SIMULATION.start.state
    rng = np.random.default_rng(3)
    s, u = rng.uniform(-1, 1, 4), rng.uniform(-1, 1, 4)
    q, v = np.concatenate([own.q, s]), np.concatenate([own.v, u])
    # with derivatives, the dynamics tape has f and γ of the motion alone
    d = Evaluator(system, own.p).dynamics(0.0, q, v)
    assert not d.forcing[2:].any()
    assert not d.rhs[1:].any()
    a, multipliers, power = Index1(Evaluator(system, own.p), 3).accelerations(0.0, q, v)
    base = Evaluator(SIMULATION.system, own.p).dynamics(0.0, own.q, own.v)
    expected = solve_regular(base.mass_matrix, base.forcing, base.jacobian, base.rhs)
    np.testing.assert_allclose(a[:2], expected[0], rtol=1e-12)
    np.testing.assert_allclose(multipliers[:1], expected[1], rtol=1e-12)
    tangent = lower_tangent(SIMULATION.equations, DIRECTIONS)
    sides = np.array(
        ScalarTape(tangent.dynamics)((0.0, *q, *v, *expected[0], *expected[1], *own.p))
    ).reshape(2, 3)
    for k in range(2):
        found, force = a[2 + 2 * k : 4 + 2 * k], multipliers[1 + k]
        left = base.mass_matrix @ found - base.jacobian.T @ [force]
        np.testing.assert_allclose(left, sides[k, :2], rtol=1e-10, atol=1e-9)
        np.testing.assert_allclose(base.jacobian @ found, sides[k, 2:], rtol=1e-10, atol=1e-9)
    # the power of the derivatives' multipliers is none of the motion's
    own_power = base.power + expected[1] @ (base.jacobian @ own.v)
    np.testing.assert_allclose(power, own_power, atol=1e-13 * np.abs(multipliers).max())


def test_derivatives_for_implicit_methods_are_block_diagonal() -> None:
    system = made()
    assert system.variation is not None
    assert SIMULATION.system.variation is not None
    own, found = SIMULATION.system.variation(), system.variation()
    assert not found.exact
    assert len(found.force_position) == 3 * len(own.force_position)
    assert all(i // 2 == j // 2 for i, j in found.force_position)
