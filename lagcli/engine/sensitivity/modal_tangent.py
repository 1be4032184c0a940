"""Derivatives of accelerations and multipliers in a mode.

With G = f − M a + Bᵀλ and Γ = γ − B a at fixed a and λ,

    M δa − Bᵀδλ − δF = δG,  B δa = δΓ of rows that hold,
    δλ = ∓ δ(limit) of rows that slip,  δλ = 0 of open rows,

where the forces F that depend on λ, and the limits, also change with λ.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.sensitivity.changes import PerturbedState

#: Singular values below this part of the largest count as zero, as for redundant rows.
_REDUNDANT = 1e-11


class MotionChange(NamedTuple):
    """a and λ at a state, (nq,) and (nc,), and their derivatives, (nq, n) and (nc, n)."""

    a: Array
    multipliers: Array
    da: Array
    dmultipliers: Array


class SlidingChange(NamedTuple):
    """The motion on a surface at which forces jump, and its derivatives.

    Parameters
    ----------
    motion : MotionChange
        The combined motion.
    dweight : (n,) array
        Derivatives of the weight of the upper side.
    jump : (nq,) array
        Acceleration of the upper side minus that of the lower side.
    rate : float
        Difference of the rates of the surface function on both sides.
    """

    motion: MotionChange
    dweight: Array
    jump: Array
    rate: float


def sliding_change(at: PerturbedState) -> SlidingChange:
    """Return the derivatives of a motion that slides along a surface, by Filippov's rule.

    The weight x of the upper side follows from ġ₀ + x (ġ₁ − ġ₀) = 0; so do its derivatives.
    """
    branches, change = at.motion.branches, at.change
    assert branches is not None
    assert branches.slides is not None
    k, n = branches.slides, change.directions
    sides, rates, slopes = list[MotionChange](), list[float](), list[Array]()
    for upper in (True, False):
        branches.take_side(k, upper)
        found = _on_branches(at)
        nothing = np.zeros(len(change.p))
        flow = np.concatenate([[1.0], at.v, found.a, nothing])
        of_flow = np.concatenate([np.zeros((1, n)), change.v, found.da, np.zeros_like(change.p)])
        rate, slope = at.system.rates_of_kinks(at.inputs, flow, change.inputs(), of_flow)
        sides.append(found)
        rates.append(float(rate[k]))
        slopes.append(slope[k])
    above, below = sides
    difference = rates[0] - rates[1]
    with np.errstate(all="ignore"):
        x = float(np.float64(-rates[1]) / difference)
        dx = -(slopes[1] + x * (slopes[0] - slopes[1])) / difference
    jump, force = above.a - below.a, above.multipliers - below.multipliers
    combined = MotionChange(
        below.a + x * jump,
        below.multipliers + x * force,
        below.da + x * (above.da - below.da) + np.outer(jump, dx),
        below.dmultipliers + x * (above.dmultipliers - below.dmultipliers) + np.outer(force, dx),
    )
    return SlidingChange(combined, dx, jump, difference)


def motion_change(at: PerturbedState) -> MotionChange:
    """Return the derivatives of accelerations and multipliers along directions.

    For redundant rows, δλ is the solution of least norm.
    """
    branches = at.motion.branches
    if branches is not None and branches.slides is not None:
        return sliding_change(at).motion
    return _on_branches(at)


def _on_branches(at: PerturbedState) -> MotionChange:
    """Return the same on the current branches, regardless of a sliding surface."""
    system, motion, t, q, v, change = at
    a, multipliers, _ = motion.on_branches(t, q, v)
    d, changed = motion.full.dynamics(t, q, v), at.dynamics()
    nq, nc, n = len(q), len(multipliers), change.directions
    force = changed.forcing - np.einsum("ijn,j->in", changed.mass_matrix, a)
    force += np.einsum("ijn,i->jn", changed.jacobian, multipliers)
    rhs = (changed.rhs - np.einsum("ijn,j->in", changed.jacobian, a))[motion.rows]
    rows, slipping = motion.rows, motion.slipping
    nh, ns = len(rows), len(slipping)
    coordinates = list(system.switching.force_coordinates)
    nf = len(coordinates)
    # unknowns: δa, δλ of rows that hold, of rows that slip, δF
    size = nq + nh + ns + nf
    matrix, right = np.zeros((size, size)), np.zeros((size, n))
    matrix[:nq, :nq] = d.mass_matrix
    matrix[:nq, nq : nq + nh] = -d.jacobian[rows].T
    matrix[nq : nq + nh, :nq] = d.jacobian[rows]
    right[:nq], right[nq : nq + nh] = force, rhs
    acting = np.concatenate([rows, slipping])
    if ns + nf:
        inputs = motion.inputs(t, q, v, a, multipliers)
        explicit = change.inputs([np.zeros((nq + nc, n))])
        slips, first = slice(nq + nh, nq + nh + ns), nq + nh + ns
        matrix[:nq, slips] = -d.jacobian[slipping].T
        matrix[coordinates, first + np.arange(nf)] = -1.0
        matrix[nq + nh :, nq + nh :] = np.eye(ns + nf)
        if ns:
            against, limits = motion.against[:, None], motion.tapes.limits(inputs)
            slopes = against * limits.kinetic_slopes[motion.limit_of]
            matrix[slips, nq : nq + nh + ns] -= slopes[:, acting]
            kinetic = motion.tapes.limited + motion.limit_of
            right[slips] = against * system.along("limits", inputs, explicit)[kinetic]
        if nf:
            slopes = motion.tapes.forces(inputs).slopes
            matrix[first:, nq : nq + nh + ns] -= slopes[:, acting]
            right[first:] = system.along("forces", inputs, explicit)[:nf]
    found = solve(matrix, right, motion.redundant)
    dmultipliers = np.zeros((nc, n))
    dmultipliers[acting] = found[nq : nq + nh + ns]
    return MotionChange(a, multipliers, found[:nq], dmultipliers)


def solve(matrix: Array, right: Array, redundant: bool) -> Array:
    """Return the solution of a linear system, of least norm for redundant rows.

    A column of the solution contains NaN if and only if the right side does.
    """
    size = np.sqrt(np.abs(np.diag(matrix)))
    scale = np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 1.0)
    scaled = scale[:, None] * matrix * scale
    lengths = np.abs(scaled).max(axis=1, initial=0.0)
    rows = np.where(lengths > 0, 1 / np.where(lengths > 0, lengths, 1.0), 1.0)
    scaled, values = rows[:, None] * scaled, (rows * scale)[:, None] * right
    if not redundant:
        try:
            return scale[:, None] * np.linalg.solve(scaled, values)
        except np.linalg.LinAlgError:
            pass
    return np.asarray(scale[:, None] * (np.linalg.pinv(scaled, rcond=_REDUNDANT) @ values))
