"""Whether the modes of contacts are certain, as linear models and branches need."""

from __future__ import annotations

from collections.abc import Sequence

from lagcli.analysis.local.contact_status import ContactStatus
from lagcli.errors import Diagnostic, NumericalError
from lagcli.model.model import Model


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
