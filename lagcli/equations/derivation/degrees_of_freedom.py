"""The degrees of freedom of a system: coordinates less the rank of the constraints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple


class RedundantSet(NamedTuple):
    """Constraints that depend on each other.

    Parameters
    ----------
    constraints : tuple of str
        Names; each takes part in a dependency of the rows of B.
    surplus : int
        How many of them follow from the others.
    """

    constraints: tuple[str, ...]
    surplus: int


@dataclass(frozen=True)
class DegreesOfFreedom:
    """What the constraints leave free at one state.

    Parameters
    ----------
    coordinates, constraints : int
        k and r.
    rank : int or None
        Of B at the consistent start; None where there is no such state.
    redundant : tuple of RedundantSet
        The sets of constraints that depend on each other there.
    """

    coordinates: int
    constraints: int
    rank: int | None = None
    redundant: tuple[RedundantSet, ...] = ()

    @property
    def degrees(self) -> int:
        """k − rank B; k − r where the rank is not known."""
        return self.coordinates - (self.constraints if self.rank is None else self.rank)

    @property
    def remarks(self) -> list[str]:
        """Sentences on the redundant constraints."""
        found = [
            f"Redundant: {x.surplus} of {', '.join(x.constraints)}"
            f" follow{'s' if x.surplus == 1 else ''} from the others."
            for x in self.redundant
        ]
        if found:
            found.append(
                "The generalized constraint forces are unique; the multipliers of these"
                " constraints are not, and a simulation gives those of least norm."
            )
        return found

    def to_mapping(self) -> dict[str, Any]:
        """Return the values for result files and summaries."""
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
        """Return what `to_mapping` made a mapping of."""
        redundant = tuple(
            RedundantSet(tuple(map(str, x["constraints"])), int(x["surplus"]))
            for x in values["redundant"]
        )
        rank = values["rank"]
        k, r = int(values["coordinates"]), int(values["constraints"])
        return cls(k, r, None if rank is None else int(rank), redundant)
