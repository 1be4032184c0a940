"""The sections of the page of a sweep: rows, measures, effects of the varied quantities,
motions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from html import escape
from typing import Any

import numpy as np

from lagcli.column_units import NOT_STATED
from lagcli.errors import UsageError
from lagcli.model.loader import load_text
from lagcli.model.model import Model
from lagcli.pictures.page import message, number, own_words, table, unit
from lagcli.pictures.plots.run_plot import plot_runs
from lagcli.pictures.plots.sweep_plot import TORNADO, PlottedTable, Rows, plot_table
from lagcli.pictures.report.report_page import AnalysisSection, picture
from lagcli.pictures.selection import elided
from lagcli.simulations.inputs import input_data
from lagcli.sweeps.file.description import describe_sweep
from lagcli.sweeps.file.store import open_sweep
from lagcli.sweeps.row_results import COMPLETED

#: Largest number of measures that are drawn, and of failures and rows that are listed.
_DRAWN, _CAUSES, _ROWS = 8, 12, 60


def sweep_model(path: str) -> Model:
    """Return the model of a sweep file, with the values common to all rows.

    Raises
    ------
    FileError, ModelError
        As `lagcli.sweeps.file.store.open_sweep`, `lagcli.load_text`.
    """
    with open_sweep(path) as file:
        facts, data = file.facts, input_data(file.inputs)
    given = facts["sweep"]
    text, origin = str(facts["model"]), str(facts["model_path"])
    return load_text(text, origin, given["set"], given["set_initial"], data)


def sweep_sections(path: str, named: Callable[[str], str]) -> list[AnalysisSection]:
    """Return the sections of a sweep file.

    Parameters
    ----------
    path : str
    named : callable
        Function that writes a name of the model in HTML.

    Raises
    ------
    FileError, ModelError, UsageError
        As `lagcli.plot`.
    """
    content, plotted = describe_sweep(path), PlottedTable(path)
    sections = [AnalysisSection("sweep", "Sweep", _facts(content) + _columns(content, named))]
    if plotted.measures and any(np.isfinite(q.values).any() for q in plotted.measures):
        sections.append(AnalysisSection("measures", "Measures", _measures(plotted)))
        effects = _effects(plotted)
        if effects:
            sections.append(AnalysisSection("effects", "Effects of what was varied", effects))
    if plotted.kept and content["rows"].get("completed"):
        rows = Rows(path)
        drawn = picture(partial(plot_runs, rows.runs, ()), "The motions of the rows")
        note = f'<p class="note">{len(rows.runs)} of {rows.good} rows are drawn.</p>'
        drawn += note * (len(rows.runs) < rows.good)
        sections.append(AnalysisSection("motions", "Motions", drawn))
    sections.append(AnalysisSection("rows", "Rows", _rows(path, named)))
    return sections


def _facts(content: Mapping[str, Any]) -> str:
    how = "together" if content["zip"] else "all combinations"
    drawn = "; ".join(
        f"{name}: {x['points']} points, {x['kind']}, seed {x['seed']}"
        for name, x in content["sample"].items()
    )
    varied = content["vary"]
    statuses = ", ".join(f"{count} {status}" for status, count in content["rows"].items())
    facts = [
        ("Rows", f"{sum(content['rows'].values())}: {escape(statuses)}"),
        ("Varied", escape("; ".join(varied)) + (f" ({how})" if len(varied) > 1 else "")),
        ("Drawn", escape(drawn)),
        ("Kept", f"{content['samples']} samples of each row" if content["samples"] else "measures"),
    ]
    body = table("The sweep", ["", ""], [x for x in facts if x[1]], kind="facts")
    causes = sorted(content["failures"].items(), key=lambda x: -x[1])
    if causes:
        rows = [[str(count), message(cause)] for cause, count in causes[:_CAUSES]]
        body += table("Rows that failed, by cause", ["Rows", "Cause"], rows)
    return body


def _columns(content: Mapping[str, Any], named: Callable[[str], str]) -> str:
    rows = [
        [
            named(x["name"]),
            _meaning(x["long_name"]),
            "" if x["unit"] == NOT_STATED else unit(x["unit"]),
            number(x["min"], 8),
            number(x["max"], 8),
        ]
        for x in (*content["columns"], *content["measures"])
    ]
    head = ["Quantity", "What it is", "Unit", "Least", "Largest"]
    return table("What was varied and what was measured", head, rows, numeric=(3, 4))


def _meaning(text: str) -> str:
    """Return what a quantity is: a description of the model, or what the program says."""
    return escape(text) if text.startswith("initial value of ") else own_words(text)


def _measures(plotted: PlottedTable) -> str:
    """Return a picture of each measure, and a note if a map shows only a part of the rows."""
    shown = []
    for measure in plotted.measures[:_DRAWN]:
        try:
            drawn = picture(partial(plot_table, plotted, [measure.name]), f"{measure.name}")
        except UsageError:
            # more quantities were varied than a map has axes: draw over each quantity
            names = [f"{q.name}:{measure.name}" for q in plotted.varied]
            drawn = picture(partial(plot_table, plotted, names), f"{measure.name}")
        shown.append(drawn)
    rest = len(plotted.measures) - _DRAWN
    return "".join(shown) + f'<p class="note">And {rest} more measures.</p>' * (rest > 0)


def _effects(plotted: PlottedTable) -> str:
    """Return tornado charts of the measures; nothing if fewer than two quantities vary."""
    if sum(len(np.unique(q.values)) > 1 for q in plotted.varied) < 2:
        return ""
    try:
        names = [TORNADO + q.name for q in plotted.measures[:_DRAWN]]
        drawn = picture(partial(plot_table, plotted, names), "Tornado charts of the measures")
    except UsageError:
        return ""  # too few rows have a value
    return drawn + (
        '<p class="note">The bar of a quantity spans the means of the measure over the rows with'
        " each of its values, where all values were combined; else a linear fit over its range.</p>"
    )


def _rows(path: str, named: Callable[[str], str]) -> str:
    """Return the table of the rows; of many, the first and the last."""
    with open_sweep(path) as file:
        columns = [*file.columns, *file.measures]
        count = file.length
        few = (
            list(range(count)) if count <= _ROWS else [*range(_ROWS - 5), *range(count - 5, count)]
        )
        values = [file.read(c.dataset)[few] for c in columns]
        status = file.read("status")[few]
        messages = file.messages()
    lines = [
        [
            str(row),
            *(number(float(x[i]), 8) for x in values),
            "" if status[i] == COMPLETED else message(messages[row]),
        ]
        for i, row in enumerate(few)
    ]
    head = ["Row", *(named(c.name) for c in columns), "Failure"]
    dots = ["…"] + [""] * (len(head) - 1)
    numeric = range(1, 1 + len(columns))
    return table(f"{count} rows", head, elided(few, lines, dots), numeric=list(numeric))
