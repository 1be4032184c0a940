"""Least squares over all experiments, from one or several starting points.

SciPy's trust-region reflective algorithm shortens its step if a residual is not finite, so that a
failed run is never the minimum.

References
----------
M. A. Branch, T. F. Coleman and Y. Li, A subspace, interior, and conjugate gradient method for
large-scale bound-constrained minimization problems, SIAM J. Sci. Comput. 21 (1999),
doi:10.1137/S1064827595289108.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lagcli.analysis.fit.experiment import Evaluation, Experiment, FailedRun
from lagcli.arrays import Array, Flags

#: Relative changes of the cost, of the quantities and of the gradient at which a search ends: for
#: 10⁴ measured values, a change of chi-square by 1e-4, a hundredth of a standard error.
_TOLERANCE = 1e-8
#: Number of cached evaluations.
_KEPT = 2
#: Largest number of runs of one search.
_MOST_RUNS = 300
#: Starting values of quantities without bounds lie within this factor of the first one.
_FACTOR = 3.0


class SearchResult(NamedTuple):
    """The end point of a search.

    Parameters
    ----------
    start, values : (k,) arrays
        First and last values, in SI.
    cost : float
        Half the sum of squares; NaN if there is none.
    evaluation : Evaluation or None
        At ``values``.
    converged : bool
    message : str
        Why it ended, if it did not converge.
    """

    start: Array
    values: Array
    cost: float
    evaluation: Evaluation | None
    converged: bool
    message: str


class Problem:
    """The residuals of all experiments, and the bounds.

    Parameters
    ----------
    experiments : sequence of Experiment
    low, high : (k,) arrays
        Bounds in SI.
    scales : (k,) array
        Sizes of the fitted quantities.

    Attributes
    ----------
    runs : int
        Evaluations of all experiments so far.
    failures : Counter of str
        Number of failed evaluations by reason.
    """

    def __init__(self, experiments: Sequence[Experiment], low: Array, high: Array, scales: Array):
        self.experiments, self.low, self.high = list(experiments), low, high
        self.scales = scales
        self.runs = 0
        self.failures: Counter[str] = Counter()
        self._known: dict[bytes, Evaluation | None] = {}

    @property
    def count(self) -> int:
        """The number of measured values."""
        return sum(x.count for x in self.experiments)

    def evaluate(self, values: Array) -> Evaluation | None:
        """Return residuals and Jacobian of all experiments; None if a run fails."""
        key = values.tobytes()
        if key not in self._known:
            # the last accepted point, and a trial point
            for old in list(self._known)[: len(self._known) + 1 - _KEPT]:
                del self._known[old]
            self._known[key] = self._run(values.tolist())
        else:
            self._known[key] = self._known.pop(key)
        return self._known[key]

    def _run(self, values: list[float]) -> Evaluation | None:
        self.runs += 1
        try:
            parts = [experiment(values) for experiment in self.experiments]
        except FailedRun as failure:
            self.failures[str(failure)] += 1
            return None
        return Evaluation(
            np.concatenate([x.residuals for x in parts]),
            np.concatenate([x.jacobian for x in parts]),
        )

    def search(self, start: Array, free: Flags | None = None) -> SearchResult:
        """Minimize the sum of squares.

        Parameters
        ----------
        start : (k,) array
        free : (k,) array of bool, optional
            The quantities to vary; all by default.
        """
        from scipy.optimize import least_squares

        free = np.ones(len(start), dtype=bool) if free is None else free
        # the exact values that least_squares passes again, so that no run is repeated
        start = np.where(free, start / self.scales * self.scales, start)
        first = self.evaluate(start)
        if first is None:
            reason = next(reversed(self.failures), "")
            return SearchResult(
                start, start, np.nan, None, False, f"the first run failed: {reason}"
            )
        if not free.any():
            cost = 0.5 * float(first.residuals @ first.residuals)
            return SearchResult(start, start, cost, first, True, "")
        scales = self.scales[free]

        def at(x: Array) -> Array:
            values = start.copy()
            values[free] = x * scales
            return values

        def residuals(x: Array) -> Array:
            evaluation = self.evaluate(at(x))
            return np.full(self.count, np.nan) if evaluation is None else evaluation.residuals

        def jacobian(x: Array) -> Array:
            evaluation = self.evaluate(at(x))
            assert evaluation is not None  # requested only at accepted points
            return evaluation.jacobian[:, free] * scales

        solution = least_squares(
            residuals,
            start[free] / scales,
            jacobian,
            bounds=(self.low[free] / scales, self.high[free] / scales),
            x_scale="jac",
            ftol=_TOLERANCE,
            xtol=_TOLERANCE,
            gtol=_TOLERANCE,
            max_nfev=_MOST_RUNS,
        )
        values = at(solution.x)
        message = "" if solution.status > 0 else f"no convergence within {_MOST_RUNS} runs"
        return SearchResult(
            start, values, float(solution.cost), self.evaluate(values), solution.status > 0, message
        )

    def starts(self, first: Array, count: int) -> Array:
        """Return starting points, (count, k): the given one, and Sobol points between the bounds.

        A quantity without a bound on one side starts within a factor of 3 of the given value.
        """
        if count == 1:
            return first[None]
        from scipy.stats import qmc

        power = int(np.ceil(np.log2(count)))
        points = qmc.Sobol(len(first), rng=0).random_base2(power)[: count - 1]
        size = self.scales
        near_low = np.where(first > 0, first / _FACTOR, first - _FACTOR * size)
        near_high = np.where(first < 0, first / _FACTOR, first + (_FACTOR - 1) * size)
        low = np.where(np.isfinite(self.low), self.low, np.minimum(near_low, self.high))
        high = np.where(np.isfinite(self.high), self.high, np.maximum(near_high, self.low))
        return np.concatenate([first[None], low + points * (high - low)])
