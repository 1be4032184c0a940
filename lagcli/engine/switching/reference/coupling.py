"""Coupling of contacts: the inverse inertia at rows, with bilateral rows eliminated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.evaluator import Dynamics
from lagcli.engine.linear import dense

#: Compliances below this, relative to the squared length of a row, are rounding errors.
_IMMOBILE = 1e-20


class Coupling:
    """Response of a system to forces on some of its rows, at one state.

    Parameters
    ----------
    d : Dynamics
        With all constraints.
    bilateral : sequence of int
        Bilateral constraints.
    rows : sequence of int
        Constraints with unknown forces (or impulses).
    sizes, lengths : (nq,) and (nc,) arrays
        Scales of the coordinates, and lengths of B's rows times these.

    Attributes
    ----------
    matrix : (n, n) array
        A: accelerations of the rows due to forces on them.
    along_q, along_bilateral : (nq, n) and (nb, n) arrays
        Accelerations, and multipliers of bilateral rows, due to forces on the rows.
    """

    def __init__(
        self,
        d: Dynamics,
        bilateral: Sequence[int],
        rows: Sequence[int],
        sizes: Array,
        lengths: Array,
    ):
        self._d = d
        self.bilateral, self.rows = list(bilateral), list(rows)
        self._jacobian = d.jacobian[self.bilateral]
        self._parts: dense.Decomposition | None = None
        if self.bilateral:
            parts = dense.decompose(self._jacobian, scale=lengths[self.bilateral], sizes=sizes)
            if parts.rank < len(self.bilateral):
                self._parts = parts
        at = d.jacobian[self.rows]
        nothing = np.zeros(len(self.bilateral))
        answers = [self.answer(row, nothing) for row in at]
        self.along_q = np.array([a for a, _ in answers]).reshape(len(at), at.shape[1]).T
        self.along_bilateral = np.array([x for _, x in answers]).reshape(len(at), len(nothing)).T
        matrix = at @ self.along_q
        matrix = (matrix + matrix.T) / 2
        fixed = np.diag(matrix) <= _IMMOBILE * lengths[self.rows] ** 2
        matrix[fixed] = 0.0
        matrix[:, fixed] = 0.0
        self.matrix = matrix

    def answer(self, forcing: Array, rhs: Array) -> tuple[Array, Array]:
        """Return a and the multipliers of the bilateral rows for given forces, with B a = rhs."""
        d = self._d
        if self._parts is None:
            return dense.solve_regular(d.mass_matrix, forcing, self._jacobian, rhs)
        return dense.solve_redundant(d.mass_matrix, forcing, rhs, self._parts)

    def loaded(self, forcing: Array) -> tuple[Array, Array, Array]:
        """Return a, multipliers of bilateral rows, and y of the rows, without forces on these."""
        a, multipliers = self.answer(forcing, self._d.rhs[self.bilateral])
        return a, multipliers, self._d.jacobian[self.rows] @ a - self._d.rhs[self.rows]
