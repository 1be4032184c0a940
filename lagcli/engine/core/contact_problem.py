"""Contact problems: forces or impulses of contacts and the resulting motion at one instant."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array, Indices


class ContactLaw(IntEnum):
    """The law of a row of a contact problem.

    UNILATERAL: 0 ≤ x ⊥ y ≥ 0. LIMITED: y = 0 and |x| ≤ static limit, or y ≠ 0 and x is minus the
    sign of y times the kinetic limit. FREE: y = 0. FORWARD and BACKWARD: the row is slipping, with
    a positive or negative velocity; x is minus or plus the kinetic limit, y is arbitrary.
    """

    UNILATERAL = 0
    LIMITED = 1
    FREE = 2
    FORWARD = 3
    BACKWARD = 4


class ContactProblem(NamedTuple):
    """Find x and y = A x + b that satisfy a law in each of n rows.

    x are forces and y accelerations, or x are impulses and y velocities; the signs of unilateral
    rows are such that both are not negative. Bilateral rows whose multiplier does not occur in a
    limit are eliminated from A. The limits are affine in |x|.

    Parameters
    ----------
    matrix, offset : (n, n) and (n,) arrays
        A, symmetric and positive semidefinite, and b.
    laws : (n,) array of int
        `ContactLaw`.
    static, kinetic : (n,) arrays
        Constant parts of the limits of limited and slipping rows.
    static_slopes, kinetic_slopes : (n, n) arrays
        limit_k = constant_k + Σ_j slope_kj |x_j|.
    """

    matrix: Array
    offset: Array
    laws: Array
    static: Array
    kinetic: Array
    static_slopes: Array
    kinetic_slopes: Array

    def violation(self, force: Array, motion: Array) -> float:
        """Return the largest violation of y = A x + b or of a law."""
        x, y, size = force, motion, np.abs(force)
        static = self.static + self.static_slopes @ size
        kinetic = self.kinetic + self.kinetic_slopes @ size
        violations = {
            ContactLaw.UNILATERAL: np.abs(np.minimum(x, y)),
            ContactLaw.LIMITED: np.minimum(
                np.maximum(np.abs(y), size - static),
                np.maximum(np.abs(size - kinetic), np.minimum(np.abs(x), x * np.sign(y)).clip(0)),
            ),
            ContactLaw.FREE: np.abs(y),
            ContactLaw.FORWARD: np.abs(x + kinetic),
            ContactLaw.BACKWARD: np.abs(x - kinetic),
        }
        off = [np.where(self.laws == law, v, 0.0) for law, v in violations.items()]
        return float(max(np.max(off, initial=0.0), np.abs(y - self.matrix @ x - self.offset).max()))


class ContactSolution(NamedTuple):
    """A solution of a contact problem.

    Parameters
    ----------
    force, motion : (n,) arrays
        x and y.
    modes : (n,) array of int
        `RowMode` of each row.
    """

    force: Array
    motion: Array
    modes: Indices
