"""Contacts and events in a report: counts, notes, and the entries of the log."""

from __future__ import annotations

from html import escape

from lagcli.columns import ColumnName, read_column_name, unit_of_column
from lagcli.pictures.report.tables import time_button
from lagcli.pictures.report.writing import axis_unit, number, table, with_code
from lagcli.pictures.run_file import RunFile
from lagcli.trajectory.event_log import MODES, EventLog, EventRecords, event_sentences

#: Largest number of entries that are listed: of more, the first ones and the last.
_FIRST, _LAST = 60, 20
#: Largest number of recorded columns in a table.
_COLUMNS = 8


def events_section(run: RunFile) -> str:
    """Return the section of a run with contacts or events; nothing for any other."""
    log = run.record.events
    if log is None:
        return ""
    sentences = "".join(f"<p>{with_code(text)}.</p>" for text in event_sentences(log.to_mapping()))
    entries = _entries(run, log) if len(log) else ""
    recorded = _recorded(run, log.records, log) if 0 < len(log.records.columns) <= _COLUMNS else ""
    return (
        f'<section id="events"><h2>Contacts and events</h2>{sentences}{entries}{recorded}</section>'
    )


def events_contents(run: RunFile) -> list[tuple[str, str]]:
    """Return the entry in the table of contents; none for a run without contacts and events."""
    return [] if run.record.events is None else [("events", "Contacts and events")]


def _recorded(run: RunFile, records: EventRecords, log: EventLog) -> str:
    """Return the table of recorded columns."""
    places = _listed(len(records.entry))
    rows = []
    for place in places:
        entry, values = int(records.entry[place]), records.of(place)
        cells = [_limits(values[name]) if name in values else "" for name in records.columns]
        rows.append([time_button(float(log.time[entry]), 9), escape(log.names[entry]), *cells])
    head = ["t [s]", "Event", *(_headed(run, name) for name in records.columns)]
    caption = "What events recorded, before → after"
    numeric = (0, *range(2, len(head)))
    return table(caption, head, rows, numeric=numeric, kind="extremes") + _left_out(
        len(records.entry) - len(places)
    )


def _limits(both: tuple[float, float]) -> str:
    """Return the values before and after an event, or one if they are equal."""
    return " → ".join(dict.fromkeys(number(x) for x in both))


def _headed(run: RunFile, name: str) -> str:
    column, units = read_column_name(name, run.coordinates, run.constraints), run.record.units
    unit = units.get(name) if column is None else unit_of_column(column, units)
    return f"{name} [{unit}]" if unit else name


def _listed(count: int) -> list[int]:
    """Return the indices of the entries that are listed."""
    places = list(range(count))
    return places if count <= _FIRST + _LAST else places[:_FIRST] + places[-_LAST:]


def _left_out(count: int) -> str:
    return f"<p class='note'>And {count} more between them.</p>" if count else ""


def _impulse_unit(run: RunFile, log: EventLog) -> str:
    """Return the unit of the impulses: that of λ times s, or a general one if they differ."""
    struck = {name for name in log.names if name in run.constraints}
    columns = [ColumnName("multipliers", name) for name in struck]
    units = {axis_unit(unit_of_column(c, run.record.units)) for c in columns}
    common = units.pop() if len(units) == 1 else ""
    return f"{common} s" if common else "λ s"


def _entries(run: RunFile, log: EventLog) -> str:
    places = _listed(len(log))
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
    head = ["t [s]", "Name", "What", "Mode after", f"Impulse [{_impulse_unit(run, log)}]"]
    head += ["Loss [J]", "Supplied [J]", "Work [J]"]
    caption = "What happened, in order"
    return table(caption, head, rows, numeric=(0, 4, 5, 6, 7), kind="extremes") + _left_out(
        len(log) - len(places)
    )
