"""Covariance, identifiability and confidence intervals of fitted quantities.

With the Jacobian J of the residuals at the minimum, the covariance is s² (JᵀJ)⁻¹, where s = 1 if
the standard deviations of the data are known; otherwise, s² is the sum of squares over the degrees
of freedom. If a singular value of J, with columns scaled by the fitted values, vanishes, the data
do not identify a combination of quantities.

References
----------
D. M. Bates and D. G. Watts, Nonlinear Regression Analysis and Its Applications (1988), ch. 2 and
ch. 6 (profiles), doi:10.1002/9780470316757.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lagcli.analysis.fit.experiment import Assembly
from lagcli.analysis.fit.search import Problem
from lagcli.arrays import Array, Flags

#: Singular values below this part of the largest count as zero, with columns of equal length: the
#: Jacobian is not more accurate.
_VANISHING = 1e-6
#: Columns below this part of the longest count as zero.
_UNSEEN = 1e-10
#: A profile is evaluated at 2, 3, ... standard errors on each side, in steps that grow by 1.5, up
#: to 34. Its ends are located to this fraction of a standard error.
_FIRST, _GROWTH, _STEPS, _END = 2.0, 1.5, 8, 1e-3


class ParameterCombination(NamedTuple):
    """Quantities that can change together without changing the data.

    Parameters
    ----------
    names : tuple of str
    changes : tuple of float
        Relative changes of the quantities, the largest being 1; absolute ones for quantities that
        are zero.
    """

    names: tuple[str, ...]
    changes: tuple[float, ...]

    @property
    def text(self) -> str:
        """The combination in words."""
        parts = [f"{n} {100 * x:+.3g} %" for n, x in zip(self.names, self.changes, strict=True)]
        if len(parts) == 1:
            return f"{self.names[0]}: the data do not depend on it"
        return f"{', '.join(self.names)}: no change of the data for {', '.join(parts)}"


class Uncertainty(NamedTuple):
    """Uncertainty of the fitted quantities, from the Jacobian at the minimum.

    Parameters
    ----------
    covariance : (k, k) array
        NaN for quantities that are not identified or lie on a bound.
    combinations : tuple of ParameterCombination
        Combinations that are not identified.
    sigma : float
        s; 1 if the standard deviations of the data are known.
    freedom : int
        Number of measured values minus that of the combinations that they identify.
    """

    covariance: Array
    combinations: tuple[ParameterCombination, ...]
    sigma: float
    freedom: int

    @property
    def standard_errors(self) -> Array:
        """Square roots of the variances, (k,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """Correlations, (k, k)."""
        size = self.standard_errors
        return np.asarray(self.covariance / np.outer(size, size))


def uncertainty(
    residuals: Array,
    jacobian: Array,
    values: Array,
    scales: Array,
    names: Sequence[str],
    free: Flags,
    estimated: bool,
) -> Uncertainty:
    """Return the covariance of fitted quantities and the combinations that are not identified.

    Parameters
    ----------
    residuals : (n,) array
    jacobian : (n, k) array
    values : (k,) array
    scales : (k,) array
        Sizes of the quantities where the search began.
    names : sequence of k str
    free : (k,) array of bool
        The quantities that do not lie on a bound.
    estimated : bool
        Whether the standard deviation of the data is estimated.
    """
    places = np.flatnonzero(free)
    size = np.where(values != 0, np.abs(values), 1.0)[places]
    # a value near zero says nothing about the size of the quantity
    widest = np.maximum(size, scales[places])
    # columns differ in length because of units; that is not a dependency
    sizes = np.linalg.norm(jacobian[:, places] * widest, axis=0)
    unseen = sizes <= _UNSEEN * max(sizes.max(initial=0.0), 1e-300)
    size = np.where(unseen, widest, size)
    scaled = np.where(unseen, 0.0, jacobian[:, places] * size)
    lengths = np.linalg.norm(scaled, axis=0)
    weight = np.where(lengths > 0, lengths, 1.0)
    # with fewer measured values than quantities, the combinations that have no singular value too
    few = len(scaled) < len(places)
    _, singular, right = np.linalg.svd(scaled / weight, full_matrices=few)
    singular = np.pad(singular, (0, len(places) - len(singular)))
    right = right.T
    least = _VANISHING * max(singular.max(initial=0.0), 1e-300)
    vanishing = singular <= least
    kept = right[:, ~vanishing] / singular[~vanishing]
    # rounding errors of J turn the directions by this
    rounding = least * np.linalg.norm(kept, axis=1) + _VANISHING
    directions = _simple(right[:, vanishing])
    involved = np.abs(directions) > rounding
    relative = np.where(values[places] < 0, -1.0, 1.0) / weight
    combinations = tuple(
        _combination(direction * relative, which, [names[int(i)] for i in places])
        for direction, which in zip(directions, involved, strict=True)
    )
    freedom = len(residuals) - int((~vanishing).sum())
    square = float(residuals @ residuals)
    sigma = 1.0
    if estimated:
        sigma = math.sqrt(square / freedom) if freedom > 0 else math.nan
    root = sigma * (size / weight)[:, None] * kept
    block = root @ root.T
    unidentified = involved.any(axis=0)
    block[unidentified] = np.nan
    block[:, unidentified] = np.nan
    covariance = np.full((len(values), len(values)), np.nan)
    covariance[np.ix_(places, places)] = block
    return Uncertainty(covariance, combinations, sigma, freedom)


def _simple(directions: Array) -> Array:
    """Return a sparse basis of the span of columns, one a row, by Gaussian elimination."""
    rows = directions.T.copy()
    for k in range(len(rows)):
        j = int(np.argmax(np.abs(rows[k])))
        rows[k] /= rows[k, j]
        for other in range(len(rows)):
            if other != k:
                rows[other] -= rows[other, j] * rows[k]
    return rows


def _combination(direction: Array, involved: Flags, names: Sequence[str]) -> ParameterCombination:
    direction = direction / direction[int(np.argmax(np.abs(np.where(involved, direction, 0.0))))]
    named = np.flatnonzero(involved).tolist()
    return ParameterCombination(
        tuple(names[i] for i in named), tuple(float(direction[i]) for i in named)
    )


def quantile(level: float, freedom: int, estimated: bool) -> float:
    """Return the half-width of an interval in standard errors."""
    from scipy.stats import norm, t

    upper = 0.5 * (1 + level)
    return float(t.ppf(upper, freedom) if estimated and freedom > 0 else norm.ppf(upper))


def profile_interval(
    problem: Problem, values: Array, near: Assembly, place: int, error: float, rise: float
) -> tuple[float, float]:
    """Return the profile-likelihood interval of one quantity.

    Parameters
    ----------
    problem : Problem
    values : (k,) array
        Values at the minimum.
    near : tuple of ConsistentState
        The initial states there.
    place : int
        Index of the quantity.
    error : float
        Standard error of the quantity.
    rise : float
        Rise of the sum of squares.

    Returns
    -------
    low, high : float
        A bound if the sum of squares rises less up to it; NaN if it does not rise enough within 34
        standard errors, or a run fails.
    """
    low, high = (_profile_end(problem, values, near, place, x, rise) for x in (-error, error))
    return low, high


def _profile_end(
    problem: Problem, values: Array, near: Assembly, place: int, error: float, rise: float
) -> float:
    from scipy.optimize import brentq

    free = np.arange(len(values)) != place
    minimum = problem.evaluate(values, near)
    assert minimum is not None
    least = float(minimum.residuals @ minimum.residuals)
    bound = problem.low[place] if error < 0 else problem.high[place]
    warm = values.copy()

    def excess(value: float) -> float:
        nonlocal near
        start = warm.copy()
        start[place] = value
        minimum = problem.search(start, free, near)
        if minimum.evaluation is None:
            return math.nan
        warm[:] = minimum.values
        near = minimum.evaluation.assembly
        return 2 * minimum.cost - least - rise

    inner, outer = float(values[place]), float(values[place])
    for step in range(_STEPS):
        outer = values[place] + error * _FIRST * _GROWTH**step
        limited = (outer - bound) * np.sign(error) >= 0
        outer = float(bound) if limited else float(outer)
        at_end = excess(outer)
        if math.isnan(at_end):
            return math.nan
        if at_end > 0:
            return float(brentq(excess, inner, outer, xtol=_END * abs(error)))
        if limited:
            return outer
        inner = outer
    return math.nan
