"""States: what a run begins from."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from pendulum_by_hand import pendulum_system

from lagcli.engine.system import State, without_numbers


def test_a_run_begins_without_work_done() -> None:
    state = State(0.5, np.array([1.0, 2.0]), np.array([3.0, 4.0]), (9.81,))
    np.testing.assert_array_equal(state.y, [1.0, 2.0, 3.0, 4.0, 0.0])
    state.y[0] = 7.0
    assert state.q[0] == 1.0


def test_counts_are_those_of_names_and_patterns() -> None:
    counts = pendulum_system().counts
    assert (counts.nq, counts.nc, counts.nh, counts.nm, counts.nb) == (2, 1, 1, 2, 2)


def test_coordinates_of_one_unit_have_the_largest_inertia() -> None:
    system = pendulum_system()
    diagonal = np.array([[1.0, 4.0], [3.0, 2.0]])
    assert system.inertia(diagonal) is diagonal
    system = dataclasses.replace(system, same_unit=((0, 1),))
    np.testing.assert_array_equal(system.inertia(diagonal), [[4.0, 4.0], [3.0, 3.0]])
    np.testing.assert_array_equal(diagonal, [[1.0, 4.0], [3.0, 2.0]])


def test_inputs_of_a_family_have_one_label() -> None:
    system = dataclasses.replace(pendulum_system(), coordinates=("x[1]", "x[2]"))
    assert system.families == [None, "x[]", "x[]", "x[]'", "x[]'", None]
    assert len(system.families) == system.dynamics.inputs


@pytest.mark.parametrize(
    ("name", "expected"), [("phi", "phi"), ("x_12", "x_"), ("q[3,14]", "q[,]"), ("2", "")]
)
def test_names_without_numbers(name: str, expected: str) -> None:
    assert without_numbers(name) == expected
