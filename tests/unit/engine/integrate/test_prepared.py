"""What runs have in common: unrolled at once, later, or never; made again only where it must be."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pendulum_by_hand import G, pendulum_system

from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate import prepared as preparing
from lagcli.engine.integrate.prepared import find_elimination, prepare, unrolled
from lagcli.engine.linear.elimination import Elimination
from lagcli.engine.state import State

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
