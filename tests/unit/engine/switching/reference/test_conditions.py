"""Conditions of events: when they fire, and when they can fire again."""

import numpy as np

from lagcli.engine.switching.reference.conditions import Conditions
from lagcli.engine.switching.switching import EventRule


def conditions(**fields: object) -> Conditions:
    return Conditions([EventRule("e", condition=0, **fields)])  # type: ignore[arg-type]


def fires(c: Conditions, value: float) -> bool:
    return bool(c.watched(np.array([value]))[0] < 0)


def test_what_is_true_at_the_start_does_not_fire_until_it_was_false() -> None:
    c = conditions()
    c.start(np.array([1.0]))
    assert not fires(c, 2.0)
    assert not c.follow(np.array([0.5]))
    assert c.follow(np.array([-1.0]))
    assert fires(c, 0.1)
    assert not fires(c, -0.1)


def test_a_condition_fires_once_as_it_becomes_true() -> None:
    c = conditions()
    c.start(np.array([-1.0]))
    assert fires(c, 1e-20)
    c.fired(0)
    assert not fires(c, 1.0)
    c.follow(np.array([-1e-13]))  # rounding, of a condition whose values are about 1
    assert not fires(c, 1.0)
    c.follow(np.array([-0.1]))
    assert fires(c, 1.0)


def test_an_equation_fires_both_ways() -> None:
    c = conditions(either=True)
    c.start(np.array([-1.0]))
    assert fires(c, 1.0)
    c.fired(0)
    assert not fires(c, 1.0)
    assert fires(c, -1.0)


def test_times_limit_how_often() -> None:
    c = conditions(times=1)
    c.start(np.array([-1.0]))
    c.fired(0)
    c.follow(np.array([-1.0]))
    assert not fires(c, 1.0)


def test_a_jump_makes_a_condition_true() -> None:
    c = conditions()
    c.start(np.array([-1.0]))
    assert c.jumped(np.array([3.0])) == [0]
    assert c.jumped(np.array([-3.0])) == []
