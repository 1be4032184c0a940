"""Blocks of a System that contains a motion and its derivatives."""

from __future__ import annotations

from dataclasses import dataclass

from lagcli.engine.layout import Counts


@dataclass(frozen=True, eq=False)
class Blocks:
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
