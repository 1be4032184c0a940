"""What contacts, limits and friction do at an operating point."""

from __future__ import annotations

from enum import IntEnum
from typing import Literal, NamedTuple

ContactState = Literal[
    "open", "touches", "closed", "holds", "slips", "sticks", "at its limit", "released"
]

#: How a contact ends a branch of equilibria.
ContactEnd = Literal["contact closes", "contact opens", "limit reached", "sliding stops"]

#: Of their scales: gaps, sliding velocities and forces that are zero but for rounding.
ZERO = 1e-9


class Acting(IntEnum):
    """How a switched row acts; the first four are the modes of `RowMode`.

    AT_LOWER, AT_UPPER: the row is at rest, and λ is −limit or +limit, the static one.
    """

    OPEN = 0
    HOLDS = 1
    FORWARD = 2
    BACKWARD = 3
    AT_LOWER = 4
    AT_UPPER = 5

    @property
    def at_limit(self) -> bool:
        """Whether the row is at rest with the largest force that it can transmit."""
        return self in (Acting.AT_LOWER, Acting.AT_UPPER)


class ContactStatus(NamedTuple):
    """What a contact, a limit or friction does at a point.

    Parameters
    ----------
    name : str
        Of the constraint.
    state : str
        ``open``; ``closed``, and of friction and limits ``sticks``, ``slips``, or ``at its limit``:
        at rest with the largest force; ``holds`` and ``released`` of constraints that events
        engage and release. ``touches``: closed without a force, so that neither mode is certain.
    gap : float or None
        |φ|, negative where the contact is violated; None of velocity constraints.
    multiplier : float
        λ.
    limit : float or None
        The largest |λ|, of friction and limits.
    """

    name: str
    state: ContactState
    gap: float | None
    multiplier: float
    limit: float | None

    @property
    def indeterminate(self) -> bool:
        """Whether a small deviation changes the mode, so that there is no linear model."""
        return self.state in ("touches", "at its limit")
