"""Layouts: the order of numbers in sample rows and in the outputs of tapes.

`lagcli.engine.core.headers` writes the same for C when the core is built, so this module imports
only the standard library.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple


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


class _Part(tuple[str, ...]):
    """The summands of a part's size."""


def part(*counts: str) -> slice:
    """Declare a part of a layout.

    Parameters
    ----------
    *counts : str
        Its size is the sum of these, each 1 or a field of the layout's counts. A part without them
        extends to the end.
    """
    return _Part(counts)  # type: ignore[return-value]  # a slice in layouts of known counts


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
        for name, summands in self.parts().items():
            stop = first + sum(1 if count == "1" else getattr(counts, count) for count in summands)
            setattr(self, name, slice(first, stop if summands else None))
            first = stop
        self.size = first

    def split(self, values: Any) -> dict[str, Any]:
        """Return the parts of an array, or of a list, by name."""
        return {name: values[getattr(self, name)] for name in self.parts()}

    @classmethod
    @cache
    def parts(cls) -> dict[str, tuple[str, ...]]:
        """Return the summands of each part's size; none for a part that extends to the end."""
        members = [item for base in reversed(cls.__mro__) for item in vars(base).items()]
        return {name: x for name, x in members if isinstance(x, _Part)}


class SampleLayout(Layout):
    """Layout of a sample, and of a tape's inputs (parameters follow q and v, or a and λ)."""

    t = part("1")
    q = part("nq")
    v = part("nq")
    a = part("nq")
    multipliers = part("nc")
    work = part("1")


class DynamicsLayout(Layout):
    """The outputs of the dynamics tape; the power is that of the applied forces and of time."""

    mass_matrix = part("nm")
    forcing = part("nq")
    jacobian = part("nb")
    rhs = part("nc")
    power = part("1")


class UnrolledLayout(DynamicsLayout):
    """The outputs of the dynamics tape with the elimination unrolled.

    The solution is a, λ, and the power of all forces. It is followed by ln |det [[M, Bᵀ], [B, 0]]|,
    but for a constant, the solution for another right side (a, λ), and a for a right side of the
    constraints only.
    """

    solution = part("nq", "nc")
    total_power = part("1")
    determinant = part("1")
    others = part()


class ConstraintLayout(Layout):
    """The outputs of the constraint tape."""

    position = part("nh")
    jacobian = part("nb")
    drift = part("nc")
    position_scale = part("nh")
    velocity_scale = part("nc")


class RatesLayout(ConstraintLayout):
    """The outputs of the constraint tape with ψ."""

    velocity = part("nc")


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
