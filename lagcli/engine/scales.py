"""Scales of the residuals of constraints; see docs/decisions/2026-11-scales.md.

The scale of a constraint is the sum of the magnitudes of its terms, but at least the value implied
by the sizes of the coordinates, because all terms of a constraint may vanish along a motion.
"""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array, Flags
from lagcli.engine.sparse_rows import SparseRows, in_turns, magnitudes, rows_and_columns
from lagcli.engine.system import Pattern

#: Smallest size of a coordinate by its inertia, relative to that of the system, √max(M_jj x_j²).
#: With 1, the scale of a light body's constraints would be that of the heaviest body.
LEAST_PART = 1e-3
#: Smallest length of a row that is not zero, relative to that implied by its constraint's terms.
_PART = 1e-6


def least_scales(inertia: Array, jacobian: Array | SparseRows, x: Array) -> Array:
    """Return the minimum scales of constraints, for one state or for many.

    The larger of Σ_j |B_ij x_j| and LEAST_PART √(Σ_j B_ij²/M_jj) √max_j(M_jj x_j²). Neither
    depends on the units of coordinates, and both have the unit of the constraint.

    Parameters
    ----------
    inertia : (..., nq) array
        Inertia of each coordinate (`System.inertia`); one without inertia has only its own size.
    jacobian : (..., n, nq) array or SparseRows
        Rows of B.
    x : (..., nq) array
        Coordinates, or velocities.

    Returns
    -------
    (..., n) array
    """
    compliance, size = _inertial(inertia, x, -1)
    own = _times(magnitudes(jacobian), np.abs(x))
    length = np.sqrt(_times(jacobian * jacobian, compliance))
    return np.asarray(np.maximum(own, LEAST_PART * size[..., None] * length))


def least_scales_of_entries(
    inertia: Array, pattern: Pattern, entries: Array, rows: int, x: Array
) -> Array:
    """Return the same, (rows, n), for B in its nonzero entries (nb, n); M_jj and x are (nq, n)."""
    compliance, size = _inertial(inertia, x, 0)
    own, length = np.zeros((2, rows, x.shape[1]))
    row, column = rows_and_columns(pattern)
    for turn in in_turns(row):
        i, j, entry = row[turn], column[turn], entries[turn]
        own[i] += np.abs(entry * x[j])
        length[i] += entry * entry * compliance[j]
    return np.maximum(own, LEAST_PART * size * np.sqrt(length))


def coordinate_sizes(inertia: Array, jacobian: Array | SparseRows) -> Array:
    """Return comparable changes of the coordinates, (nq,): B times these is dimensionless.

    1/√M_jj. For coordinates without inertia, the value that makes their contributions to the rows
    of B as large as those of the others.

    Parameters
    ----------
    inertia : (nq,) array
    jacobian : (nc, nq) array or SparseRows
    """
    known = inertia > 0.0
    sizes = np.sqrt(compliance_of(inertia))
    entries = magnitudes(jacobian)
    while not known.all():
        length = np.sqrt((entries * entries) @ (sizes * sizes))
        rows = length > 0.0
        part = _largest_by_column(entries, rows, length)
        newly = ~known & (part > 0.0)
        if not newly.any():  # coordinates coupled only to each other
            part = _largest_by_column(entries, length >= 0.0, np.ones(len(length)))
            newly = ~known
        sizes[newly] = 1.0 / np.where(part[newly] > 0.0, part[newly], 1.0)
        known |= newly
    return sizes


def row_lengths(
    jacobian: Array | SparseRows, sizes: Array, terms: Array, reach: Array | float
) -> Array:
    """Return scales of the rows of B times sizes that do not vanish with the rows, (n,).

    The length of a row or, if that is smaller, a small part of the constraint's terms over the
    change of the coordinates (velocities) that changes the constraint by this amount.

    Parameters
    ----------
    jacobian : (n, nq) array or SparseRows
        B or its rows.
    sizes : (nq,) array
        Changes of the coordinates that are considered equal in size.
    terms : (n,) array
        Sums of the magnitudes of the constraints' terms.
    reach : (n,) array or float
        The change, in sizes; 0 if it is not known.
    """
    floor = np.divide(_PART * terms, reach, out=np.zeros(len(terms)), where=np.asarray(reach) > 0)
    return usable(np.maximum(lengths_of_rows(jacobian, sizes), floor))


def lengths_of_rows(jacobian: Array | SparseRows, sizes: Array | float) -> Array:
    """Return the lengths of the rows of B times sizes, (n,)."""
    scaled = jacobian * sizes
    return np.asarray(np.sqrt((scaled * scaled).sum(axis=1)))


def largest(x: Array, sizes: Array) -> float:
    """Return the largest coordinate (velocity), in sizes."""
    return float(np.abs(x / sizes).max(initial=0.0))


def apart(sizes: Array) -> Array:
    """Return a direction in which no two coordinates move equally, (nq,)."""
    return np.asarray(sizes * np.cos(1.0 + np.arange(len(sizes))))


def usable(scale: Array) -> Array:
    """Return 1 for a scale of zero, for which the residual is zero too."""
    return np.where(scale > 0.0, scale, 1.0)


def _inertial(inertia: Array, x: Array, axis: int) -> tuple[Array, Array]:
    """Return 1/M_jj, or 0 without inertia, and √max_j(M_jj x_j²)."""
    with np.errstate(over="ignore"):
        moment = np.where(inertia > 0.0, inertia * x * x, 0.0)
    return compliance_of(inertia), np.sqrt(moment.max(axis=axis, initial=0.0))


def _times(matrix: Array | SparseRows, x: Array) -> Array:
    if isinstance(matrix, SparseRows):
        return matrix @ x
    return np.asarray(np.matmul(matrix, x[..., None])[..., 0])


def _largest_by_column(entries: Array | SparseRows, rows: Flags, length: Array) -> Array:
    """Return the largest entry of each column in some rows, over the row's length."""
    if isinstance(entries, SparseRows):
        return entries.largest_by_column(rows, length)
    return np.asarray((entries[rows] / length[rows, None]).max(axis=0, initial=0.0))


def compliance_of(inertia: Array) -> Array:
    """Return 1/M_jj, or 0 without inertia."""
    resists = inertia > 0.0
    return np.where(resists, 1.0 / np.where(resists, inertia, 1.0), 0.0)
