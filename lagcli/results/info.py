"""Description of a result file, as a dict and as text."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import chain, repeat
from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import RESIDUALS, ColumnName, impulse_unit
from lagcli.prose import counted
from lagcli.results.formats import FORMATS, format_of, open_reader
from lagcli.results.listing import (
    WIDTH,
    distinct_numbers,
    entry,
    file_size,
    folded,
    number,
    pairs,
    shortened,
)
from lagcli.results.metadata import KIND, model_name, to_metadata
from lagcli.results.ranges import ValueRange, by_family, families_of, range_lines, ranges_of
from lagcli.trajectory.event_log import event_sentences
from lagcli.trajectory.extremes import Extremes, known

#: Columns of the labels.
LABEL = 20
_TIMES = {"t_min": "time_min", "t_max": "time_max"}


def describe(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the description of a result file as JSON values.

    Parameters
    ----------
    path : str or path
        A file written by `lagcli.results.write`.

    Returns
    -------
    dict
        ``path``, ``format`` (``hdf5`` or ``csv``), ``bytes``, ``kind``, ``schema_version``,
        ``lagcli_version``, ``status``, ``message``, ``model_name``, ``model_sha256``; ``sizes``
        (samples, coordinates, constraints, outputs), the names of ``coordinates``,
        ``constraints``, ``outputs``, and ``units``; ``inputs`` by name (``file``, its ``sha256``,
        ``unit``, ``rows``, times of the ``first`` and the ``last``); ``sensitivity``, what the
        motion is differentiated with respect to; ``events``, what happened at contacts
        and events, as `EventLog.to_mapping` has it; ``time`` (first, last); ``parameters``,
        ``options``, ``counts``, ``seconds``, ``initial_correction``; the largest magnitudes of
        ``residual_position`` and ``residual_velocity`` by constraint (``max``, and ``scaled`` by
        the constraint's own scale), of ``residual_equation``, and of ``energy_balance``
        (``max``, and ``relative`` to the largest \\|T\\| + \\|V\\|); ``conserved`` quantities by
        name (``formula``, ``first`` value and largest ``drift`` from it); ``multipliers`` by
        constraint (``min``, ``max``, ``time_min``, ``time_max``); ``impulses`` of those that have
        some, with their ``sum`` and ``count`` too. What the file does not
        say is None, or empty.

    Raises
    ------
    FileError
        The file is missing, damaged, or not of lagcli.
    UsageError
        The suffix is unknown.
    """
    path = os.fspath(path)
    with open_reader(path) as file:
        extremes = Extremes(file.constraints, file.conserved_names)
        for columns in file.columns(Extremes.COLUMNS):
            extremes.add(columns)
    metadata = to_metadata(file.record)
    model = metadata.pop("model")
    formulas = metadata.pop("conserved_formulas")
    given = metadata.pop("display").get("given", {})
    balance = known(extremes.energy_balance)
    return {
        "path": path,
        "format": format_of(path).name,
        "bytes": os.path.getsize(path),
        "kind": KIND,
        **metadata,
        "given": given,
        "model_name": model_name(model),
        "sizes": {
            "samples": extremes.samples,
            "coordinates": len(file.coordinates),
            "constraints": len(file.constraints),
            "outputs": len(file.outputs),
        },
        "coordinates": list(file.coordinates),
        "constraints": list(file.constraints),
        "outputs": list(file.outputs),
        "inputs": {
            name: {
                "file": table.file or None,
                "sha256": table.sha256 or None,
                "unit": table.unit or None,
                "rows": len(table.times),
                "first": float(table.times[0]),
                "last": float(table.times[-1]),
            }
            for name, table in file.record.inputs.items()
        },
        "sensitivity": list(file.sensitivity),
        "events": None if file.record.events is None else file.record.events.to_mapping(),
        "impulses": {}
        if file.record.events is None
        else {
            name: {_TIMES.get(k, k): x for k, x in impulses.items()}
            for name, impulses in file.record.events.impulses(file.constraints).items()
        },
        "time": {"first": known(extremes.first), "last": known(extremes.last)},
        **{
            q.name: _residuals(
                file.constraints, getattr(extremes, q.name), getattr(file.record, q.scale)
            )
            for q in RESIDUALS
        },
        "residual_equation": known(extremes.residual_equation),
        "energy_balance": {"max": balance, "relative": _ratio(balance, extremes.energy_scale)},
        "conserved": {
            name: {
                "formula": formulas.get(name),
                "first": known(extreme.first),
                "drift": known(extreme.drift),
            }
            for name, extreme in extremes.conserved.items()
        },
        "multipliers": {
            name: {
                "min": known(extreme.low),
                "time_min": known(extreme.low_time),
                "max": known(extreme.high),
                "time_max": known(extreme.high_time),
            }
            for name, extreme in extremes.multipliers.items()
        },
    }


def format_info(info: Mapping[str, Any], columns: int = WIDTH) -> str:
    """Return the text printed by ``lagcli info``.

    Parameters
    ----------
    info : mapping
        Result of `describe`.
    columns : int
        Length of the longest line.

    Returns
    -------
    str
        Lines without a final newline.
    """
    _entry = partial(entry, width=LABEL, columns=columns)
    _table = partial(table, columns=columns)
    sizes, time, units = info["sizes"], info["time"], info["units"]
    balance = info["energy_balance"]
    span = f"{number(time['first'])} to {number(time['last'])} s, " if sizes["samples"] else ""
    digest = f" (sha256 {info['model_sha256'][:12]}…)" if info["model_sha256"] else ""
    writer = f"lagcli {info['lagcli_version']}, " if info["lagcli_version"] else ""
    title = next(f.title for f in FORMATS if f.name == info["format"])
    lines = _entry(
        "file",
        f"{info['path']}: {info['kind']}, {title}, {file_size(info['bytes'])}, "
        f"{writer}layout {info['schema_version']}",
    )
    lines += _entry("status", info["status"] or "not recorded")
    lines += _entry("message", info["message"])
    for warning in info["warnings"]:
        lines += _entry("warning", warning)
    lines += _entry("model", f"{info['model_name'] or 'without a name'}{digest}" if digest else "")
    lines += _entry("time", f"{span}{counted(sizes['samples'], 'sample')}")
    for name in ("coordinates", "constraints", "outputs"):
        shown = folded((n, _unit(units.get(n))) for n in info[name])
        lines += _entry(name, ", ".join(shown) or "none")
    tables = [f"{name} of {_table_of(x)}" for name, x in info["inputs"].items()]
    lines += _entry("inputs", ", ".join(tables))
    if info["sensitivity"]:
        lines += _entry(
            "derivatives", "of q, v and lambda with respect to " + ", ".join(info["sensitivity"])
        )
    lines += _entry("parameters", pairs(info["parameters"], units, info["given"]))
    lines += _entry("options", pairs(info["options"]))
    lines += _entry("atol at end", _by_family(info["tolerances"]))
    lines += _entry("counts", pairs(info["counts"]))
    lines += _entry("seconds", pairs(info["seconds"]))
    moved = [
        f"{n} {' -> '.join(distinct_numbers(*pair))}"
        for n, pair in info["initial_correction"].items()
    ]
    lines += _entry("start adjusted", ", ".join(shortened(moved)))
    lines += _entry("freedom", _freedom(info["freedom"]))
    if info["events"] is not None:
        for what, sentence in zip(
            chain(["events"], repeat("")), event_sentences(info["events"]), strict=False
        ):
            lines += _entry(what, sentence)
    lines += _entry("energy balance", f"{number(balance['max'], 3)} J at worst")
    lines += _entry("  relative", number(balance["relative"], 3))
    lines += _entry("equation residual", f"{number(info['residual_equation'], 3)} at worst")
    formulas = {
        n: x["formula"] for n, x in info["conserved"].items() if x["formula"] not in (n, None)
    }
    lines += _entry("conserved", "; ".join(f"{n} = {x}" for n, x in formulas.items()))
    if info["conserved"]:
        lines += _table(
            ("conserved quantity", "first", "drift"),
            {
                name: [number(extreme["first"]), number(extreme["drift"], 3)]
                for name, extreme in info["conserved"].items()
            },
        )
    if info["constraints"]:
        residuals = _residual_rows(info)
        lines += _table(
            ("constraint residual", "position", "scaled", "velocity", "scaled"), residuals
        )
        lines += ["", "multiplier: min … max", *range_lines(_forces(info), columns)]
    return "\n".join(lines)


class _Residual(NamedTuple):
    """The largest residuals of a constraint: position, scaled, velocity, scaled."""

    name: str
    unit: str
    values: list[float | None]


def _residual_rows(info: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return the largest residuals of each constraint, or of each family of constraints."""
    rows = [
        _Residual(
            name,
            info["units"].get(str(ColumnName("residual_position", name))) or "",
            [info[q.name][name][key] for q in RESIDUALS for key in ("max", "scaled")],
        )
        for name in info["constraints"]
    ]
    shown = {}
    for name, members in by_family(rows):
        columns = zip(*(x.values for x in members), strict=True)
        worst = (max((x for x in column if x is not None), default=None) for column in columns)
        shown[_with_unit(name, members[0].unit)] = [number(x, 3) for x in worst]
    return shown


def _forces(info: Mapping[str, Any]) -> list[ValueRange]:
    """Return the ranges of the multipliers, and of the impulses of contacts."""
    units = {
        name: info["units"].get(str(ColumnName("multipliers", name)))
        for name in info["constraints"]
    }
    impulses = {f"impulse.{name}": x for name, x in info["impulses"].items()}
    impulse_units = {f"impulse.{name}": impulse_unit(units[name]) for name in info["impulses"]}
    return ranges_of(info["multipliers"], units, "time") + ranges_of(
        impulses, impulse_units, "time"
    )


def _by_family(values: Mapping[str, float]) -> str:
    """Return ``name = value`` for each number, or a range for each family."""
    ranges = families_of(ValueRange(name, "", x, "", x, "") for name, x in values.items())
    shown = (
        f"{x.name} = {number(x.low)}" + (f" … {number(x.high)}" if x.high != x.low else "")
        for x in ranges
    )
    return ", ".join(shortened(list(shown)))


def _table_of(table: Mapping[str, Any]) -> str:
    """Return the source of an input's table, and its extent."""
    digest = f" (sha256 {table['sha256'][:12]}…)" if table["sha256"] else ""
    span = f"{number(table['first'])} to {number(table['last'])} s"
    return f"{table['file'] or 'the model'}{digest}, {counted(table['rows'], 'row')}, {span}"


def _with_unit(name: str, unit: str | None) -> str:
    return name + _unit(unit)


def _unit(unit: str | None) -> str:
    return f" [{unit}]" if unit else ""


def _ratio(value: float | None, scale: float | None) -> float | None:
    """Return the value over its scale; None if that is meaningless."""
    if value is None or scale is None or np.isnan(scale):
        return None
    if value == 0:
        return 0.0
    return value / scale if scale else None


def _residuals(
    constraints: Sequence[str], largest: Array, scales: Array
) -> dict[str, dict[str, float | None]]:
    """Return the largest residual of each constraint, absolute and scaled."""
    return {
        name: {"max": known(value), "scaled": _ratio(known(value), float(scale))}
        for name, value, scale in zip(constraints, largest, scales, strict=True)
    }


def _freedom(freedom: Mapping[str, Any]) -> str:
    """Return the sentence on degrees of freedom and redundant constraints."""
    if not freedom:
        return ""
    text = f"{freedom['degrees_of_freedom']}, rank of B {freedom['rank']}"
    for x in freedom["redundant"]:
        text += f"; {x['surplus']} of {', '.join(x['constraints'])} redundant"
    return text


def table(head: tuple[str, ...], rows: Mapping[str, list[str]], columns: int) -> list[str]:
    """Return a table after an empty line: names on the left, numbers right-aligned."""
    lines = [head, *((name, *numbers) for name, numbers in rows.items())]
    cells = [max(len(line[i]) for line in lines) for i in range(1, len(head))]
    roomy = [max(cell, 13) for cell in cells]  # -1.23457e-308
    if sum(roomy) + 2 * len(roomy) + len(head[0]) <= columns:
        cells = roomy
    left = columns - sum(cells) - 2 * len(cells)
    left = max(len(head[0]), min(left, max(len(line[0]) for line in lines)))
    printed = [""]
    for name, *numbers in lines:
        shown = name if len(name) <= left else name[: left - 1] + "…"
        printed.append(
            f"{shown:<{left}}"
            + "".join(f"  {n:>{cell}}" for n, cell in zip(numbers, cells, strict=True))
        )
    return printed
