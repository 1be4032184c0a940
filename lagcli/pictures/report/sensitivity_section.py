"""Sensitivities in the report of a run: effects of parameters on multipliers and motion."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import ColumnName, unit_of_column
from lagcli.equations.render.names import Notation
from lagcli.pictures.report.curves import label
from lagcli.pictures.report.writing import chosen, number, table, unit
from lagcli.pictures.run_file import RunFile

#: Largest number of multipliers with a tornado chart, and of listed coordinates.
_CHARTS, _COORDINATES = 12, 24
_HALF, _HEIGHT = 60.0, 12  # of a bar, in units of its picture


def sensitivity_section(run: RunFile, names: Notation) -> str:
    """Return the section of a run with derivatives; nothing for any other.

    A tornado chart of each multiplier shows the change of its peak for 1 % more of each parameter:
    the derivative of the peak is that of the multiplier at its time.
    """
    if not run.sensitivity or not run.count:
        return ""
    values = _values(run)
    charts = "".join(_tornado(run, names, i, values) for i in chosen(run.constraints, _CHARTS))
    about = (
        '<p class="hint">To first order, and for each parameter alone. Of a parameter whose value'
        " is 0 there is no percentage.</p>"
    )
    return (
        f'<section id="sensitivities"><h2>Sensitivities</h2>{about}{charts}{_last(run, names)}'
        "</section>"
    )


def sensitivity_contents(run: RunFile) -> list[tuple[str, str]]:
    """Return the entry in the table of contents."""
    return [("sensitivities", "Sensitivities")] if run.sensitivity and run.count else []


def _values(run: RunFile) -> Array:
    """Return the values of the parameters and initial values of the derivatives, SI."""
    known = {**run.record.parameters, **run.initial}
    return np.array([known[name] for name in run.sensitivity])


def _tornado(run: RunFile, names: Notation, constraint: int, values: Array) -> str:
    """Return the tornado chart of the peak of a multiplier."""
    peak, when, slopes = 0.0, 0.0, np.zeros(len(run.sensitivity))
    for block in run.blocks(("time", "multipliers", "dmultipliers")):
        found = np.nan_to_num(block["multipliers"][:, constraint])
        if not len(found):
            continue
        place = int(np.argmax(np.abs(found)))
        if abs(found[place]) > peak:
            peak, when = float(abs(found[place])), float(block["time"][place])
            slopes = np.sign(found[place]) * block["dmultipliers"][place, constraint]
    changes = 0.01 * np.abs(values) * slopes
    largest = np.abs(changes).max(initial=0.0)
    column = ColumnName("multipliers", run.constraints[constraint])
    stated = unit_of_column(column, run.record.units)
    rows = []
    for i in sorted(range(len(values)), key=lambda i: -abs(changes[i])):
        name = run.sensitivity[i]
        rows.append(
            [
                escape(name),
                _bar(changes[i] / largest) if changes[i] else "",
                number(float(changes[i])) if values[i] else "",
                number(float(slopes[i])),
                f"{number(float(values[i]))} {unit(_unit(run, name))}".rstrip(),
            ]
        )
    shown = unit(stated)
    title = f"Peak of |{escape(label(column, names))}|, {number(peak)} {shown}".rstrip()
    head = ["Parameter", "", "Change for +1 %" + (f" [{shown}]" if shown else "")]
    head += ["Derivative, SI", "Value"]
    return table(f"{title}, at {number(when)} s", head, rows, numeric=(2, 3))


def _bar(part: float) -> str:
    """Return a bar to the right or to the left of the middle."""
    length = _HALF * abs(part)
    start, kind = (_HALF, "up") if part > 0 else (_HALF - length, "down")
    return (
        f'<svg class="tornado" viewBox="0 0 {2 * _HALF:g} {_HEIGHT}" width="{2 * _HALF:g}"'
        f' height="{_HEIGHT}" aria-hidden="true"><rect class="{kind}" x="{start:.4g}" y="1"'
        f' width="{length:.4g}" height="{_HEIGHT - 2}"/><path d="M{_HALF:g} 0V{_HEIGHT}"/></svg>'
    )


def _last(run: RunFile, names: Notation) -> str:
    """Return the derivatives of the coordinates at the last sample."""
    last = run.columns(("time", "q", "dq"), np.array([run.count - 1], dtype=np.intp))
    places: Sequence[int] = chosen(run.coordinates, _COORDINATES)
    rows = [
        [
            escape(label(ColumnName("q", "", run.coordinates[j]), names)),
            unit(run.record.units.get(run.coordinates[j])),
            number(float(last["q"][0, j])),
            *(number(float(x)) for x in last["dq"][0, j]),
        ]
        for j in places
    ]
    head = ["Coordinate", "Unit", "Value", *(f"by {escape(x)}" for x in run.sensitivity)]
    caption = f"Coordinates at t = {number(float(last['time'][0]))} s, and their derivatives, SI"
    return table(caption, head, rows, numeric=range(2, len(head)))


def _unit(run: RunFile, name: str) -> str | None:
    """Return the unit of a parameter or of an initial value."""
    base = name.removesuffix("'")
    stated = run.record.units.get(base)
    if base == name or not stated:
        return stated
    return "1/s" if stated == "1" else f"{stated}/s"
