"""Contacts at an operating point as JSON values and as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lagcli.analysis.local.contact_status import Acting, ContactStatus
from lagcli.analysis.text import entry, listed

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
    """Return lines that say what contacts do, from `describe_contacts`."""
    if not contacts:
        return []
    return entry("contacts", listed([_text(contact) for contact in contacts], _SHOWN), indent)


def _text(contact: Mapping[str, Any]) -> str:
    text = f"{contact['name']} {contact['state']}"
    if contact["state"] == "open" and contact["gap"] is not None:
        return f"{text} (gap {contact['gap']:.6g})"
    if contact["state"] in ("open", "released", "touches"):
        return text
    text += f" (λ = {contact['multiplier']:.6g}"
    if contact["limit"] is not None and contact["state"] != "slips":
        text += f", limit {contact['limit']:.6g}"
    return text + ")"
