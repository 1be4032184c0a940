"""The values of one varied quantity, as functions of their index."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

import numpy as np

from lagcli.arrays import Array, Numbers
from lagcli.sweeps.plan.sampling import Distribution, unit_points


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
