"""Degrees of freedom: coordinates minus the rank of the constraint Jacobian."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple


class RedundantSet(NamedTuple):
    """Set of linearly dependent constraints.

    Parameters
    ----------
    constraints : tuple of str
        Names of the constraints whose rows of B are linearly dependent.
    surplus : int
        Number of redundant constraints in the set.
    """

    constraints: tuple[str, ...]
    surplus: int


class DegreesOfFreedom(NamedTuple):
    """Degrees of freedom at one state.

    Parameters
    ----------
    coordinates, constraints : int
        k and r; for a model with contacts or events, the constraints active at the start.
    rank : int or None
        Rank of B at the consistent initial state; None if there is no such state.
    redundant : tuple of RedundantSet
        Sets of dependent constraints at that state.
    held : tuple of str or None
        The constraints active at the start; None if all are always active.
    """

    coordinates: int
    constraints: int
    rank: int | None = None
    redundant: tuple[RedundantSet, ...] = ()
    held: tuple[str, ...] | None = None

    @property
    def degrees(self) -> int:
        """k − rank B; k − r if the rank is unknown."""
        return self.coordinates - (self.constraints if self.rank is None else self.rank)

    @property
    def remarks(self) -> list[str]:
        """Sentences about redundant constraints."""
        remarks = [
            f"Redundant: {x.surplus} of {', '.join(x.constraints)}"
            f" follow{'s' if x.surplus == 1 else ''} from the others."
            for x in self.redundant
        ]
        if remarks:
            remarks.append(
                "The generalized constraint forces are unique; the multipliers of these"
                " constraints are not, and a simulation gives those of least norm."
            )
        return remarks

    def to_mapping(self) -> dict[str, Any]:
        """Return a mapping for result files and summaries."""
        return {
            "coordinates": self.coordinates,
            "constraints": self.constraints,
            "rank": self.rank,
            "degrees_of_freedom": self.degrees,
            "redundant": [
                {"constraints": list(x.constraints), "surplus": x.surplus} for x in self.redundant
            ],
        }

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> DegreesOfFreedom:
        """Return an instance from the result of `to_mapping`."""
        redundant = tuple(
            RedundantSet(tuple(map(str, x["constraints"])), int(x["surplus"]))
            for x in values["redundant"]
        )
        rank = values["rank"]
        k, r = int(values["coordinates"]), int(values["constraints"])
        return cls(k, r, None if rank is None else int(rank), redundant)
