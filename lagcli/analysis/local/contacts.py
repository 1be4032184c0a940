"""Contacts, limits and friction at an operating point: their states, as JSON values and as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, Literal, NamedTuple

from lagcli.analysis.output.text import entry, listed, without_rounding
from lagcli.errors import Diagnostic, NumericalError
from lagcli.model.model import Model

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


_SHOWN = 12


def describe_contacts(contacts: Sequence[ContactStatus]) -> list[dict[str, Any]]:
    """Return contacts as JSON values."""
    return [contact._asdict() for contact in contacts]


def acting(contact: Mapping[str, Any]) -> Acting:
    """Return how the row of a contact acts, from `describe_contacts`."""
    if contact["state"] == "slips":
        return Acting.FORWARD if contact["multiplier"] < 0 else Acting.BACKWARD
    if contact["state"] in ("closed", "sticks", "holds"):
        return Acting.HOLDS
    return Acting.OPEN


def contact_lines(contacts: Sequence[Mapping[str, Any]], indent: int) -> list[str]:
    """Return lines on the statuses of contacts, from `describe_contacts`."""
    if not contacts:
        return []
    limits = {f"limit of {c['name']}": c["limit"] or 0.0 for c in contacts}
    forces = without_rounding({**{c["name"]: c["multiplier"] for c in contacts}, **limits})
    texts = [_text(contact, forces[contact["name"]]) for contact in contacts]
    return entry("contacts", listed(texts, _SHOWN), indent)


def _text(contact: Mapping[str, Any], force: float) -> str:
    text = f"{contact['name']} {contact['state']}"
    if contact["state"] == "open" and contact["gap"] is not None:
        return f"{text} (gap {contact['gap']:.6g})"
    if contact["state"] in ("open", "released", "touches"):
        return text
    text += f" (λ = {force:.6g}"
    if contact["limit"] is not None and contact["state"] != "slips":
        text += f", limit {contact['limit']:.6g}"
    return text + ")"


def check_determinate(model: Model, contacts: Sequence[ContactStatus], what: str) -> None:
    """Raise NumericalError where a small deviation changes the mode of a contact.

    Parameters
    ----------
    model : Model
    contacts : sequence of ContactStatus
    what : str
        What does not exist, as in "linear model about the start".
    """
    for contact in contacts:
        if not contact.indeterminate:
            continue
        location = next(c.location for c in model.constraints if c.name == contact.name)
        if contact.state == "touches":
            why = f"`{contact.name}` touches without a force, and closes or opens"
            remedy = "if it stays closed, write it with `=`; if it stays open, leave it out"
        else:
            why = f"`{contact.name}` is at its limit, and sticks or slips"
            remedy = "if it sticks, raise its limit"
        raise NumericalError(
            Diagnostic(
                "no-linear-model",
                f"{model.name} has no {what}: {why} with the smallest deviation",
                location,
                f"choose another point (--set, --set-initial, --at); {remedy}",
            )
        )
