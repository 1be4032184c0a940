"""Degrees of freedom: coordinates minus the rank of the constraint Jacobian."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from lagcli.model.names.members import families


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

    def sentence(self, named: Sequence[str]) -> str:
        """Return a sentence on the redundant constraints, without a full stop, with their names."""
        if len(self.constraints) == 1:
            return f"{named[0]}, which has no gradient there"
        follow = "follows" if self.surplus == 1 else "follow"
        return f"{self.surplus} of {', '.join(named)} {follow} from the others"


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
    nearby : int or None
        The largest rank of B at consistent states near that state, if they were computed.
    """

    coordinates: int
    constraints: int
    rank: int | None = None
    redundant: tuple[RedundantSet, ...] = ()
    held: tuple[str, ...] | None = None
    nearby: int | None = None

    @property
    def singular(self) -> str | None:
        """The sentence on a singular start; None if the rank is not larger nearby."""
        if self.rank is None or self.nearby is None or self.nearby <= self.rank:
            return None
        return (
            f"The rank of B is {self.rank} at the start and {self.nearby} nearby: the start is a"
            " singular configuration, and a motion from there may not be unique. Start away from"
            " it."
        )

    @property
    def degrees(self) -> int:
        """k − rank B; k − r if the rank is unknown."""
        return self.coordinates - (self.constraints if self.rank is None else self.rank)

    @property
    def remarks(self) -> list[str]:
        """Sentences about redundant constraints."""
        said = "Redundant" if self.singular is None else "Dependent at the start"
        remarks = [f"{said}: {x.sentence(families(x.constraints))}." for x in self.redundant]
        if self.singular:
            remarks.append(self.singular)
        elif remarks:
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
