"""Maggi's equations: Lagrange's equations projected onto the motions that the constraints allow.

    Σ_i J_ik (d/dt ∂L/∂q̇_i − ∂L/∂q_i − Q_i) = 0,

where the columns of J span the null space of B over the independent coordinates. They hold for
nonholonomic constraints too; the multipliers do not occur.

References
----------
J. I. Neimark, N. A. Fufaev, Dynamics of Nonholonomic Systems, American Mathematical Society, 1972,
chapter III.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import symengine as se
from symengine import Basic

from lagcli.equations.reduction.partition import CoordinatePartition


@dataclass(frozen=True, eq=False)
class Maggi:
    """Maggi's equations of a system with n independent coordinates.

    Parameters
    ----------
    partition : CoordinatePartition
    """

    partition: CoordinatePartition

    @cached_property
    def equations_of_motion(self) -> tuple[Basic, ...]:
        """The n left sides Σ_i J_ik (d/dt ∂L/∂q̇_i − ∂L/∂q_i − Q_i)."""
        e = self.partition.equations
        parts = zip(e.momentum_rates, e.gradient, e.applied_forces, strict=True)
        residuals = [rate - slope - force for rate, slope, force in parts]
        return self._projected(residuals)

    @cached_property
    def mass_matrix(self) -> tuple[tuple[Basic, ...], ...]:
        """JᵀM J, n by n."""
        rows = self.partition.null_space
        size = len(self.partition.independent)
        columns = []
        for k in range(size):
            column = [row[k] if k in row else se.Integer(0) for row in rows]
            columns.append(self._projected(self._weighted(column)))
        return tuple(tuple(columns[k][i] for k in range(size)) for i in range(size))

    @cached_property
    def forcing(self) -> tuple[Basic, ...]:
        """Jᵀ(f − M c), where a = J a_independent + c."""
        weighted = self._weighted(self.partition.acceleration_rhs)
        forces = self.partition.equations.forcing
        left = [f - x for f, x in zip(forces, weighted, strict=True)]
        return self._projected(left)

    def _weighted(self, vector: tuple[Basic, ...] | list[Basic]) -> list[Basic]:
        """Return M times a vector."""
        mass = self.partition.equations.mass_matrix
        return [se.Add(*[m * vector[j] for j, m in row.items()]) for row in mass]

    def _projected(self, vector: list[Basic]) -> tuple[Basic, ...]:
        """Return Jᵀ times a vector."""
        terms: list[list[Basic]] = [[] for _ in self.partition.independent]
        for x, row in zip(vector, self.partition.null_space, strict=True):
            for k, j in row.items():
                terms[k].append(j * x)
        return tuple(se.Add(*parts) for parts in terms)
