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

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lagcli.analysis.fit.experiment import Assembly, Evaluation, Experiment, FailedRun
from lagcli.arrays import Array, Flags
from lagcli.engine.constraints.initial import ConsistentState

#: Relative changes of the cost, of the quantities and of the gradient at which a search ends: for
#: 10⁴ measured values, a change of chi-square by 1e-4, a hundredth of a standard error.
_TOLERANCE = 1e-8
#: The time in the message of a run that ended early, with what is known of its accuracy.
_TIME = re.compile(r" t = [-+.\de]+( s| min| h)?( \(to within[^)]*\))?")
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
        At ``values``, with the assembly in which the search ended.
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
        Number of failed evaluations by reason, without the times at which runs ended.
    failure : str
        The reason of the last one.
    """

    def __init__(self, experiments: Sequence[Experiment], low: Array, high: Array, scales: Array):
        self.experiments, self.low, self.high = list(experiments), low, high
        self.scales = scales
        self.runs = 0
        self.failures: Counter[str] = Counter()
        self.failure = ""
        self._known: dict[tuple[bytes, ...], Evaluation | None] = {}

    @property
    def count(self) -> int:
        """The number of measured values."""
        return sum(x.count for x in self.experiments)

    def evaluate(self, values: Array, near: Assembly | None = None) -> Evaluation | None:
        """Return residuals and Jacobian of all experiments; None if a run fails.

        Parameters
        ----------
        values : (k,) array
        near : tuple of ConsistentState, optional
            The initial states for similar values; by default, those of the model's guesses.
        """
        key = values.tobytes(), *(x.state.q.tobytes() for x in near or ())
        if key not in self._known:
            # the last accepted point, and a trial point
            for old in list(self._known)[: len(self._known) + 1 - _KEPT]:
                del self._known[old]
            self._known[key] = self._run(values.tolist(), near)
        else:
            self._known[key] = self._known.pop(key)
        return self._known[key]

    def _run(self, values: list[float], near: Assembly | None) -> Evaluation | None:
        self.runs += 1
        states = near or (None,) * len(self.experiments)
        try:
            parts = [
                experiment(values, state)
                for experiment, state in zip(self.experiments, states, strict=True)
            ]
        except FailedRun as failure:
            self.failures[_TIME.sub(" t = …", str(failure))] += 1
            self.failure = str(failure)
            return None
        return Evaluation(
            np.concatenate([x.residuals for x in parts]),
            np.concatenate([x.jacobian for x in parts]),
            tuple(state for x in parts for state in x.assembly),
        )

    def others(self, values: Array, own: Assembly) -> list[Assembly]:
        """Return other assemblies for the same values that may fit better.

        Of several other ones of an experiment, the one that fits best counts. With several
        experiments, it is in all of them, and in those alone that it fits better.
        """
        best, swapped = list(own), list(own)
        for i, (experiment, state) in enumerate(zip(self.experiments, own, strict=True)):
            found = experiment.others(values.tolist(), state)
            if not found:
                continue
            costs = [self._cost(experiment, values, x) for x in [state, *found]]
            swapped[i] = found[int(np.argmin(costs[1:]))]
            best[i] = swapped[i] if min(costs[1:]) < costs[0] else state
        different = [tuple(swapped)]
        if any(x is not y for x, y in zip(best, swapped, strict=True)):
            different.append(tuple(best))
        return [x for x in different if any(a is not b for a, b in zip(x, own, strict=True))]

    def _cost(self, experiment: Experiment, values: Array, near: ConsistentState) -> float:
        """Return the sum of squares of an experiment; infinite if its run fails."""
        self.runs += 1
        try:
            residuals = experiment(values.tolist(), near).residuals
        except FailedRun:
            return np.inf
        return float(residuals @ residuals)

    def search(
        self, start: Array, free: Flags | None = None, near: Assembly | None = None
    ) -> SearchResult:
        """Minimize the sum of squares.

        Each run has the assembly of the last accepted one.

        Parameters
        ----------
        start : (k,) array
        free : (k,) array of bool, optional
            The quantities to vary; all by default.
        near : tuple of ConsistentState, optional
            The initial states to begin with; by default, those of the model's guesses.
        """
        from scipy.optimize import least_squares

        free = np.ones(len(start), dtype=bool) if free is None else free
        # the exact values that least_squares passes again, so that no run is repeated
        start = np.where(free, start / self.scales * self.scales, start)
        first = self.evaluate(start, near)
        if first is None:
            reason = f"the first run failed: {self.failure}"
            return SearchResult(start, start, np.nan, None, False, reason)
        if not free.any():
            cost = 0.5 * float(first.residuals @ first.residuals)
            return SearchResult(start, start, cost, first, True, "")
        scales, accepted, accepted_at = self.scales[free], first, start

        def at(x: Array) -> Array:
            values = start.copy()
            values[free] = x * scales
            return values

        def evaluated(x: Array) -> Evaluation | None:
            values = at(x)
            if (values == accepted_at).all():
                return accepted
            return self.evaluate(values, accepted.assembly)

        def residuals(x: Array) -> Array:
            evaluation = evaluated(x)
            return np.full(self.count, np.nan) if evaluation is None else evaluation.residuals

        def jacobian(x: Array) -> Array:
            nonlocal accepted, accepted_at
            evaluation = evaluated(x)
            assert evaluation is not None  # requested only at accepted points
            accepted, accepted_at = evaluation, at(x)
            return accepted.jacobian[:, free] * scales

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
        # the last accepted point is the solution
        return SearchResult(
            start, values, float(solution.cost), accepted, solution.status > 0, message
        )

    def searches(self, start: Array) -> list[SearchResult]:
        """Return the results of searches from a point, in the assemblies of the mechanism."""
        first = self.evaluate(start)  # known to the search, unless its scales round it
        found = [self.search(start)]
        others = [] if first is None else self.others(start, first.assembly)
        return found + [self.search(start, near=x) for x in others]

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
