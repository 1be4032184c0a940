"""What happened at contacts and events, in a report: counts, notes, and the entries of the log."""

from __future__ import annotations

from html import escape

from lagcli.pictures.report.tables import time_button
from lagcli.pictures.report.writing import number, table
from lagcli.pictures.run_file import RunFile
from lagcli.trajectory.event_log import MODES, EventLog, event_sentences

#: Entries that are listed: of more, the first ones and the last.
_FIRST, _LAST = 60, 20


def events_section(run: RunFile) -> str:
    """Return the section of a run with contacts or events; nothing of any other."""
    log = run.record.events
    if log is None:
        return ""
    sentences = "".join(f"<p>{escape(text)}.</p>" for text in event_sentences(log.to_mapping()))
    entries = _entries(run, log) if len(log) else ""
    return f'<section id="events"><h2>Contacts and events</h2>{sentences}{entries}</section>'


def events_link(run: RunFile) -> str:
    """Return the entry in the table of contents; nothing of a run without contacts and events."""
    return "" if run.record.events is None else '<li><a href="#events">Contacts and events</a></li>'


def _entries(run: RunFile, log: EventLog) -> str:
    places = list(range(len(log)))
    if len(places) > _FIRST + _LAST:
        places = places[:_FIRST] + places[-_LAST:]
    rows = []
    for i in places:
        name, impulse, mode = log.names[i], "", ""
        if name in run.constraints and log.impulse[i].any():
            impulse = number(log.impulse[i, run.constraints.index(name)])
        if name in log.rows:
            mode = MODES[log.modes[i, log.rows.index(name)]]
        amounts = [number(x[i], 4) if x[i] else "" for x in (log.loss, log.supplied, log.work)]
        time = time_button(float(log.time[i]), 9)
        rows.append([time, escape(name), log.kinds[i], mode, impulse, *amounts])
    head = ["t [s]", "Name", "What", "Mode after", "Impulse [J s/unit]"]
    head += ["Loss [J]", "Supplied [J]", "Work [J]"]
    left = len(log) - len(places)
    note = f"<p class='note'>And {left} more between them.</p>" if left else ""
    caption = "What happened, in order"
    return table(caption, head, rows, numeric=(0, 4, 5, 6, 7), kind="extremes") + note
