"""The values of one varied quantity, as functions of their index; points of samples."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from lagcli.arrays import Array, Numbers


class Factor(Protocol):
    """One factor of a plan: some columns, and the values in each of its rows."""

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of parameters, coordinates and velocities (``phi'``)."""

    @property
    def length(self) -> int:
        """The number of rows."""

    def rows(self, numbers: Numbers) -> Array:
        """Return the values, in SI, of given rows, (n, columns)."""


@dataclass(frozen=True)
class Steps:
    """Equidistant values, each rounded once: 1 + 2·0.1 is 1.2.

    Parameters
    ----------
    columns : tuple of str
        The one name.
    first, step : Fraction or float
    length : int
    si : Fraction or float
        The factor to SI.
    """

    columns: tuple[str, ...]
    first: Fraction | float
    step: Fraction | float
    length: int
    si: Fraction | float = Fraction(1)

    def rows(self, numbers: Numbers) -> Array:
        """Return the values, (n, 1)."""
        # repeated numbers are computed once
        different, places = np.unique(numbers, return_inverse=True)
        values = [float((self.first + int(k) * self.step) * self.si) for k in different]
        return np.array(values, dtype=np.float64)[places.reshape(-1), None]


@dataclass(frozen=True)
class Ratios:
    """Geometric sequence from ``first`` to ``last``, both in SI and positive."""

    columns: tuple[str, ...]
    first: float
    last: float
    length: int

    def rows(self, numbers: Numbers) -> Array:
        """Return the values, (n, 1)."""
        part = numbers / max(1, self.length - 1)
        values = self.first * (self.last / self.first) ** part
        ends = numbers[:, None] == np.array([0, self.length - 1])
        values = np.where(ends[:, 1], self.last, values)
        return np.where(ends[:, 0], self.first, values)[:, None]


@dataclass(frozen=True, eq=False)
class TableFactor:
    """Explicit rows of values.

    Parameters
    ----------
    columns : tuple of k str
    values : (n, k) array
        Values in SI.
    """

    columns: tuple[str, ...]
    values: Array

    @property
    def length(self) -> int:
        """The number of rows."""
        return len(self.values)

    def rows(self, numbers: Numbers) -> Array:
        """Return the values, (n, k)."""
        return self.values[numbers]


@dataclass(frozen=True)
class Sample:
    """Points drawn from distributions.

    Parameters
    ----------
    kind : "sobol", "lhs" or "random"
    length, seed : int
    columns : tuple of k str
    distributions : tuple of k Distribution
    """

    kind: str
    length: int
    seed: int
    columns: tuple[str, ...]
    distributions: tuple[Distribution, ...]

    def rows(self, numbers: Numbers) -> Array:
        """Return the values, (n, k)."""
        points = unit_points(self.kind, self.length, len(self.columns), self.seed, numbers)
        return np.column_stack(
            [d.quantile(u) for d, u in zip(self.distributions, points.T, strict=True)]
        )


SAMPLE_KINDS = ("sobol", "lhs", "random")

#: Number of points of a block: a block, and each of its points, is a function of its number.
_BLOCK = 1 << 12
#: Largest number of values of a Latin hypercube, which is generated as a whole: 128 MB.
MOST_OF_HYPERCUBE = 1 << 24
#: Largest number of points of a Sobol sequence with 30 bits per coordinate.
MOST_OF_SOBOL = 1 << 30


@dataclass(frozen=True)
class Distribution:
    """Distribution of values over a range, in SI.

    Parameters
    ----------
    kind : "uniform", "loguniform" or "normal"
    a, b : float
        The ends; for "normal", mean and standard deviation.
    """

    kind: str
    a: float
    b: float

    def quantile(self, u: Array) -> Array:
        """Return the quantiles of probabilities ``u``."""
        a, b = self.a, self.b
        if self.kind == "uniform":
            return a + (b - a) * u
        if self.kind == "loguniform":
            return np.asarray(a * (b / a) ** u, dtype=np.float64)
        from scipy.special import ndtri

        # the ends of the unit interval have no quantile: use half the resolution of Sobol's 30 bits
        inside = np.clip(u, 2.0**-31, 1 - 2.0**-31)
        return np.asarray(a + b * ndtri(inside), dtype=np.float64)


def unit_points(kind: str, count: int, dimensions: int, seed: int, numbers: Numbers) -> Array:
    """Return some of ``count`` points of the unit cube.

    Parameters
    ----------
    kind : "sobol", "lhs" or "random"
        Scrambled Sobol points, a Latin hypercube (both of scipy.stats.qmc), or independent ones.
    count, dimensions, seed : int
    numbers : (n,) array of int

    Returns
    -------
    (n, dimensions) array
        Functions only of the arguments.
    """
    if kind == "lhs":
        return _hypercube(count, dimensions, seed)[numbers]
    block = _sobol_block if kind == "sobol" else _random_block
    points = np.empty((len(numbers), dimensions))
    blocks = numbers // _BLOCK
    for which in np.unique(blocks):
        mine = blocks == which
        points[mine] = block(dimensions, seed, int(which))[numbers[mine] - which * _BLOCK]
    return points


@lru_cache(maxsize=2)
def _hypercube(count: int, dimensions: int, seed: int) -> Array:
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(dimensions, seed=seed).random(count))


@lru_cache(maxsize=8)
def _random_block(dimensions: int, seed: int, block: int) -> Array:
    return np.random.default_rng([seed, block]).random((_BLOCK, dimensions))


@lru_cache(maxsize=8)
def _sobol_block(dimensions: int, seed: int, block: int) -> Array:
    engine = _sobol(dimensions, seed)
    start = block * _BLOCK
    if engine.num_generated > start:
        engine.reset()
    if engine.num_generated < start:
        engine.fast_forward(start - engine.num_generated)
    # complete blocks of a power of two, as SciPy requires
    return np.asarray(engine.random(_BLOCK))


@lru_cache(maxsize=2)
def _sobol(dimensions: int, seed: int) -> Any:
    from scipy.stats import qmc

    return qmc.Sobol(dimensions, seed=seed)
