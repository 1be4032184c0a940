"""Modes: eigenvalues and shapes of a linear model, with the multipliers of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lagcli.analysis.linear.linear_model import LinearModel, linear_model
from lagcli.analysis.linear.operating_points import find_operating_point
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.operating_point import OperatingPoint, least
from lagcli.analysis.local.steady_terms import Given
from lagcli.arrays import Array
from lagcli.model.model import Model, check_is_model

ComplexArray = NDArray[np.complex128]
Kind = Literal["neutral", "oscillation", "growing oscillation", "decay", "divergence"]

#: Real parts below this part of an eigenvalue's magnitude are rounding errors.
_UNDAMPED = 1e-9
#: Eigenvalues below this part of the rate √(stiffness/mass) count as zero: rounding perturbs a
#: defective pair by √ε.
_ZERO = 1e-7
#: Rounding errors of a matrix, relative to its largest entry; part of the largest eigenvalue below
#: which others lose too many digits by them.
_LOST, _SLOW = 1e-13, 1e-3
#: Asymmetry, damping and components of shapes below this part of the terms count as rounding
#: errors.
_ROUNDING = 1e-11


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode: a real eigenvalue s, or a pair s, s*.

    The motion is Re(shape e^(s t)).

    Parameters
    ----------
    kind : str
        ``neutral`` (s = 0), ``oscillation``, ``growing oscillation`` (flutter), ``decay``,
        ``divergence``.
    eigenvalue : complex
        s, 1/s; its imaginary part is not negative.
    position : (nq,) complex array
        δq, scaled to 1 for the coordinate with the largest M_jj |δq_j|².
    velocity : (nq,) complex array
        δv.
    multipliers : (nc,) complex array
        δλ, in the same scale.
    """

    kind: Kind
    eigenvalue: complex
    position: ComplexArray
    velocity: ComplexArray
    multipliers: ComplexArray

    @property
    def frequency(self) -> float:
        """Frequency of the oscillation, Im s/2π, Hz."""
        return self.eigenvalue.imag / (2 * np.pi)

    @property
    def natural_frequency(self) -> float:
        """|s|, rad/s."""
        return abs(self.eigenvalue)

    @property
    def damping_ratio(self) -> float | None:
        """−Re s/|s|; None for a neutral mode."""
        size = abs(self.eigenvalue)
        return (0.0 - self.eigenvalue.real) / size if size else None

    @property
    def period(self) -> float | None:
        """2π/Im s, s; None without oscillation."""
        return 2 * np.pi / self.eigenvalue.imag if self.eigenvalue.imag else None

    @property
    def time_constant(self) -> float | None:
        """1/|Re s|, s; None if the amplitude is constant."""
        return 1 / abs(self.eigenvalue.real) if self.eigenvalue.real else None


@dataclass(frozen=True, eq=False)
class ModalAnalysis:
    """The modes of a model about an operating point.

    Parameters
    ----------
    linear_model : LinearModel
        Linear model in the reduced form.
    modes : tuple of Mode
        Modes, ordered by the magnitude of the eigenvalue.
    undamped : bool
        Whether the eigenvalues are those of a symmetric problem K x = ω² M x.
    """

    linear_model: LinearModel
    modes: tuple[Mode, ...]
    undamped: bool

    @property
    def operating_point(self) -> OperatingPoint:
        """The point about which the motion is small."""
        return self.linear_model.operating_point


def modes(
    model: Model,
    *,
    at: float | None = None,
    equilibrium: bool = False,
    steady: Given | None = None,
) -> ModalAnalysis:
    """Return the modes of small motions about an operating point.

    Eigenvalues s of ẋ = A x on the constraint manifold, with the shapes δq of all coordinates and
    the multipliers δλ of each mode. Without damping and gyroscopic terms, they are computed from
    the symmetric problem K x = ω² M x in independent coordinates, so that frequencies are accurate.

    Parameters
    ----------
    model, at, equilibrium, steady
        As for `linearize`, which also lists the errors.

    Returns
    -------
    ModalAnalysis

    References
    ----------
    .. [1] L. Meirovitch, "Principles and Techniques of Vibrations", 1997, ch. 4.
    """
    check_is_model(model, "modes")
    located = find_operating_point(model, at=at, equilibrium=equilibrium, steady=steady)
    return modes_about(model, located.local, located.operating_point)


def modes_about(
    model: Model, local: LocalEquations, operating_point: OperatingPoint
) -> ModalAnalysis:
    """Return the modes about a known operating point; see `modes`."""
    linear = linear_model(model, local, operating_point)
    point = operating_point.point
    mass = local.evaluator(point.p).dynamics(point.t, point.q, point.v).mass_matrix
    weights = np.sqrt(local.system.inertia(np.abs(np.diag(mass))))
    values, vectors, undamped = eigenpairs(local, linear)
    order = sorted(range(len(values)), key=lambda i: _order(complex(values[i])))
    shapes = tuple(_mode(linear, complex(values[i]), vectors[:, i], weights) for i in order)
    return ModalAnalysis(linear, shapes, undamped)


def _order(s: complex) -> tuple[float, float]:
    # of equal magnitudes the growing one first, regardless of the last bits
    return (float(f"{abs(s):.9e}"), -s.real)


def symmetric_eigenpairs(
    reduced: ReducedMatrices | None,
) -> tuple[ComplexArray, ComplexArray] | None:
    """Return eigenvalues and states if K is symmetric and D vanishes; None otherwise.

    Each oscillation and each neutral mode is returned once, a pair ±κ as two modes.
    """
    from scipy.linalg import LinAlgError, eigh

    if reduced is None or not reduced.symmetric or not reduced.undamped:
        return None
    inertia, _, stiffness, _ = reduced
    n = len(inertia)
    if not n:
        return np.empty(0, complex), np.empty((0, 0), complex)
    try:
        squares, shapes = eigh((stiffness + stiffness.T) / 2, (inertia + inertia.T) / 2)
    except LinAlgError:  # inertia is not positive
        return None
    zero = 10 * n * np.finfo(float).eps * np.abs(squares).max(initial=0.0)
    values: list[complex] = []
    states = []
    for square, shape in zip(squares.tolist(), shapes.T, strict=True):
        root = np.sqrt(abs(square)) if abs(square) > zero else 0.0
        for s in (complex(0, root),) if square > zero or not root else (root, -root):
            values.append(complex(s))
            states.append(np.concatenate([shape, s * shape]))
    return np.array(values), np.array(states, dtype=complex).reshape(-1, 2 * n).T


class ReducedMatrices(NamedTuple):
    """M, D and K of M ẍ + D ẋ + K x = 0 in independent coordinates, (n, n) each.

    At rest, K is the reduced Hessian Zᵀ (∂²V/∂q² − Σ λ_β ∂²φ_β/∂q²) Z minus that of Q.

    Parameters
    ----------
    mass, damping, stiffness : (n, n) arrays
    damping_scale : (n, n) array
        Sums of the magnitudes of the terms of D.
    """

    mass: Array
    damping: Array
    stiffness: Array
    damping_scale: Array

    @property
    def symmetric(self) -> bool:
        """Whether K is symmetric except for rounding errors."""
        size = np.abs(self.stiffness).max(initial=0.0)
        difference = np.abs(self.stiffness - self.stiffness.T).max(initial=0.0)
        return bool(difference <= _ROUNDING * size)

    @property
    def undamped(self) -> bool:
        """Whether D vanishes except for rounding errors."""
        return not (np.abs(self.damping) > _ROUNDING * self.damping_scale).any()


def reduced_matrices(
    local: LocalEquations, operating_point: OperatingPoint
) -> ReducedMatrices | None:
    """Return M, D and K in independent coordinates.

    None if independent coordinates and velocities differ, as with nonholonomic constraints, and if
    forces depend on multipliers.
    """
    point, tangent = operating_point.point, operating_point.tangent
    if tangent.positions != tangent.velocities or local.reactive is not None:
        return None
    basis, shift = tangent.velocity_basis, tangent.velocity_by_position
    jac, d = local.jacobians(point), tangent.decomposition
    mass = local.evaluator(point.p).dynamics(point.t, point.q, point.v).mass_matrix

    def force(dq: Array, dv: Array) -> Array:
        demanded = least(d, jac.rhs_position @ dq + jac.rhs_velocity @ dv)
        demanded -= basis @ demanded[list(tangent.velocities)]
        forces = jac.force_position @ dq + jac.force_velocity @ dv - mass @ demanded
        return np.asarray(basis.T @ forces)

    still = np.zeros_like(basis)
    if operating_point.frame is not None:
        # δq = Z x, δv = F Z x + Z ẋ, δa = F² Z x + 2 F Z ẋ + Z ẍ, which satisfy the constraints
        frame = operating_point.frame
        turned = frame @ basis
        by_rate = jac.force_velocity @ basis - 2 * mass @ turned
        by_place = jac.force_position @ basis + jac.force_velocity @ turned
        by_place -= mass @ frame @ turned
        scale = np.abs(jac.force_velocity) @ np.abs(basis) + 2 * np.abs(mass) @ np.abs(turned)
        return ReducedMatrices(
            basis.T @ mass @ basis,
            -basis.T @ by_rate,
            -basis.T @ by_place,
            np.abs(basis).T @ scale,
        )
    terms = np.abs(basis).T @ np.abs(jac.force_velocity) @ np.abs(basis)
    inertial = np.abs(least(d, np.abs(jac.rhs_velocity) @ np.abs(basis)))
    terms += np.abs(basis).T @ np.abs(mass) @ inertial
    return ReducedMatrices(
        basis.T @ mass @ basis,
        -force(still, basis),
        -force(tangent.position_basis, shift),
        terms,
    )


def eigenpairs(
    local: LocalEquations, linear: LinearModel
) -> tuple[ComplexArray, ComplexArray, bool]:
    """Return the eigenvalues and states of a reduced model, and whether it is undamped.

    Of complex pairs, only the eigenvalues with positive imaginary part.
    """
    pairs = symmetric_eigenpairs(reduced_matrices(local, linear.operating_point))
    if pairs is not None:
        return *pairs, True
    return *asymmetric_eigenpairs(linear), False


def asymmetric_eigenpairs(linear: LinearModel) -> tuple[ComplexArray, ComplexArray]:
    """Return the eigenvalues and states of a reduced model by its matrix A."""
    operating_point = linear.operating_point
    tangent = operating_point.tangent
    n, sizes = len(tangent.positions), tangent.decomposition.sizes
    places, velocities = sizes[list(tangent.positions)], sizes[list(tangent.velocities)]
    stiffness = linear.A[n:, :n]
    rate = np.sqrt(np.abs(stiffness).max(initial=0.0)) or 1.0
    scale = np.concatenate([places, rate * velocities])
    natural = np.abs(stiffness * places / velocities[:, None]).max(initial=0.0)
    values, states = general_eigenpairs(linear.A, scale, float(np.sqrt(natural)))
    if operating_point.frame is not None:
        # terms of the square of the frame's rate cancel
        values[np.abs(values) < _ZERO * np.abs(np.linalg.eigvals(operating_point.frame)).max()] = (
            0.0
        )
    return values, states


def general_eigenpairs(
    matrix: Array, sizes: Array, rate: float
) -> tuple[ComplexArray, ComplexArray]:
    """Return eigenvalues and right eigenvectors; complex pairs once.

    Entries that are rounding errors relative to the others are set to zero, so that coordinates on
    which nothing depends give eigenvalues that are exactly zero.

    Parameters
    ----------
    matrix : (n, n) array
    sizes : (n,) array
        Values of the states that are considered equal in size.
    rate : float
        √(stiffness/mass): where damping is strong, far below the largest eigenvalue and far above
        the slowest.
    """
    from scipy.linalg import eig

    if not len(matrix):
        return np.empty(0, complex), np.empty((0, 0), complex)
    scaled = matrix * sizes / sizes[:, None]
    rounding = len(matrix) * np.finfo(float).eps * np.abs(scaled).max()
    scaled = np.where(np.abs(scaled) > rounding, scaled, 0.0)
    values, left, vectors = eig(scaled, left=True)
    values, vectors = values.astype(complex), vectors.astype(complex)
    largest = np.abs(values).max()
    # |yᴴx| of the left and right eigenvectors is the inverse of an eigenvalue's condition
    products = (left.conj() * vectors).sum(axis=0)
    aligned = np.maximum(np.abs(products), np.finfo(float).tiny)
    least = np.maximum(_ZERO * rate, _LOST * np.abs(scaled).max() / aligned)
    values[np.abs(values) < np.minimum(least, _ZERO * largest)] = 0.0
    # the errors of a Rayleigh quotient are of second order in those of the vectors
    slow = (values != 0.0) & (np.abs(values) < _SLOW * largest) & (aligned > _SLOW)
    quotients = (left.conj() * (scaled @ vectors)).sum(axis=0)
    values[slow] = quotients[slow] / products[slow]
    real = np.abs(values.imag) <= _UNDAMPED * np.abs(values)
    values[real] = values[real].real
    # eigenvectors of several neutral motions are contaminated by each other
    small = np.abs(vectors) < _ZERO * np.abs(vectors).max(axis=0, initial=0.0)
    vectors[small & (values == 0.0)] = 0.0
    keep = values.imag >= 0
    return values[keep], (sizes[:, None] * vectors)[:, keep]


def _mode(linear: LinearModel, s: complex, state: ComplexArray, weights: Array) -> Mode:
    if abs(s.real) <= _UNDAMPED * abs(s):
        s = complex(0.0, s.imag)
    position = linear.position_shape @ state
    carried = np.abs(position) * weights
    if not carried.any():
        carried = np.abs(position)
    if carried.any():
        # the first of coordinates that move equally, so that rounding does not decide
        leading = int(np.flatnonzero(carried >= (1 - 1e-9) * carried.max())[0])
        state = state / position[leading]
    return Mode(
        kind=_kind(s),
        eigenvalue=s,
        position=_product(linear.position_shape, state),
        velocity=_product(linear.velocity_shape, state),
        multipliers=_product(linear.multiplier_shape, state),
    )


def _kind(s: complex) -> Kind:
    if not s:
        return "neutral"
    if s.imag:
        return "growing oscillation" if s.real > 0 else "oscillation"
    return "divergence" if s.real > 0 else "decay"


def _product(matrix: Array, state: ComplexArray) -> ComplexArray:
    """Return a shape without components that are rounding errors relative to their terms."""
    product = matrix @ state
    least = _ROUNDING * (np.abs(matrix) @ np.abs(state)).max(initial=0.0)
    real, imaginary = (np.where(np.abs(x) > least, x, 0.0) for x in (product.real, product.imag))
    return np.asarray(real + 1j * imaginary)
