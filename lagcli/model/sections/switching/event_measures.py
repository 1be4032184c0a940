"""Measures of the event log: ``count(floor impacts)``, ``time_of(kick)``, ``impulse.floor``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Literal, NamedTuple, get_args

from lagcli.columns import SLIP
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.model import ContactChange, Model

_NAME = r"[^\W\d][\w.]*(?:\[[^\]]*\])?"
_CHANGES = "|".join(get_args(ContactChange))
_MEASURE = re.compile(
    rf"\b(?P<kind>count|time_of)\(\s*(?P<name>{_NAME})(?:\s+(?P<change>{_CHANGES}))?\s*\)"
    rf"|\bimpulse\.(?P<row>{_NAME})"
)


class EventMeasure(NamedTuple):
    """One number from the event log of a run.

    Parameters
    ----------
    kind : "count", "time_of" or "impulse"
        Number of occurrences, time of the first one, or sum of the impulses of a constraint.
    name : str
        Name of the constraint or event.
    occurrence : str
        Change as in the log; None for "impulse".
    """

    kind: Literal["count", "time_of", "impulse"]
    name: str
    occurrence: str = ""


def event_measures(model: Model, text: str) -> tuple[str, Mapping[str, EventMeasure]]:
    """Return a measure with names instead of its calls on contacts and events.

    Parameters
    ----------
    model : Model
    text : str

    Returns
    -------
    text : str
        Has the same length as before, so that offsets remain valid.
    measures : mapping of str to EventMeasure
        By the names that represent them.

    Raises
    ------
    ExpressionError
        The model has no such constraint or event, or the change is impossible for it.
    """
    found: dict[str, EventMeasure] = {}

    def replaced(match: re.Match[str]) -> str:
        measure = _measure(model, match)
        if measure is None:
            return match[0]
        name = f"event{len(found)}".ljust(len(match[0]), "_")
        found[name] = measure
        return name

    return _MEASURE.sub(replaced, text), found


def _measure(model: Model, match: re.Match[str]) -> EventMeasure | None:
    """Return the requested number; None for an ordinary measure, such as a condition by name."""
    constraints = model.constraint_names
    if match["row"] is not None:
        _check(match, "row", constraints, "constraint")
        return EventMeasure("impulse", match["row"])
    kind: Literal["count", "time_of"] = "count" if match["kind"] == "count" else "time_of"
    name, change = match["name"], match["change"]
    events = tuple(event.name for event in model.events)
    if change is None:
        if kind == "time_of" and name not in events:
            return None
        _check(match, "name", events, "event")
        return EventMeasure(kind, name, "event")
    _check(match, "name", constraints, "constraint")
    if change in ("slips", "sticks") and name + SLIP in constraints:
        name += SLIP
    row = model.constraints[constraints.index(name)]
    limited = change in ("slips", "sticks")
    if row.limit is None if limited else not row.sign:
        missing = "friction and no limit" if limited else "contact: it holds in both directions"
        raise ExpressionError(
            "not-a-measure",
            f"`{match[0]}`: the constraint `{name}` has no {missing}",
            match.start("name"),
            match.end("change"),
            _listed("constraint", constraints),
        )
    return EventMeasure(kind, name, "impact" if change == "impacts" else change)


def _check(match: re.Match[str], part: str, names: tuple[str, ...], what: str) -> None:
    if match[part] not in names:
        raise ExpressionError(
            "unknown-name",
            f"`{match[0]}`: the model has no {what} `{match[part]}`",
            match.start(part),
            match.end(part),
            _listed(what, names),
        )


def _listed(what: str, names: tuple[str, ...]) -> str:
    listed = ", ".join(names[:12]) + (", …" if len(names) > 12 else "")
    return f"its {what}s are {listed or 'none'}"
