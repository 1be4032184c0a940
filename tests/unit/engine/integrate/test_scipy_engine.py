"""The reference engine on a System written by hand: samples, limits, and what it reports."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pendulum_by_hand import G, pendulum, pendulum_system, request

from lagcli.engine.contract import Block, Interrupted, Outcome
from lagcli.engine.integrate import scipy_engine
from lagcli.engine.state import State


def integrated(**changes: Any) -> tuple[Outcome, list[Block]]:
    blocks: list[Block] = []
    return scipy_engine.run(pendulum_system(), request(**changes), blocks.append), blocks


def test_system_written_by_hand() -> None:
    run, blocks = integrated()
    assert run.status == "completed"
    assert run.undefined is None
    assert run.steps > 10
    assert run.evaluations > 12 * run.steps
    (block,) = blocks
    np.testing.assert_allclose(block.q, pendulum(block.time), rtol=0, atol=1e-8)
    # λ = −(m g cos θ + m v²/l)/(2 l), v² = 2 g (−y)
    np.testing.assert_allclose(block.multipliers[:, 0], 3 * G * block.q[:, 1] / 2, atol=1e-7)
    np.testing.assert_allclose(block.work, 0, atol=1e-9)  # like the other errors


def test_run_reports_its_progress() -> None:
    seen: list[float] = []
    run = scipy_engine.run(pendulum_system(), request(), lambda block: None, seen.append)
    assert len(seen) >= run.steps
    assert seen == sorted(seen)
    assert seen[-1] == 2.0


def test_samples_are_handed_over_in_blocks() -> None:
    run, blocks = integrated(block_rows=8)
    assert run.status == "completed"
    assert [len(block.time) for block in blocks] == [8, 8, 5]
    np.testing.assert_array_equal(np.concatenate([b.time for b in blocks]), np.linspace(0, 2, 21))


@pytest.mark.parametrize("method", ["RK45", "Radau", "BDF", "LSODA"])
def test_methods_of_scipy(method: str) -> None:
    run, (block,) = integrated(
        method=method, rtol=1e-6, atol=1e-6, t_end=0.5, times=np.array([0.5])
    )
    assert run.status == "completed"
    np.testing.assert_allclose(block.q, pendulum(block.time), rtol=0, atol=2e-3)
    # projected all the same
    assert abs(block.q[0] @ block.q[0] - 1) < 1e-14


def test_without_projection_the_constraint_drifts() -> None:
    drift = {}
    for formulation in ("projection", "index1"):
        _, (block,) = integrated(formulation=formulation, rtol=1e-4, atol=1e-4)
        drift[formulation] = np.abs((block.q**2).sum(axis=1) - 1).max()
    assert drift["projection"] < 1e-14
    assert drift["index1"] > 1e-6


def test_a_run_ends_at_its_limits() -> None:
    run, blocks = integrated(max_steps=5)
    assert (run.status, run.steps) == ("failed", 5)
    assert "--max-steps" in run.message
    assert len(blocks[0].time) < 21  # those reached by then


def test_an_interrupt_keeps_the_samples() -> None:
    def interrupt(t: float) -> None:
        if t > 0.5:
            raise Interrupted

    blocks: list[Block] = []
    run = scipy_engine.run(pendulum_system(), request(), blocks.append, interrupt)
    assert run.status == "interrupted"
    assert 0.4 < blocks[0].time[-1] < 1.5


def test_exceptions_of_the_sink_propagate_to_the_caller() -> None:
    def full(block: Block) -> None:
        raise OSError("no space left")

    with pytest.raises(OSError, match="no space"):
        scipy_engine.run(pendulum_system(), request(block_rows=2), full)


def test_a_start_without_finite_accelerations_is_undefined() -> None:
    start = State(0.0, np.array([1.0, 0.0]), np.zeros(2), (math.inf,))
    run, blocks = integrated(state=start)
    assert run.status == "failed"
    assert "no finite value at t = 0" in run.message
    assert run.undefined is not None
    np.testing.assert_array_equal(run.undefined.q, start.q)
    assert not blocks


def test_an_interval_of_no_length_is_its_start() -> None:
    run, (block,) = integrated(t_end=0.0, times=np.array([0.0]))
    assert (run.status, run.steps, run.tolerances) == ("completed", 0, None)
    np.testing.assert_array_equal(block.q, [[1.0, 0.0]])
    np.testing.assert_allclose(block.a, [[0.0, -G]], atol=1e-15)
