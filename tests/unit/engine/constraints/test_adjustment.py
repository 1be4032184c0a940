"""Adjustment of the values that an event does not set."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.constraints.adjustment import (
    ClosedContact,
    adjusted,
    adjusted_positions,
    adjusted_velocities,
    held_during,
    impulse_of,
)
from lagcli.engine.constraints.initial import NoConsistentState
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.switching.switching import EventRule, RowMode
from lagcli.engine.system import System
from lagcli.simulations import simulation

MODEL = """
coordinates: [x, y, z]
T: (x'^2 + 2*y'^2 + 4*z'^2)/2
V: 0
constraints:
  line: x + y + z = 3
  floor: z >= 1
  roof: y <= 5
  pin: {expr: x = y, active: false}
  rub: {expr: y' = 0, limit: 2}
events: {go: {when: t >= 9, engage: pin}}
initial: {x: 1, y: 1, z: 1, x': 0, y': 0, z': 0}
"""
FREE = np.zeros((2, 3), dtype=bool)


def system() -> System:
    return simulation.prepare(lagcli.load_text(MODEL)).system


def evaluator() -> Evaluator:
    return Evaluator(system(), ())


def rows_of(**fields: object) -> tuple[list[int], list[int], dict[int, ClosedContact]]:
    switching = system().switching
    assert switching is not None
    rule = EventRule("e", **fields)  # type: ignore[arg-type]
    modes = [RowMode.HOLDS, RowMode.OPEN, RowMode.OPEN, RowMode.HOLDS]
    found = held_during(switching, rule, 5, [True, True, False, True], modes, lambda k: 1e-9)
    return list(found.positions), list(found.velocities), dict(found.contacts)


def test_rows_that_hold_during_an_event() -> None:
    floor = {1: ClosedContact(1, 1e-9)}
    assert rows_of() == ([0], [0], floor)
    assert rows_of(engage=(3,)) == ([0], [0], floor)
    # velocities that are set hold on what is engaged with them
    assert rows_of(engage=(3,), targets=(("v", 0),)) == ([0], [0, 3], floor)
    assert rows_of(release=(1,)) == ([0], [0], {})


def test_the_nearest_position_in_the_metric_of_mass() -> None:
    start, v = np.array([1.0, 1.0, 2.0]), np.zeros(3)
    found = adjusted_positions(evaluator(), 0.0, start, v, FREE[0], [0], {})
    # -1 divided by 1 : 1/2 : 1/4
    np.testing.assert_allclose(found, start - np.array([4, 2, 1]) / 7, atol=1e-14)
    fixed = np.array([True, False, False])
    found = adjusted_positions(evaluator(), 0.0, start, v, fixed, [0], {})
    np.testing.assert_allclose(found, start - np.array([0, 2, 1]) / 3, atol=1e-14)
    closed = {1: ClosedContact(1, 1e-9)}
    low = np.array([1.0, 1.0, 1.0 + 1 / 7])
    found = adjusted_positions(evaluator(), 0.0, np.array([1.0, 2, 1]), v, FREE[0], [0], closed)
    np.testing.assert_allclose(found, [1 - 2 / 3, 2 - 1 / 3, 1], atol=1e-14)
    found = adjusted_positions(evaluator(), 0.0, low, v, FREE[0], [0], closed)
    assert found[2] > 1  # it opens
    with pytest.raises(NoConsistentState):
        adjusted_positions(evaluator(), 0.0, start, v, np.ones(3, dtype=bool), [0], {})


def test_contacts_push_and_do_not_pull() -> None:
    q, closed = np.array([1.0, 1.0, 1.0]), {1: ClosedContact(1, 1e-9)}
    up = adjusted_velocities(evaluator(), 0.0, q, np.array([-7.0, 0, 0]), FREE[1], [0], closed)
    np.testing.assert_allclose(up.v, [-3, 2, 1], atol=1e-14)
    np.testing.assert_allclose(up.impulse, [4, 0, 0, 0, 0], atol=1e-13)
    down = adjusted_velocities(evaluator(), 0.0, q, np.array([3.0, 0, 0]), FREE[1], [0], closed)
    np.testing.assert_allclose(down.v, [1, -1, 0], atol=1e-14)
    np.testing.assert_allclose(down.impulse, [-2, 2, 0, 0, 0], atol=1e-13)
    # a fixed velocity into the floor: an impact follows, which is none of this
    fixed = np.array([False, False, True])
    into = adjusted_velocities(evaluator(), 0.0, q, np.array([0, 0, -3.0]), fixed, [0], closed)
    np.testing.assert_allclose(into.v, [2, 1, -3], atol=1e-14)
    np.testing.assert_allclose(into.impulse, [2, 0, 0, 0, 0], atol=1e-13)


def test_a_contact_away_from_its_surface_takes_no_part() -> None:
    q = np.array([0.5, 1.0, 1.5])
    closed = {1: ClosedContact(1, 1e-9), 2: ClosedContact(-1, 1e-9)}
    fixed = FREE.copy()
    fixed[0, 2] = True
    switching = system().switching
    assert switching is not None
    held = held_during(
        switching, EventRule("e"), 5, [True] * 4, [RowMode.HOLDS] * 4, lambda k: 1e-9
    )
    found = adjusted(evaluator(), 0.0, q, np.array([0, 0, -1.0]), fixed, held)
    assert held.contacts == closed
    assert found.v[2] < 0
    assert found.impulse[1] == 0


def test_the_impulse_of_redundant_rows_is_of_least_norm() -> None:
    text = "coordinates: [x]\nT: x'^2/2\nV: 0\nconstraints: {a: x = 1, b: 2*x = 2}\n"
    text += "initial: {x: 1, x': 0}\n"
    known = Evaluator(simulation.prepare(lagcli.load_text(text)).system, ())
    q, change, free = np.ones(1), np.array([5.0]), np.ones(1, dtype=bool)
    found = impulse_of(known, 0.0, q, change, change, [0, 1], free)
    np.testing.assert_allclose(found, [1, 2], atol=1e-14)
    found = impulse_of(known, 0.0, q, change, change, [0, 1], free, np.array([5.0]))
    np.testing.assert_allclose(found, [0, 0], atol=1e-14)
    assert not impulse_of(known, 0.0, q, change, change, [], free).any()
