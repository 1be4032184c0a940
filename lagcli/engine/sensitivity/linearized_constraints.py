"""Changes of a state that satisfy the linearized constraints.

    φ_q δq + φ_θ = 0,  B δv + ψ_q δq + ψ_θ = 0 with ψ = B v + b₀,

by the smallest correction in the metric of M.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.sensitivity.changes import Change, PerturbedState
from lagcli.engine.sensitivity.modal_tangent import solve


def positions_on(at: PerturbedState, held: Sequence[int]) -> Change:
    """Return the nearest change of positions that satisfies the linearized constraints ``held``."""
    holonomic = at.system.system.holonomic
    places = [k for k, row in enumerate(holonomic) if row in set(held)]
    if not places:
        return at.change
    residual = at.constraints().position[places]
    correction = _least(at, [holonomic[k] for k in places], residual)
    return at.change._replace(q=at.change.q + correction)


def velocities_on(at: PerturbedState, held: Sequence[int]) -> Change:
    """Return the nearest change of velocities that satisfies the linearized constraints
    ``held``."""
    if not held:
        return at.change
    residual = velocity_changes(at)[list(held)]
    return at.change._replace(v=at.change.v + _least(at, held, residual))


def velocity_changes(at: PerturbedState) -> Array:
    """Return derivatives of ψ = B v + b₀, (nc, n)."""
    c = at.constraints()
    jacobian = at.motion.full.constraints(at.t, at.q, at.v).jacobian
    found = np.einsum("ijn,j->in", c.jacobian, at.v) + jacobian @ at.change.v + c.drift
    return np.asarray(found)


def _least(at: PerturbedState, rows: Sequence[int], residual: Array) -> Array:
    """Return the smallest δ in the metric of M with B δ = −residual."""
    d, nq, m = at.motion.full.dynamics(at.t, at.q, at.v), len(at.q), len(rows)
    jacobian = d.jacobian[list(rows)]
    matrix, right = np.zeros((nq + m, nq + m)), np.zeros((nq + m, residual.shape[1]))
    matrix[:nq, :nq], matrix[:nq, nq:], matrix[nq:, :nq] = d.mass_matrix, -jacobian.T, jacobian
    right[nq:] = -residual
    return solve(matrix, right, at.motion.redundant)[:nq]
