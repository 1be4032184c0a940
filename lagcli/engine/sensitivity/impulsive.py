"""Derivatives of jumps of the velocities: impacts, impulses and plastic engagement.

While the modes of the rows do not change, a jump is linear,

    M (v⁺ − v⁻) − BᵀΛ = J,  B v⁺ + b₀ + c (B v⁻ + b₀) = 0 of rows that hold,
    Λ = w of open rows,  Λ = ∓ μ |Λ_N| of rows that slip,

and is differentiated by the implicit function theorem.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.evaluator import Constraints, Dynamics
from lagcli.engine.sensitivity.modal_tangent import solve


class ImpulsiveRow(NamedTuple):
    """The equation of one row in a jump.

    Parameters
    ----------
    row : int
        The constraint.
    normal : int or None
        For a slipping row, the constraint whose impulse limits it; otherwise None.
    holds : bool
    factor : float
        c of a row that holds; w of an open one; Λ/Λ_N of one that slips.
    change : (n,) array
        Derivatives of the factor.
    """

    row: int
    holds: bool
    factor: float
    change: Array
    normal: int | None = None


class Jump(NamedTuple):
    """v⁺ and Λ of all constraints, (nq,) and (nc,), and derivatives, (nq, n) and (nc, n)."""

    v: Array
    impulse: Array
    dv: Array
    dimpulse: Array


class JumpMatrices(NamedTuple):
    """M, B and b₀ at the instant, and their derivatives, whose last axis is that of directions."""

    dynamics: Dynamics
    constraints: Constraints
    ddynamics: Dynamics
    dconstraints: Constraints


def jump(
    at: JumpMatrices,
    v: Array,
    dv: Array,
    rows: Sequence[ImpulsiveRow],
    given: tuple[Array, Array] | None = None,
) -> Jump:
    """Return the velocities after a jump, the impulses, and their derivatives.

    Parameters
    ----------
    at : JumpMatrices
    v, dv : (nq,) and (nq, n) arrays
        The velocities before.
    rows : sequence of ImpulsiveRow
        Rows with an equation; the others have no impulse.
    given : ((nq,) and (nq, n) arrays), optional
        Generalized impulses J.
    """
    mass, jacobian = at.dynamics.mass_matrix, at.dynamics.jacobian
    dmass, djacobian = at.ddynamics.mass_matrix, at.ddynamics.jacobian
    drift, ddrift = at.constraints.drift, at.dconstraints.drift
    nq, n, m = len(v), dv.shape[1], len(rows)
    numbers = [x.row for x in rows]
    place = {row: nq + k for k, row in enumerate(numbers)}
    forces, dforces = given if given is not None else (np.zeros(nq), np.zeros((nq, n)))
    matrix, right = np.zeros((nq + m, nq + m)), np.zeros(nq + m)
    matrix[:nq, :nq], matrix[:nq, nq:] = mass, -jacobian[numbers].T
    right[:nq] = mass @ v + forces
    before = jacobian @ v + drift
    for k, x in enumerate(rows, start=nq):
        if x.holds:
            matrix[k, :nq] = jacobian[x.row]
            right[k] = -drift[x.row] - x.factor * before[x.row]
            continue
        matrix[k, k] = 1.0
        if x.normal is None:
            right[k] = x.factor
        else:
            matrix[k, place[x.normal]] = -x.factor
    found = solve(matrix, right[:, None], redundant=False)[:, 0]
    after, impulse = found[:nq], found[nq:]
    changes = np.zeros((nq + m, n))
    changes[:nq] = mass @ dv + dforces - np.einsum("ijn,j->in", dmass, after - v)
    changes[:nq] += np.einsum("ijn,i->jn", djacobian[numbers], impulse)
    dbefore = np.einsum("ijn,j->in", djacobian, v) + jacobian @ dv + ddrift
    dafter = np.einsum("ijn,j->in", djacobian, after) + ddrift
    for k, x in enumerate(rows, start=nq):
        if x.holds:
            changes[k] = -dafter[x.row] - x.factor * dbefore[x.row] - x.change * before[x.row]
        else:
            changes[k] = x.change * (1.0 if x.normal is None else found[place[x.normal]])
    slopes = solve(matrix, changes, redundant=False)
    whole, dwhole = np.zeros(len(drift)), np.zeros((len(drift), n))
    whole[numbers], dwhole[numbers] = impulse, slopes[nq:]
    return Jump(after, whole, slopes[:nq], dwhole)
