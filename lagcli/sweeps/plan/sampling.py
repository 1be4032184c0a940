"""Points of the unit cube by their number, and distributions over ranges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from lagcli.arrays import Array, Numbers

KINDS = ("sobol", "lhs", "random")

#: Points of one block: a block is a function of its number alone, and so is each of its points.
_BLOCK = 1 << 12
#: Numbers of a Latin hypercube, which exists only as a whole: 128 MB.
MOST_OF_HYPERCUBE = 1 << 24
#: Points of a Sobol sequence, in the 30 bits that each coordinate has.
MOST_OF_SOBOL = 1 << 30


@dataclass(frozen=True)
class Distribution:
    """Distribution of values over a range, in SI.

    Parameters
    ----------
    kind : "uniform", "loguniform" or "normal"
    a, b : float
        The ends; of "normal" mean and standard deviation.
    """

    kind: str
    a: float
    b: float

    def quantile(self, u: Array) -> Array:
        """Return the quantiles of the probabilities ``u``."""
        a, b = self.a, self.b
        if self.kind == "uniform":
            return a + (b - a) * u
        if self.kind == "loguniform":
            return np.asarray(a * (b / a) ** u, dtype=np.float64)
        from scipy.special import ndtri

        # the ends of the unit interval have no quantile: half of what Sobol's 30 bits resolve
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
        Functions of the arguments: the same whoever asks, and in whichever order.
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
    # whole blocks of a power of two: what SciPy asks for
    return np.asarray(engine.random(_BLOCK))


@lru_cache(maxsize=2)
def _sobol(dimensions: int, seed: int) -> Any:
    from scipy.stats import qmc

    return qmc.Sobol(dimensions, seed=seed)
