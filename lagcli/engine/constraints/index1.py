"""The index-1 form: twice differentiated constraints determine a and λ at every state.

y = (q, v, W), where W is the work done on the system; y' = (v, a, power).
"""

from __future__ import annotations

import math

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.evaluator import Dynamics, Evaluator
from lagcli.engine.linear import dense
from lagcli.engine.system import State

#: Relative residual of B a = γ above which redundant constraints contradict each other.
_CONTRADICTION = 1e-6


class Index1:
    """The right-hand side of the index-1 form.

    Parameters
    ----------
    evaluator : Evaluator
    rank : int
        Rank of B; below nc, λ is the one of least norm.

    Attributes
    ----------
    sizes : (nq,) array
        Changes of the coordinates that are considered equal in size; set by the first `measure`.
    lengths : (nc,) array
        Scales of the rows of B times sizes, used to determine its rank.
    """

    def __init__(self, evaluator: Evaluator, rank: int):
        system = evaluator.system
        self.evaluator, self.rank = evaluator, rank
        self.nq, self.nc = len(system.coordinates), len(system.constraints)
        self.redundant = rank < self.nc
        self.sizes = np.ones(self.nq)
        self.lengths = np.zeros(self.nc)

    def split(self, y: Array) -> tuple[Array, Array]:
        """Return q and v."""
        return y[: self.nq], y[self.nq : 2 * self.nq]

    def state(self, t: float, y: Array) -> State:
        """Return the state at y."""
        return self.evaluator.state(t, *self.split(y))

    def measure(self, t: float, q: Array, v: Array) -> None:
        """Record the largest length of each row of B times sizes."""
        c = self.evaluator.constraint_rows(t, q, v)
        if c.finite:
            if not self.lengths.any():
                self.sizes = self.evaluator.sizes(t, q, v)
            lengths = self.evaluator.row_lengths(t, q, v, c, self.sizes)
            self.lengths = np.maximum(self.lengths, lengths)

    def decompose(self, jacobian: Array) -> dense.Decomposition:
        """Decompose B with its rank, sizes and lengths."""
        return dense.decompose(jacobian, self.rank, scale=self.lengths, sizes=self.sizes)

    def rate(self, t: float, y: Array) -> Array:
        """Return y'; NaN if it is undefined."""
        q, v = self.split(y)
        a, _, power = self.accelerations(t, q, v)
        out = np.empty_like(y)
        out[: self.nq] = v
        out[self.nq : -1] = a
        out[-1] = power
        return out

    def accelerations(self, t: float, q: Array, v: Array) -> tuple[Array, Array, float]:
        """Return a, λ and the power at a state; NaN if they are undefined."""
        d = self.evaluator.dynamics(t, q, v)
        if d.finite:
            try:
                a, multipliers = self._solve(d, d.rhs)
                if self.evaluator.system.tangent is not None:
                    d = self.evaluator.with_tangent(d, t, q, v, a, multipliers)
                    a, multipliers = self._solve(d, d.rhs)
            except dense.SingularSystem:
                pass
            else:
                own = slice(len(self.evaluator.system.motion.constraints))
                power = float(d.power + multipliers[own] @ (d.jacobian[own] @ v))
                if math.isfinite(a.sum()) and math.isfinite(power):
                    return a, multipliers, power
        return np.full(self.nq, math.nan), np.full(self.nc, math.nan), math.nan

    def _solve(self, d: Dynamics, rhs: Array) -> tuple[Array, Array]:
        if not self.redundant:
            return dense.solve_regular(d.mass_matrix, d.forcing, d.jacobian, rhs)
        parts = self.decompose(d.jacobian)
        return dense.solve_redundant(d.mass_matrix, d.forcing, rhs, parts)

    def contradicting(self, t: float, q: Array, v: Array) -> int | None:
        """Return a redundant constraint that contradicts the others at a state on them, or None.

        B a = γ is solvable only if the combinations of rows that vanish in B also vanish in γ.
        """
        d = self.evaluator.dynamics(t, q, v)
        if not d.finite:
            return None
        parts = self.decompose(d.jacobian)
        scaled = d.rhs / parts.scale
        defect = parts.dependent @ (parts.dependent.T @ scaled)
        a, _, _ = self.accelerations(t, q, v)
        allowed = _CONTRADICTION * max(np.abs(scaled).max(), np.abs(a / self.sizes).max())
        worst = int(np.argmax(np.abs(defect)))
        return worst if abs(defect[worst]) > allowed else None
