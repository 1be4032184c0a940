"""Layouts: the order of numbers in sample rows and in the outputs of tapes.

`lagcli.engine.core.headers` writes the same for C when the core is built, so this module imports
only the standard library.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, get_type_hints

from lagcli.named_tuples import NamedTuple


class Counts(NamedTuple):
    """Numbers of coordinates, constraints, holonomic ones, and nonzero entries of M and B."""

    nq: int
    nc: int
    nh: int = 0
    nm: int = 0
    nb: int = 0

    @property
    def unknowns(self) -> int:
        """Number of accelerations and multipliers."""
        return self.nq + self.nc


class Layout:
    """Consecutive parts of an array, each a slice.

    Attributes
    ----------
    size : int
        Numbers of elements, by which parts have their sizes.
    """

    size: int

    def __init__(self, counts: NamedTuple):
        first = 0
        for name, part in self.parts().items():
            stop = first + sum(1 if count == "1" else getattr(counts, count) for count in part)
            setattr(self, name, slice(first, stop if part else None))
            first = stop
        self.size = first

    def split(self, values: Any) -> dict[str, Any]:
        """Return the parts of an array, or of a list, by name."""
        return {name: values[getattr(self, name)] for name in self.parts()}

    @classmethod
    @cache
    def parts(cls) -> dict[str, tuple[str, ...]]:
        """Return the summands of each part's size; none for a part that extends to the end."""
        hints = get_type_hints(cls, include_extras=True)
        return {
            name: tuple(filter(None, hint.__metadata__))
            for name, hint in hints.items()
            if name != "size"
        }


One = Annotated[slice, "1"]
Coordinates = Annotated[slice, "nq"]
Constraints = Annotated[slice, "nc"]
Holonomic = Annotated[slice, "nh"]
MassEntries = Annotated[slice, "nm"]
JacobianEntries = Annotated[slice, "nb"]
Unknowns = Annotated[slice, "nq", "nc"]
Rest = Annotated[slice, ""]


class SampleLayout(Layout):
    """Layout of a sample, and of a tape's inputs (parameters follow q and v, or a and λ)."""

    t: One
    q: Coordinates
    v: Coordinates
    a: Coordinates
    multipliers: Constraints
    work: One


class DynamicsLayout(Layout):
    """The outputs of the dynamics tape; the power is that of the applied forces and of time."""

    mass_matrix: MassEntries
    forcing: Coordinates
    jacobian: JacobianEntries
    rhs: Constraints
    power: One


class UnrolledLayout(DynamicsLayout):
    """The outputs of the dynamics tape with the elimination unrolled.

    The solution is a, λ, and the power of all forces. It is followed by ln |det [[M, Bᵀ], [B, 0]]|,
    but for a constant, the solution for another right side (a, λ), and a for a right side of the
    constraints only.
    """

    solution: Unknowns
    total_power: One
    determinant: One
    others: Rest


class ConstraintLayout(Layout):
    """The outputs of the constraint tape."""

    position: Holonomic
    jacobian: JacobianEntries
    drift: Constraints
    position_scale: Holonomic
    velocity_scale: Constraints


class RatesLayout(ConstraintLayout):
    """The outputs of the constraint tape with ψ."""

    velocity: Constraints


class Blocks(NamedTuple):
    """Positions of the motion and of each direction in an augmented System.

    Parameters
    ----------
    counts : Counts
        Counts of the motion, without derivatives.
    directions : int
    """

    counts: Counts
    directions: int

    @property
    def total(self) -> Counts:
        """The counts of the augmented System."""
        return Counts(*(x * (1 + self.directions) for x in self.counts))

    def coordinates(self, block: int) -> slice:
        """Return the indices of a block among the coordinates; block 0 is the motion."""
        return slice(block * self.counts.nq, (block + 1) * self.counts.nq)

    def constraints(self, block: int) -> slice:
        """Return the indices of a block among the constraints."""
        return slice(block * self.counts.nc, (block + 1) * self.counts.nc)


def inputs_of(blocks: Blocks, parameters: int) -> tuple[list[int], list[int], list[int]]:
    """Return the inputs of the augmented System's tapes: q, v and the parameters."""
    nq = blocks.total.nq
    places = range(1 + 2 * nq + parameters)
    return [*places[1 : 1 + nq]], [*places[1 + nq : 1 + 2 * nq]], [*places[1 + 2 * nq :]]
