"""The System of the motion and its derivatives: names, patterns, tapes, eliminations."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import symengine as se

import lagcli
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear.dense import solve_regular
from lagcli.engine.linear.elimination import order_at
from lagcli.engine.sensitivity.augmented import (
    Blocks,
    augmented,
    independent_constraints,
    repeated_elimination,
    with_constraints,
)
from lagcli.engine.sensitivity.tangent import lower_tangent
from lagcli.engine.state import State
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.simulations.simulation import prepare

MODELS = Path(__file__).parents[4] / "models"
SIMULATION = prepare(lagcli.load(MODELS / "slider_crank.yaml"))
DIRECTIONS = [{"m": se.Integer(1)}, {"l": se.Integer(1)}]


def made() -> System:
    system, state = SIMULATION.system, SIMULATION.start.state
    entries = Evaluator(system, state.p).entries(state.t, state.q, state.v)
    tangent = lower_tangent(SIMULATION.equations, DIRECTIONS)
    return augmented(system, tangent, ("m", "l"), order_at(system, [entries]), (0,))


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
    d = Evaluator(system, own.p).dynamics(0.0, q, v)
    a, multipliers = solve_regular(d.mass_matrix, d.forcing, d.jacobian, d.rhs)
    base = Evaluator(SIMULATION.system, own.p).dynamics(0.0, own.q, own.v)
    expected = solve_regular(base.mass_matrix, base.forcing, base.jacobian, base.rhs)
    np.testing.assert_allclose(a[:2], expected[0], rtol=1e-12)
    np.testing.assert_allclose(multipliers[:1], expected[1], rtol=1e-12)
    tangent = lower_tangent(SIMULATION.equations, DIRECTIONS)
    sides = np.array(
        ScalarTape(tangent.dynamics)(
            (0.0, *own.q, *own.v, *expected[0], *expected[1], *s, *u, *own.p)
        )
    ).reshape(2, 3)
    for k in range(2):
        found, force = a[2 + 2 * k : 4 + 2 * k], multipliers[1 + k]
        left = base.mass_matrix @ found - base.jacobian.T @ [force]
        np.testing.assert_allclose(left, sides[k, :2], rtol=1e-10, atol=1e-9)
        np.testing.assert_allclose(base.jacobian @ found, sides[k, 2:], rtol=1e-10, atol=1e-9)
    # the power of the derivatives' multipliers is none of the motion's
    total = d.power + multipliers @ (d.jacobian @ v)
    own_power = base.power + expected[1] @ (base.jacobian @ own.v)
    np.testing.assert_allclose(total, own_power, atol=1e-13 * np.abs(multipliers).max())


def test_the_elimination_repeats_in_blocks() -> None:
    system, state = SIMULATION.system, SIMULATION.start.state
    found = order_at(system, [Evaluator(system, state.p).entries(0.0, state.q, state.v)])
    both = repeated_elimination(found, Blocks(system.counts, 1))
    assert sorted(both.order) == list(range(6))
    n = len(found.order)
    assert [u for u in both.order[:n] if u < 4] == [u for u in found.order if u < 2]
    assert both.columns[n:] == tuple(tuple(n + i for i in c) for c in found.columns)


def test_redundant_constraints_are_left_out_of_the_inner_solution() -> None:
    simulation = prepare(lagcli.load(MODELS / "parallelogram.yaml"))
    state, rank = simulation.start.state, simulation.start.rank
    kept = independent_constraints(simulation.system, state, rank)
    assert len(kept) == rank < len(simulation.system.constraints)
    inner = with_constraints(simulation.system, kept)
    whole = Evaluator(simulation.system, state.p).dynamics(0.0, state.q, state.v)
    part = Evaluator(inner, state.p).dynamics(0.0, state.q, state.v)
    np.testing.assert_array_equal(part.jacobian, whole.jacobian[list(kept)])
    np.testing.assert_array_equal(part.rhs, whole.rhs[list(kept)])
    assert np.linalg.matrix_rank(part.jacobian) == rank


def test_derivatives_for_implicit_methods_are_block_diagonal() -> None:
    system = made()
    assert system.variation is not None
    assert SIMULATION.system.variation is not None
    own, found = SIMULATION.system.variation(), system.variation()
    assert not found.exact
    assert len(found.force_position) == 3 * len(own.force_position)
    assert all(i // 2 == j // 2 for i, j in found.force_position)


def test_without_constraints_left_out_the_system_is_itself() -> None:
    assert with_constraints(SIMULATION.system, (0,)) is SIMULATION.system
    assert independent_constraints(SIMULATION.system, State(0.0, *[np.zeros(2)] * 2), 1) == (0,)
