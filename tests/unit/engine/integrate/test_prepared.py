"""What runs have in common: unrolled at once, later, or never; made again only where it must be."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pendulum_by_hand import G, pendulum_system

from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate import prepared as preparing
from lagcli.engine.integrate.prepared import (
    explicit_functions,
    find_elimination,
    prepare,
    unrolled,
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
