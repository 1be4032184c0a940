"""Contacts and events of a run, for the page."""

from __future__ import annotations

from typing import Any

from lagcli.trajectory.event_log import EventLog, event_sentences

#: Largest number of entries on the page: of more, the first ones.
_MOST = 200


def happened(log: EventLog | None) -> dict[str, Any] | None:
    """Return the log of a run as JSON values; None for a model without contacts and events.

    ``sentences``, ``entries`` as {``time``, ``text``}, and how many ``more`` there are.
    """
    if log is None:
        return None
    listed = zip(log.time[:_MOST].tolist(), log.names, log.kinds, strict=False)
    return {
        "sentences": event_sentences(log.to_mapping()),
        "entries": [
            {"time": time, "text": name if kind == "event" else f"{name} {_WORDS.get(kind, kind)}"}
            for time, name, kind in listed
        ],
        "more": max(0, len(log) - _MOST),
    }


#: Kinds that are not verbs.
_WORDS = {"impact": "has an impact", "rest": "comes to rest"}
