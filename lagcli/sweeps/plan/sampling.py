"""Points of the unit cube by their number, and distributions over ranges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from lagcli.arrays import Array, Numbers

KINDS = ("sobol", "lhs", "random")

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
