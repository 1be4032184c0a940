"""A System restricted to the active rows of a mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.evaluator import Constraints, Dynamics, Evaluator


class HeldEvaluator(Evaluator):
    """Evaluates a System with only some of its constraints.

    Parameters
    ----------
    full : Evaluator
        Evaluator of the System with all its constraints.
    rows : sequence of int
        The active constraints, increasing.

    Attributes
    ----------
    positions : list of int
        Their indices among the holonomic constraints.
    """

    def __init__(self, full: Evaluator, rows: Sequence[int]):
        system = full.system
        self.full, self.p, self.rows = full, full.p, np.array(rows, dtype=np.intp)
        place = {row: k for k, row in enumerate(rows)}
        self.positions = [k for k, row in enumerate(system.holonomic) if row in place]
        self._holonomic = [place[system.holonomic[k]] for k in self.positions]
        self.system = replace(
            system,
            constraints=tuple(system.constraints[row] for row in rows),
            holonomic=tuple(self._holonomic),
            jacobian_pattern=tuple((place[i], j) for i, j in system.jacobian_pattern if i in place),
            nonlinear=tuple(place[i] for i in system.nonlinear if i in place),
            switching=None,
        )

    def hold(self, t: float) -> None:
        """Fix the pieces of the known functions of time to those from a time on."""
        self.full.hold(t)

    def dynamics(self, t: float, q: Array, v: Array) -> Dynamics:
        """Return M, f, B, γ and the external power."""
        return self.of(self.full.dynamics(t, q, v))

    def of(self, d: Dynamics) -> Dynamics:
        """Return the dynamics without the inactive rows."""
        return d._replace(jacobian=d.jacobian[self.rows], rhs=d.rhs[self.rows])

    def constraints(self, t: float, q: Array, v: Array) -> Constraints:
        """Return φ, B, b_0 and scales."""
        c = self.full.constraints(t, q, v)
        return Constraints(
            c.position[self.positions],
            c.jacobian[self.rows],
            c.drift[self.rows],
            c.position_scale[self.positions],
            c.velocity_scale[self.rows],
        )
