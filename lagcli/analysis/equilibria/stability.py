"""Stability of equilibria and steady motions in the linear approximation."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lagcli.analysis.linear.linear_model import linear_model
from lagcli.analysis.linear.modes import (
    ReducedMatrices,
    asymmetric_eigenpairs,
    reduced_matrices,
    symmetric_eigenpairs,
)
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.operating_point import OperatingPoint
from lagcli.arrays import Array

ComplexArray = NDArray[np.complex128]
Verdict = Literal["asymptotically stable", "stable", "linearly stable", "unstable", "undecided"]

#: Real parts below this part of the largest eigenvalue, or of the rate √(force/(mass·length)), are
#: rounding errors.
_GROWING = 1e-9
#: Relative damping, and stiffness, that count as rounding errors.
_SYMMETRIC, _ZERO = 1e-10, 1e-11
#: Eigenvalues below this part of the rate √(force/(mass·length)) are rounding errors: those of the
#: stiffness are about ε force/length, and an eigenvalue is its square root.
_SLOW = 1e-7
#: Largest eigenvalue of a motion along a set of equilibria, relative to the same: it is a zero.
_NEUTRAL = 1e-5
#: Rounding errors of a coordinate at an equilibrium, relative to it.
_ROUNDED = 32 * np.finfo(float).eps
#: Eigenvalues closer than this, relative to the largest, may be a multiple one; the least singular
#: value of their states, of length 1, where these are linearly dependent: rounding separates a
#: defective pair by √ε.
_COINCIDENT, _DEPENDENT = 1e-6, 1e-6


class Stability(NamedTuple):
    """Stability of an equilibrium or a steady motion in the linear approximation.

    Parameters
    ----------
    verdict : str
        ``asymptotically stable``; ``stable`` by the Hessian; ``linearly stable`` if no deviation
        grows in the linear approximation, but some do not decay and the Hessian proves nothing;
        ``unstable``; ``undecided`` if a deviation is neutral, so that higher-order terms decide.
    eigenvalues : (n,) complex array
        Eigenvalues of ẋ = A x, one of each complex pair, by increasing magnitude, 1/s.
    stiffness : (m,) array or None
        Eigenvalues of the reduced Hessian Zᵀ (∂²V − Σ λ ∂²φ) Z, with centrifugal terms in steady
        motion, relative to Zᵀ M Z, 1/s², increasing. None if it is not symmetric (forces without a
        potential), with nonholonomic constraints, or if damping forces supply energy.
    rounding : float
        Real parts of eigenvalues below it are rounding errors, 1/s.
    """

    verdict: Verdict
    eigenvalues: ComplexArray
    stiffness: Array | None
    rounding: float = 0.0


#: Where a contact changes its mode with the smallest deviation, and at singular configurations.
NO_LINEAR_MODEL = Stability("undecided", np.empty(0, complex), None)


def stability_of(
    local: LocalEquations,
    operating_point: OperatingPoint,
    dimension: int,
    flat: Array | None = None,
) -> Stability:
    """Determine stability from the reduced Hessian and the eigenvalues of the linear model.

    A positive definite Hessian proves stability (Lagrange, Dirichlet), also with damping (Kelvin,
    Tait, Chetaev). Neutral motion along a set of equilibria is not instability. With contacts it
    is the stability of motions on which these stay as they are.

    Parameters
    ----------
    local : LocalEquations
    operating_point : OperatingPoint
        An equilibrium or a steady motion.
    dimension : int
        Dimension of the set of equilibria.
    flat : (nq,) array, optional
        How far the point may be off a degenerate equilibrium.

    References
    ----------
    .. [1] D. R. Merkin, "Introduction to the Theory of Stability", 1997, ch. 3, 6,
       doi:10.1007/978-1-4612-4046-4.
    """
    given = operating_point.tangent
    if local.dependent_only_here(operating_point.point, given):
        return NO_LINEAR_MODEL
    dimension = max(dimension, operating_point.neutral)
    reached = local.reached(operating_point.point, given)
    operating_point = replace(operating_point, tangent=reached)
    dimension -= len(given.positions) - len(reached.positions)
    changed = _rounding_of_stiffness(local, operating_point, flat)
    reduced = _without_asymmetry(reduced_matrices(local, operating_point), changed)
    stiffness = hessian_eigenvalues(reduced)
    symmetric = symmetric_eigenpairs(reduced)
    pairs, states = symmetric or asymmetric_eigenpairs(
        linear_model(local.model, local, operating_point)
    )
    order = np.argsort(np.abs(pairs), kind="stable")
    values, states = pairs[order], states[:, order]
    rate = _rate(local, operating_point)
    slow = max(_SLOW * rate, math.sqrt(changed))
    values[np.abs(values) <= slow] = 0.0
    largest = max(rate, np.abs(values).max(initial=0.0))
    for k in range(min(dimension, len(values))):
        if 0.0 < np.abs(values[k]) <= _NEUTRAL * largest:
            opposite = np.abs(values + values[k]) <= _NEUTRAL * np.abs(values[k])
            values[opposite] = values[k] = 0.0
    rounding = _GROWING * largest
    stability = Stability("undecided", values, stiffness, rounding)
    return stability._replace(verdict=_verdict(stability, states, slow**2, dimension))


def _rounding_of_stiffness(
    local: LocalEquations, operating_point: OperatingPoint, flat: Array | None
) -> float:
    """Return how much rounding errors of the coordinates change the stiffness, 1/s².

    Forces that cancel have a stiffness whose rounding errors their sizes do not show.
    """
    point = operating_point.point
    moves = [point.q * _ROUNDED * np.where(np.arange(len(point.q)) % 2, -1.0, 1.0)]
    if flat is not None and flat.any():
        moves += [flat, -flat]
    before = local.jacobians(point).force_position
    change = np.zeros_like(before)
    for move in moves:
        there = point._replace(q=point.q + move)
        change = np.fmax(change, np.abs(local.jacobian_tape.at(there).force_position - before))
    mass = local.evaluator(point.p).dynamics(point.t, point.q, point.v).mass_matrix
    basis = np.abs(operating_point.tangent.velocity_basis)
    inertia = np.sqrt(np.diag(basis.T @ np.abs(mass) @ basis))
    moving = inertia > 0.0
    by_place = (basis.T @ change @ basis)[np.ix_(moving, moving)]
    largest = (by_place / np.outer(inertia[moving], inertia[moving])).max(initial=0.0)
    return float(largest) if np.isfinite(largest) else 0.0


def _without_asymmetry(reduced: ReducedMatrices | None, changed: float) -> ReducedMatrices | None:
    """Return M, D and K without an asymmetry of K that is a rounding error, at most `changed`."""
    if reduced is None or reduced.symmetric:
        return reduced
    inertia = np.sqrt(np.abs(np.diag(reduced.mass)))
    asymmetry = np.abs(reduced.stiffness - reduced.stiffness.T)
    if not (asymmetry <= changed * np.outer(inertia, inertia)).all():
        return reduced
    return reduced._replace(stiffness=(reduced.stiffness + reduced.stiffness.T) / 2)


def _rate(local: LocalEquations, operating_point: OperatingPoint) -> float:
    """Return √(force/(mass·length)) of the largest forces and lengths, or the rate of turn, 1/s."""
    point = operating_point.point
    mass = local.evaluator(point.p).dynamics(point.t, point.q, point.v).mass_matrix
    inertia = (np.abs(np.diag(mass)) * local.lengths**2).max(initial=0.0)
    turning = 0.0
    if operating_point.frame is not None:
        turning = float(np.abs(np.linalg.eigvals(operating_point.frame)).max(initial=0.0))
    energy = (local.force_scale(point) * local.lengths).max(initial=0.0)
    return max(float(np.sqrt(energy / inertia)) if inertia > 0.0 else 0.0, turning)


def _verdict(stability: Stability, states: ComplexArray, least: float, dimension: int) -> Verdict:
    """Return the verdict; `least` is the stiffness that is a rounding error, 1/s²."""
    _, values, stiffness, rounding = stability
    if not len(values):
        return "stable"  # the constraints determine the motion
    # a real eigenvalue that is not zero has a sign, small as it is beside those of strong damping
    real = values.imag == 0.0
    if (values.real > np.where(real, 0.0, rounding)).any():
        return "unstable"
    moving = values != 0.0
    neutral = len(values) - int(moving.sum())
    decays = values.real < np.where(real, 0.0, -rounding)
    if decays[moving].all() and neutral <= 2 * dimension:
        return "asymptotically stable" if moving.any() else "undecided"
    if stiffness is not None:
        zero = max(_ZERO * np.abs(stiffness).max(initial=0.0), least)
        definite = not (stiffness < -zero).any()
        if definite and (np.abs(stiffness) <= zero).sum() <= dimension < len(stiffness):
            return "stable"
    imaginary = moving & ~decays
    if neutral > 2 * dimension or _defective(values[imaginary], states[:, imaginary]):
        return "undecided"
    return "linearly stable"  # stabilized by gyroscopic forces, or by damping of some motions


def _defective(values: ComplexArray, states: ComplexArray) -> bool:
    """Whether an eigenvalue has fewer states than its multiplicity."""
    for s in values:
        same = np.abs(values - s) <= _COINCIDENT * np.abs(values).max()
        if same.sum() > 1:
            chosen = states[:, same] / np.linalg.norm(states, axis=0)[same]
            if np.linalg.svd(chosen, compute_uv=False).min() < _DEPENDENT:
                return True
    return False


def hessian_eigenvalues(reduced: ReducedMatrices | None) -> Array | None:
    """Return the eigenvalues of K relative to M; see `Stability`."""
    from scipy.linalg import LinAlgError, eigh

    if reduced is None or not reduced.symmetric:
        return None
    damping = (reduced.damping + reduced.damping.T) / 2
    allowed = _SYMMETRIC * np.abs(reduced.damping_scale).max(initial=0.0)
    if len(damping) and np.linalg.eigvalsh(damping).min() < -allowed:
        return None  # forces supply energy
    stiffness = (reduced.stiffness + reduced.stiffness.T) / 2
    try:
        return np.asarray(eigh(stiffness, reduced.mass, eigvals_only=True))
    except LinAlgError:  # inertia is not positive
        return None
