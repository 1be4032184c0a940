"""The motion and its derivatives in one tape."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import symengine as se

import lagcli
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.layout import Blocks, UnrolledLayout
from lagcli.engine.linear.elimination import order_at
from lagcli.engine.linear.one_tape import in_one_tape, repeated_elimination
from lagcli.engine.lowering.tangent import lower_tangent
from lagcli.engine.sensitivity.integration import with_derivatives
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.simulations.simulation import prepare

MODELS = Path(__file__).parents[4] / "models"
SIMULATION = prepare(lagcli.load(MODELS / "slider_crank.yaml"))


def test_the_elimination_repeats_in_blocks() -> None:
    system, state = SIMULATION.system, SIMULATION.start.state
    found = order_at(system, [Evaluator(system, state.p).entries(0.0, state.q, state.v)])
    both = repeated_elimination(found, Blocks(system.counts, 1))
    assert sorted(both.order) == list(range(6))
    n = len(found.order)
    assert [u for u in both.order[:n] if u < 4] == [u for u in found.order if u < 2]
    assert both.columns[n:] == tuple(tuple(n + i for i in c) for c in found.columns)


def test_the_tape_gives_the_accelerations_of_motion_and_derivatives() -> None:
    own, system = SIMULATION.start.state, SIMULATION.system
    directions = [{"m": se.Integer(1)}, {"l": se.Integer(1)}]
    tangent = lower_tangent(SIMULATION.equations, directions)
    whole = with_derivatives(system, tangent, ("m", "l"))
    order = order_at(system, [Evaluator(system, own.p).entries(0.0, own.q, own.v)])
    one, tape = in_one_tape(whole, order)
    rng = np.random.default_rng(5)
    q = np.concatenate([own.q, rng.uniform(-1, 1, 4)])
    v = np.concatenate([own.v, rng.uniform(-1, 1, 4)])
    a, multipliers, power = Index1(Evaluator(whole, own.p), 3).accelerations(0.0, q, v)
    other = [0.0] * tape.rhs_inputs
    found = np.array(ScalarTape(tape)((0.0, *q, *v, *own.p, *other)))
    layout = UnrolledLayout(one.counts)
    np.testing.assert_allclose(found[layout.solution], [*a, *multipliers], rtol=1e-10)
    np.testing.assert_allclose(found[layout.total_power], power, atol=1e-9)
