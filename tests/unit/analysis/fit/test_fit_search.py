"""Searches: starts between bounds, residuals that fail, fixed quantities."""

from __future__ import annotations

import numpy as np

from lagcli.analysis.fit.experiment import Evaluation, FailedRun
from lagcli.analysis.fit.search import Problem


class Line:
    """Residuals of a line a + b t at t = 0, 1, 2, measured as 1, 3, 5; fails for b > limit."""

    count = 3

    def __init__(self, limit: float = np.inf):
        self.limit = limit

    def __call__(self, values: list[float], near: None = None) -> Evaluation:
        a, b = values
        if b > self.limit:
            raise FailedRun("too steep")
        t = np.arange(3.0)
        residuals = a + b * t - np.array([1.0, 3.0, 5.0])
        return Evaluation(residuals, np.stack([np.ones(3), t], axis=1), ())


def problem(line: Line, low: float = -np.inf, high: float = np.inf) -> Problem:
    return Problem([line], np.array([low, -10.0]), np.array([high, 10.0]), np.ones(2))  # type: ignore[list-item]


def test_a_search_finds_the_minimum() -> None:
    found = problem(Line()).search(np.array([0.0, 0.0]))
    np.testing.assert_allclose(found.values, [1, 2], atol=1e-6)
    assert found.converged
    assert found.cost < 1e-12


def test_quantities_can_be_held() -> None:
    found = problem(Line()).search(np.array([0.0, 0.0]), np.array([True, False]))
    np.testing.assert_allclose(found.values, [3, 0], atol=1e-6)
    held = problem(Line()).search(np.array([0.0, 1.0]), np.array([False, False]))
    np.testing.assert_array_equal(held.values, [0, 1])


def test_failed_runs_shorten_the_step_and_are_counted() -> None:
    searched = problem(Line(limit=1.5))
    found = searched.search(np.array([0.0, 0.0]))
    assert found.values[1] <= 1.5
    assert found.cost > 0.01
    assert searched.failures["too steep"] >= 1
    failing = problem(Line(limit=-1.0)).search(np.array([0.0, 0.0]))
    assert failing.evaluation is None
    assert not failing.converged
    assert "too steep" in failing.message


def test_runs_that_end_at_different_times_for_one_reason_are_counted_together() -> None:
    class Ending(Line):
        def __call__(self, values, near=None):
            at = f"singular at t = {2 + values[0]:.6g} s"
            note = " (to within 2e-08 s, extrapolated from t = 0.0001 s)" if values[0] > 1 else ""
            raise FailedRun(f"{at}{note}: the constraint has no gradient there")

    ending = problem(Ending())
    for x in (0.0, 1.0, 2.0):
        assert ending.evaluate(np.array([x, 0.0])) is None
    assert dict(ending.failures) == {"singular at t = …: the constraint has no gradient there": 3}
    # a search that cannot begin says when
    said = ending.search(np.array([3.0, 0.0])).message
    assert "t = 5 s" in said


def test_starts_lie_between_the_bounds_or_near_the_first() -> None:
    first = np.array([4.0, 1.0])
    found = problem(Line(), low=0.0).starts(first, 9)
    assert found.shape == (9, 2)
    np.testing.assert_array_equal(found[0], first)
    assert (found[1:, 0] >= 0).all()
    assert (found[1:, 0] <= 6.0).all()
    assert (np.abs(found[1:, 1]) <= 10).all()
    assert len(np.unique(found, axis=0)) == 9
    np.testing.assert_array_equal(found, problem(Line(), low=0.0).starts(first, 9))


def test_no_run_of_a_search_is_repeated() -> None:
    """The point found is known although the last one that was tried is another."""
    seen: list[list[float]] = []

    class Watched(Line):
        def __call__(self, values: list[float], near: None = None) -> Evaluation:
            seen.append(values)
            return super().__call__(values)

    problem(Watched(limit=1.5)).search(np.array([0.0, 0.0]))
    assert len(seen) == len({tuple(x) for x in seen})
