"""Breaks: times at which the right side is not smooth, and steps end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from integration_requests import changed
from lowered import lowered

import lagcli
from lagcli.engine.contract import Block, IntegrationRequest, Outcome
from lagcli.engine.integrate.batch import suits_batch
from lagcli.engine.integrate.engine import integrate
from lagcli.engine.system import State
from lagcli.settings.settings import SettingsOverrides, resolve

#: The force |t − 1|: x is a polynomial of degree 3 on either side.
PUSHED = lowered(
    lagcli.load_text("coordinates: [x]\nT: x'^2/2\nQ: {x: abs(t - 1)}\ninitial: {x: 0, x': 0}\n")
)
TIMES = np.linspace(0.0, 3.0, 13)


def place(t: np.ndarray) -> np.ndarray:
    before = t**2 / 2 - t**3 / 6
    after = 1 / 3 + (t - 1) / 2 + (t - 1) ** 3 / 6
    return np.where(t < 1, before, after)


class Ended(NamedTuple):
    """How a run ended, its samples, and the times reported to `progress`."""

    outcome: Outcome
    time: np.ndarray
    q: np.ndarray
    reached: list[float]


def request(**changes: object) -> IntegrationRequest:
    base = IntegrationRequest(
        state=State(0.0, np.zeros(1), np.zeros(1), PUSHED.p),
        rank=0,
        settings=resolve(SettingsOverrides(t_end=3.0, rtol=1e-9)),
        times=TIMES,
        atol=1e-11,
    )
    return changed(base, **changes)


def run(**changes: object) -> Ended:
    blocks: list[Block] = []
    reached: list[float] = []
    outcome = integrate(PUSHED.system, request(**changes), blocks.append, reached.append)
    time, q = (np.concatenate(x) for x in zip(*((b.time, b.q) for b in blocks), strict=True))
    return Ended(outcome, time, q, reached)


@pytest.mark.parametrize("method", ["DOP853", "Radau", "Rodas5P"])
def test_a_kink_at_a_break_costs_no_accuracy(method: str) -> None:
    """They are exact on either side; no sample is left out."""
    ended = run(method=method, breaks=np.array([1.0]))
    assert ended.outcome.status == "completed", ended.outcome.message
    np.testing.assert_array_equal(ended.time, TIMES)
    np.testing.assert_allclose(ended.q[:, 0], place(TIMES), rtol=0, atol=1e-13)


def test_steps_end_at_breaks() -> None:
    """However long steps would be; the run goes on with the size that it had before."""
    breaks = np.array([0.3, 1.0, 1.0 + 1e-12, 2.9])
    free = run(method="DOP853", breaks=np.array([1.0]))
    held = run(method="DOP853", breaks=breaks)
    np.testing.assert_allclose(held.q, free.q, rtol=0, atol=1e-13)
    assert held.outcome.steps <= free.outcome.steps + 4


@pytest.mark.parametrize("at", [[], [0.0], [3.0], [-1.0, 5.0]])
def test_breaks_beside_the_run_change_nothing(at: list[float]) -> None:
    """Breaks at its ends and outside leave the samples as they are, each once."""
    ended = run(method="DOP853", breaks=np.array([*at]))
    np.testing.assert_array_equal(ended.time, TIMES)
    np.testing.assert_allclose(ended.q[:, 0], place(TIMES), rtol=0, atol=1e-8)


@pytest.mark.parametrize("rows", [1, 3])
def test_samples_at_breaks_fit_into_small_blocks(rows: int) -> None:
    """A block may be full at a break, and at the end."""
    ended = run(method="DOP853", breaks=TIMES, block_rows=rows)
    np.testing.assert_array_equal(ended.time, TIMES)
    np.testing.assert_allclose(ended.q[:, 0], place(TIMES), rtol=0, atol=1e-13)


def test_runs_with_breaks_have_no_lanes() -> None:
    """They are done one by one."""
    assert not suits_batch(PUSHED.system, request(breaks=np.array([1.0])))
