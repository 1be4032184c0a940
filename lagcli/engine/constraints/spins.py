"""Angular velocities as initial values of quaternions: e' = e ∘ (0, ω)/2, ω in the body frame.

A model file gives ω, each component fixed or guessed, while the coordinates are those of e. Where
the orientation is adjusted, e' follows, so that ω stays as it is given.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array, Flags

_NOTHING = 1e-14  # of the terms of a product


class Spin(NamedTuple):
    """The angular velocity of one quaternion.

    Parameters
    ----------
    name : str
        Of the quaternion.
    places : tuple of 4 int
        Indices of its components among the coordinates.
    fixed : tuple of 3 bool
        Which components of ω are fixed.
    """

    name: str
    places: tuple[int, int, int, int]
    fixed: tuple[bool, bool, bool]

    def labels(self) -> tuple[str, ...]:
        """Return the names of the components of ω, as in expressions."""
        return tuple(f"omega({self.name}).{axis}" for axis in "xyz")


def rates_of_spin(e: Array) -> Array:
    """Return the matrix G/2 of e' = G ω/2, (..., 4, 3)."""
    a, b, c, d = np.moveaxis(np.asarray(e, dtype=float), -1, 0)
    rows = [[-b, -c, -d], [a, -d, c], [d, a, -b], [-c, b, a]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1)) / 2


def spin_of(e: Array, rates: Array) -> Array:
    """Return ω of a quaternion of any length, and its rates, (3,)."""
    return np.asarray(4 * rates_of_spin(e).T @ rates / (e @ e))


def spin_derivative(e: Array, rates: Array, de: Array, drates: Array) -> Array:
    """Return the derivative of ω along changes of the quaternion and of its rates, (3,)."""
    along = 4 * (rates_of_spin(de).T @ rates + rates_of_spin(e).T @ drates)
    return np.asarray((along - 2 * (e @ de) * spin_of(e, rates)) / (e @ e))


def with_given_spins(spins: Sequence[Spin], before: Array, v: Array, q: Array) -> Array:
    """Return velocities whose ω at an orientation q are those of v at another one."""
    v = v.copy()
    for spin in spins:
        places = list(spin.places)
        if not np.array_equal(before[places], q[places]) and before[places].any():
            v[places] = rates_of_spin(q[places]) @ spin_of(before[places], v[places])
    return v


def free_directions(spins: Sequence[Spin], fixed: Flags, q: Array) -> Array:
    """Return the changes of the velocities that are not fixed, (nq, n).

    Parameters
    ----------
    spins : sequence of Spin
    fixed : (nq,) array of bool
        Ignored for the components of the quaternions of spins.
    q : (nq,) array
    """
    plain = ~np.asarray(fixed, dtype=bool)
    for spin in spins:
        plain[list(spin.places)] = False
    columns = [np.eye(len(q))[:, plain]]
    for spin in spins:
        places = list(spin.places)
        turned = np.zeros((len(q), 3))
        turned[places] = rates_of_spin(q[places])
        columns.append(turned[:, ~np.array(spin.fixed)])
    return np.hstack(columns)


def along(jacobian: Array, free: Array) -> Array:
    """Return the rows of B along directions, B times `free_directions`, without rounding errors.

    All ω are tangent to |e| = 1, whose row must vanish.
    """
    found = jacobian @ free
    found[np.abs(found) <= _NOTHING * (np.abs(jacobian) @ np.abs(free))] = 0.0
    return np.asarray(found)
