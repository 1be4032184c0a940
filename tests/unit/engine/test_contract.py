"""The contract: requests, blocks of samples, limits, and how runs end."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from pendulum_by_hand import pendulum_system, request

from lagcli.engine.contract import (
    Block,
    Interrupted,
    Limits,
    Stop,
    Undefined,
    outcome,
)
from lagcli.engine.system import State

STATE = State(0.25, np.array([1.0]), np.array([2.0]), ())


def test_tolerances_are_one_for_each_entry_of_the_state() -> None:
    np.testing.assert_array_equal(request(atol=1e-3).tolerances, [1e-3] * 5)
    each = np.arange(5.0)
    np.testing.assert_array_equal(request(atol=each).tolerances, each)


def test_coordinates_are_of_one_kind_by_default() -> None:
    assert request().kind_of == (0, 0)
    assert request(kinds=(0, 1)).kind_of == (0, 1)


def test_blocks_are_cut_from_rows() -> None:
    layout = pendulum_system().sample_layout  # t, x y, u v, a b, λ, W
    rows = np.arange(18.0).reshape(2, 9)
    block = Block.of_rows(rows, layout)
    np.testing.assert_array_equal(block.time, [0, 9])
    np.testing.assert_array_equal(block.q, [[1, 2], [10, 11]])
    np.testing.assert_array_equal(block.v, [[3, 4], [12, 13]])
    np.testing.assert_array_equal(block.a, [[5, 6], [14, 15]])
    np.testing.assert_array_equal(block.multipliers, [[7], [16]])
    np.testing.assert_array_equal(block.work, [8, 17])


def test_limits_of_steps() -> None:
    limits = Limits(request(max_steps=3).settings)
    limits.check(0.5, 2)
    with pytest.raises(Stop, match=r"after 3 steps at t = 0.5 s; --max-steps"):
        limits.check(0.5, 3)


def test_limits_of_time(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    limits = Limits(request(timeout=2.0).settings)
    now[0] = 102.0
    limits.check_time(1.0)
    now[0] = 102.1
    with pytest.raises(Stop, match=r"after 2 s of computing time at t = 1 s; --timeout"):
        limits.check(1.0, 0)
    Limits(request().settings).check(1.0, 0)
    assert request().settings.timeout == math.inf


@pytest.mark.parametrize(
    ("ends", "status", "message", "undefined"),
    [
        (None, "completed", "", None),
        (Stop("no way"), "failed", "no way", None),
        (Undefined(STATE), "failed", "no finite value at t = 0.25 s", STATE),
        (Interrupted(), "interrupted", "interrupted", None),
    ],
)
def test_what_ends_a_run_decides_its_outcome(
    ends: Exception | None, status: str, message: str, undefined: State | None
) -> None:
    def integrate() -> None:
        if ends:
            raise ends

    found = outcome(integrate)
    assert found.status == status
    assert message in found.message
    assert found.undefined is undefined


def test_other_exceptions_propagate_to_the_caller() -> None:
    def integrate() -> None:
        raise KeyError("a mistake in the program")

    with pytest.raises(KeyError):
        outcome(integrate)
