"""Tables of a report: extremes, adjusted initial values, solver, provenance, status."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from html import escape
from typing import Any

from lagcli.arrays import Array
from lagcli.columns import BY_NAME, ColumnName, unit_of_column
from lagcli.pictures.report.curves import ReportCurve
from lagcli.pictures.report.equations import EquationSystem
from lagcli.pictures.report.writing import number, table, unit, with_code
from lagcli.pictures.run_file import RunFile
from lagcli.trajectory.extremes import Extreme, Extremes
from lagcli.version import __version__

_ENDINGS = {
    "failed": "The run failed before its end time.",
    "interrupted": "The run was interrupted before its end time.",
    "stopped-by-event": "The run was stopped by an event.",
    "": "The file does not say how the run ended.",
}


def status(run: RunFile) -> str:
    """Return the banner of a run that is not complete; nothing for a complete one."""
    record = run.record
    if record.status == "completed":
        return ""
    title = _ENDINGS.get(record.status, f"The run has the status {record.status}.")
    message = f"<p>{with_code(record.message)}</p>" if record.message else ""
    samples = (
        f"<p>All of the {run.count} samples that were written are shown.</p>"
        if run.count
        else "<p>It has no samples to draw.</p>"
    )
    kind = "stopped" if record.status == "stopped-by-event" else "bad"
    return (
        f'<div class="status {kind}" role="alert"><strong>{escape(title)}</strong>'
        f"{message}{samples}</div>"
    )


def extremes_table(found: Mapping[ReportCurve, Extreme], system: EquationSystem) -> str:
    """Return the table of extremes, with links at their times."""
    rows = []
    for curve, extreme in found.items():
        if math.isnan(extreme.low):
            continue
        symbol, shown = _named(curve, system)
        low, high = number(extreme.low), number(extreme.high)
        times = [time_button(extreme.low_time), time_button(extreme.high_time)]
        rows.append([symbol, shown, low, times[0], high, times[1]])
    head = ["Quantity", "Unit", "Least", "at t [s]", "Largest", "at t [s]"]
    if not rows:
        return "<p>There are no samples.</p>"
    return table("Extremes among all samples", head, rows, numeric=(2, 3, 4, 5), kind="extremes")


def moved(run: RunFile, system: EquationSystem) -> str:
    """Return the adjusted initial values; nothing without constraints."""
    correction = run.record.initial_correction
    if not run.constraints:
        return ""
    if not correction:
        return "<p>The given initial values satisfy the constraints.</p>"
    rows = []
    for name, (before, after) in list(correction.items())[:24]:
        base = name.rstrip("'")
        known = base in system.model.coordinate_names
        symbol = system.symbol(base, len(name) - len(base)) if known else escape(name)
        rows.append([symbol, number(before, 8), number(after, 8), number(after - before, 3)])
    head = ["Initial value", "Guessed", "Used", "Difference"]
    more = len(correction) - len(rows)
    note = f"<p class='note'>And {more} more.</p>" if more else ""
    caption = "Initial values adjusted to satisfy the constraints"
    return table(caption, head, rows, numeric=(1, 2, 3)) + note


def solver(run: RunFile, found: Extremes) -> str:
    """Return the table of the solver and its accuracy."""
    record = run.record
    options = record.options
    counts = ", ".join(f"{value} {name}" for name, value in record.counts.items())
    seconds = ", ".join(f"{name} {number(value, 3)} s" for name, value in record.seconds.items())
    scale = found.energy_scale
    balance = f"{number(found.energy_balance, 2)} J"
    if scale:
        balance += f", {number(found.energy_balance / scale, 2)} of {number(scale, 4)} J"
    rows = [
        ("Status", escape(record.status or "not recorded")),
        ("Message", with_code(record.message)),
        ("Method", escape(_phrase(options))),
        ("Counts", escape(counts)),
        ("Time", escape(seconds)),
        ("Position residual", _worst(found.residual_position, record.scale_position)),
        ("Velocity residual", _worst(found.residual_velocity, record.scale_velocity)),
        ("Equation residual", number(found.residual_equation, 2)),
        ("Energy balance", balance),
    ]
    return table("Method and accuracy", ["", ""], [row for row in rows if row[1]], kind="facts")


def provenance(run: RunFile) -> str:
    """Return the information needed to reproduce the run."""
    record = run.record
    options = ", ".join(f"{k} = {_plain(v)}" for k, v in record.options.items() if v is not None)
    versions = f"run by lagcli {record.lagcli_version}" if record.lagcli_version else ""
    page = f"page by lagcli {__version__}"
    rows = [
        ("File", escape(os.path.basename(run.name)) if os.path.exists(run.name) else ""),
        ("Samples", str(run.count)),
        ("Version", escape(", ".join(x for x in (versions, page) if x))),
        ("Model", f"<code>sha256 {escape(record.model_sha256)}</code>"),
        *(
            (f"Input {escape(name)}", f"{escape(x.file)} <code>sha256 {escape(x.sha256)}</code>")
            for name, x in record.inputs.items()
            if x.file
        ),
        ("Options", escape(options)),
    ]
    return table("Provenance", ["", ""], [row for row in rows if row[1]], kind="facts")


def _named(curve: ReportCurve, system: EquationSystem) -> tuple[str, str]:
    """Return the symbol and the unit of a curve."""
    run, place = system.run, curve.place
    match curve.field:
        case "q" | "v" as field:
            name = run.coordinates[place[0]]
            stated = BY_NAME[field].unit_at(run.record.units.get(name))
            return system.symbol(name, int(field == "v")), unit(stated)
        case "multipliers":
            name = run.constraints[place[0]]
            shown = f'{system.multiplier(name)} <span class="name">{escape(name)}</span>'
            return shown, unit(unit_of_column(ColumnName("multipliers", name), run.record.units))
        case field if field in BY_NAME:
            quantity = BY_NAME[field]
            return f"{escape(curve.label)}, {escape(quantity.description)}", unit(quantity.unit)
    return escape(curve.name), unit(run.record.units.get(curve.name))


def time_button(time: float, digits: int = 6) -> str:
    """Return a time as a button that moves the animation to it, in HTML."""
    shown = number(time, digits)
    title = "Show this time in the animation and the plots"
    return f'<button type="button" data-time="{time!r}" title="{title}">{shown}</button>'


def _phrase(options: Mapping[str, Any]) -> str:
    method, formulation = options.get("method"), options.get("formulation")
    engine, rtol, atol = (options.get(key) for key in ("engine", "rtol", "atol"))
    parts = [f"{method} with {formulation}" if formulation else method]
    if isinstance(atol, Mapping):
        atol = ", ".join(f"{name} {x:g}" for name, x in atol.items())
    absolute = "by size" if atol is None else atol if isinstance(atol, str) else f"{atol:g}"
    tolerances = f"rtol {rtol:g}, atol {absolute}" if rtol else ""
    parts += [f"{engine} engine" if engine else "", tolerances]
    return ", ".join(p for p in parts if p)


def _worst(residual: Array, scale: Array) -> str:
    """Return the largest residual relative to its constraint's scale."""
    ratios = [r / s for r, s in zip(residual, scale, strict=True) if r == r and s == s and s > 0]
    return f"{number(max(ratios), 2)}, relative to the constraint's scale" if ratios else ""


def _plain(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.9g}"
    if isinstance(value, (list, tuple)) and len(value) > 8:
        return f"{len(value)} values"
    return str(value)
