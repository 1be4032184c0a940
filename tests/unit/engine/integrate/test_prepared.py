"""What runs have in common: unrolled at once, later, or never; made again only where it must be."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from core_parts import run_tape
from lowered import Lowered, lowered
from pendulum_by_hand import G, pendulum_system

import lagcli
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate import prepared as preparing
from lagcli.engine.integrate.prepared import (
    explicit_functions,
    find_elimination,
    prepare,
    unrolled,
    with_rates,
)
from lagcli.engine.linear.elimination import Elimination
from lagcli.engine.system import State
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Builder, Tape

SYSTEM = pendulum_system()
STATE = State(0.0, np.array([0.6, -0.8]), np.zeros(2), (G,))


def found() -> Elimination:
    elimination = find_elimination(Evaluator(SYSTEM, (G,)), [STATE])
    assert elimination is not None
    return elimination


def full(size: int) -> Elimination:
    """Return an elimination that fills up."""
    columns = tuple(tuple(range(k + 1, size)) for k in range(size))
    return Elimination(tuple(range(size)), (False,) * size, columns, 1.0)


def test_short_eliminations_are_unrolled_at_once() -> None:
    made = prepare(SYSTEM, found())
    assert made.unrolled
    assert made.plain is None
    assert made.dynamics is made.whole
    assert not made.worth_unrolling
    assert unrolled(SYSTEM, made) is made


def test_longer_ones_are_unrolled_when_it_is_worth_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(preparing, "SHORT", 0)
    made = prepare(SYSTEM, found())
    assert (made.unrolled, made.worth_unrolling) == (False, True)
    assert made.dynamics is made.plain
    deferred = unrolled(SYSTEM, made)
    assert deferred.unrolled
    assert deferred.dynamics is not made.dynamics
    assert deferred.constraint is made.constraint


@pytest.mark.parametrize("elimination", [None, full(30), full(300)])
def test_dense_and_full_ones_never_are(elimination: Elimination | None) -> None:
    made = prepare(SYSTEM, elimination)
    assert (made.unrolled, made.worth_unrolling) == (False, False)
    assert unrolled(SYSTEM, made) is made


def test_as_many_updates_as_are_worth_it_grow_with_the_unknowns() -> None:
    few = full(20)
    assert few.updates == 1330  # 20 · 19 · 21/6, of 2000 that may be
    assert prepare(SYSTEM, few).worth_unrolling


def test_what_is_known_is_taken_where_it_serves() -> None:
    one = prepare(SYSTEM, found())
    assert prepare(SYSTEM, found()._replace(smallest=0.1), one) is one
    other = prepare(SYSTEM, None, one)
    assert other.constraint is one.constraint
    assert other.dynamics is not one.dynamics
    # the plain program is there from now on
    assert prepare(SYSTEM, full(300), other).plain is other.plain
    assert not one.serves(None)
    assert other.serves(None)
    assert not other.serves(found())


def test_an_order_is_found_where_states_allow_it() -> None:
    assert found() == found()
    undefined = STATE._replace(q=np.array([math.nan, 0.0]))
    assert find_elimination(Evaluator(SYSTEM, (G,)), [undefined]) is None


def tape_of(parameters: int = 1) -> Builder:
    """A tape of t, q, v, and parameters."""
    return Builder(3 + parameters, parameters)


def test_nonlinear_functions_of_time_and_of_time_and_state() -> None:
    builder = tape_of()
    angle = builder.emit(Op.MUL, 3, 0)  # w t
    force = builder.emit(Op.MUL, 1, builder.emit(Op.SIN, angle))  # q sin(w t)
    other = builder.emit(Op.COS, builder.emit(Op.SUB, 1, angle))
    found = explicit_functions([builder.finish([force, other])], 2)
    assert found is not None
    assert found.inputs == 4
    results, used, of_state = [math.sin(1.5), math.cos(0.5)], [1.0, 1.0], [0.0, 1.0]
    assert ScalarTape(found)((0.5, 2.0, 0.0, 3.0)) == [*results, *used, *of_state]


def test_functions_of_the_state_alone_and_linear_ones_of_time_are_left_out() -> None:
    builder = tape_of()
    sine = builder.emit(Op.SIN, 1)
    slope = builder.emit(Op.DIV, builder.emit(Op.MUL, 3, 0), 3)  # linear in t
    tape = builder.finish([builder.emit(Op.ADD, sine, slope)])
    assert explicit_functions([tape], 2) is None
    assert explicit_functions([Tape(4, (), (), ())], 2) is None


def test_operations_on_accelerations_are_left_out_of_other_tapes() -> None:
    builder = Builder(5, 1)  # t, q, v, a, p
    of_force = builder.emit(Op.SIN, builder.emit(Op.MUL, 3, 0))
    of_time = builder.emit(Op.EXP, builder.emit(Op.MUL, 4, 0))
    found = explicit_functions([builder.finish([of_force, of_time])], 2)
    assert found is not None
    assert len(found.outputs) == 3  # it, that it is used, and that it is of time alone


MODELS = Path(__file__).parents[4] / "models"


def shipped(name: str) -> Lowered:
    return lowered(lagcli.load(MODELS / f"{name}.yaml"))


def at(
    case: Lowered, t: float, q: np.ndarray, v: np.ndarray, output_subset: int = -1
) -> np.ndarray:
    """Return the outputs of the tape with ψ."""
    inputs = [t, *q, *v, *case.p]
    return np.asarray(run_tape(with_rates(case.system), inputs, output_subset=output_subset))


@pytest.mark.parametrize(
    "name", ["slider_crank", "four_bar", "chain", "driven_slider_crank", "rolling_disk"]
)
def test_rates_are_those_of_the_positions(name: str) -> None:
    case = shipped(name)
    system = case.system
    nh, nc, nq = len(system.holonomic), len(system.constraints), len(system.coordinates)
    rng = np.random.default_rng(1)
    q, v, h = rng.uniform(0.2, 1.0, nq), rng.normal(size=nq), 1e-5
    rates = at(case, 0.3, q, v)[-nc:]
    ahead, behind = (at(case, 0.3 + s * h, q + s * h * v, v)[:nh] for s in (1, -1))
    np.testing.assert_allclose(
        rates[list(system.holonomic)], (ahead - behind) / (2 * h), rtol=1e-7, atol=1e-7
    )
    # the others vanish with the velocities, but for what drives them
    still = at(case, 0.3, q, 0 * v)[-nc:]
    drift = nh + len(system.jacobian_pattern)
    np.testing.assert_array_equal(still, at(case, 0.3, q, v)[drift : drift + nc])


@pytest.mark.parametrize("name", ["slider_crank", "rolling_disk"])
def test_what_is_asked_for_alone_is_the_same(name: str) -> None:
    case = shipped(name)
    system = case.system
    nq = len(system.coordinates)
    q, v = np.linspace(0.3, 0.9, nq), np.linspace(-1.0, 2.0, nq)
    every = at(case, 0.1, q, v)
    for number, places in enumerate(with_rates(system).output_subsets):
        some = list(places)
        np.testing.assert_array_equal(at(case, 0.1, q, v, number)[some], every[some])


def test_functions_of_a_branch_are_used_in_it_alone() -> None:
    builder = tape_of()
    below = builder.emit(Op.LT, 0, 3)
    root = builder.emit(Op.SQRT, builder.emit(Op.SUB, 3, 0))
    power = builder.emit(Op.EXP, 0)
    inner = builder.emit(Op.SELECT, builder.emit(Op.LT, 1, 3), power, root)
    sine = builder.emit(Op.SIN, 0)
    force = builder.emit(Op.SELECT, below, inner, builder.emit(Op.MUL, sine, power))
    found = explicit_functions([builder.finish([force, sine])], 2)
    assert found is not None
    values = ScalarTape(found)
    product = math.sin(0.5) * math.exp(0.5)
    results = [math.sqrt(0.5), math.exp(0.5), math.sin(0.5), pytest.approx(product)]
    assert values((0.5, 0.0, 0.0, 1.0))[:4] == results
    assert values((0.5, 0.0, 0.0, 1.0))[4:8] == [0.0, 1.0, 1.0, 0.0]
    assert values((0.5, 2.0, 0.0, 1.0))[4:8] == [1.0, 0.0, 1.0, 0.0]
    assert values((0.5, 2.0, 0.0, 0.4))[4:8] == [0.0, 1.0, 1.0, 1.0]  # of the other branch
    assert values((0.5, 2.0, 0.0, 0.4))[8:] == [0.0, 0.0, 0.0, 0.0]  # none of the state


def test_conditions_on_forces_leave_both_branches() -> None:
    builder = Builder(5, 1)  # t, q, v, a, p
    pushes = builder.emit(Op.LT, 3, 4)
    force = builder.emit(Op.SELECT, pushes, builder.emit(Op.EXP, 0), builder.emit(Op.SIN, 0))
    found = explicit_functions([builder.finish([force])], 2)
    assert found is not None
    values = ScalarTape(found)((0.5, 0.0, 0.0, 1.0))
    assert values[:4] == [math.exp(0.5), math.sin(0.5), 1.0, 1.0]
