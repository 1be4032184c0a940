"""Stability of equilibria and steady motions in the linear approximation."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lagcli.analysis.linear.linear_model import linear_model
from lagcli.analysis.linear.modes import ReducedMatrices, eigenpairs, reduced_matrices
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.operating_point import OperatingPoint
from lagcli.arrays import Array

ComplexArray = NDArray[np.complex128]
Verdict = Literal["asymptotically stable", "stable", "unstable", "undecided"]

#: Real parts below this, relative to the largest eigenvalue, are rounding errors.
_GROWING = 1e-9
#: Relative damping, and stiffness, that count as rounding errors.
_SYMMETRIC, _ZERO = 1e-10, 1e-11


class Stability(NamedTuple):
    """Stability of an equilibrium or a steady motion in the linear approximation.

    Parameters
    ----------
    verdict : str
        ``asymptotically stable``, ``stable``, ``unstable``, or ``undecided`` if higher-order
        terms decide.
    eigenvalues : (n,) complex array
        Eigenvalues of ẋ = A x, one of each complex pair, by increasing magnitude, 1/s.
    stiffness : (m,) array or None
        Eigenvalues of the reduced Hessian Zᵀ (∂²V − Σ λ ∂²φ) Z, with centrifugal terms in steady
        motion, relative to Zᵀ M Z, 1/s², increasing. None if it is not symmetric (forces without a
        potential), with nonholonomic constraints, or if damping forces supply energy.
    """

    verdict: Verdict
    eigenvalues: ComplexArray
    stiffness: Array | None


#: Where a contact changes its mode with the smallest deviation.
NO_LINEAR_MODEL = Stability("undecided", np.empty(0, complex), None)


def stability_of(
    local: LocalEquations, operating_point: OperatingPoint, dimension: int
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

    References
    ----------
    .. [1] D. R. Merkin, "Introduction to the Theory of Stability", 1997, ch. 3, 6,
       doi:10.1007/978-1-4612-4046-4.
    """
    given = operating_point.tangent
    reached = local.reached(operating_point.point, given)
    operating_point = replace(operating_point, tangent=reached)
    dimension -= len(given.positions) - len(reached.positions)
    stiffness = hessian_eigenvalues(reduced_matrices(local, operating_point))
    found, _, _ = eigenpairs(local, linear_model(local, operating_point))
    values = found[np.argsort(np.abs(found), kind="stable")]
    return Stability(_verdict(values, stiffness, dimension), values, stiffness)


def _verdict(values: ComplexArray, stiffness: Array | None, dimension: int) -> Verdict:
    if not len(values):
        return "stable"  # the constraints determine the motion
    largest = np.abs(values).max()
    if (values.real > _GROWING * largest).any():
        return "unstable"
    moving = values[values != 0.0]
    if (moving.real < -_GROWING * largest).all() and len(values) - len(moving) <= 2 * dimension:
        return "asymptotically stable" if len(moving) else "undecided"
    if stiffness is not None:
        zero = _ZERO * np.abs(stiffness).max(initial=0.0)
        if (stiffness < -zero).any():
            return "undecided"  # stabilized by gyroscopic forces, or by damping of some motions
        if (np.abs(stiffness) <= zero).sum() <= dimension < len(stiffness):
            return "stable"
    return "undecided"


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
