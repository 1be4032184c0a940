"""Description of a sweep file, as a dict and as text."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from lagcli.column_units import NOT_STATED
from lagcli.prose import counted
from lagcli.results.listing import entry, file_size, number, pairs
from lagcli.sweeps.columns import Column
from lagcli.sweeps.file.store import SLAB, SweepFile, open_sweep

#: Columns of the labels.
LABEL = 14
#: Probabilities of the quantiles.
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_LONGEST = 120  # largest number of characters of the description of one varied quantity


def describe_sweep(path: str | os.PathLike[str], *, quantiles: bool = False) -> dict[str, Any]:
    """Return the description of a sweep file as JSON values.

    Parameters
    ----------
    path : str or path
        A file written by ``lagcli sweep``.
    quantiles : bool
        Whether each column has its quantiles too.

    Returns
    -------
    dict
        ``path``, ``bytes``, ``kind``, ``schema_version``, ``lagcli_version``, ``model_path``,
        ``model_sha256``; ``rows`` (by status), ``failures`` (by cause); ``columns`` and
        ``measures``, each with ``name``, ``unit``, ``min`` and ``max``, and ``quantiles`` by
        probability; ``vary``, ``sample``, ``zip``; ``samples`` kept of each row; ``units`` by name;
        ``parameters`` in SI, and as they were ``given`` in other units; ``options``, ``seconds``.

    Raises
    ------
    FileError
        The file is missing, damaged, or not a sweep.
    """
    with open_sweep(path) as file:
        facts = file.facts
        plan = facts["sweep"]["plan"]
        return {
            "path": os.fspath(path),
            "bytes": os.path.getsize(path),
            **{
                key: facts[key]
                for key in (
                    *("kind", "schema_version", "lagcli_version", "model_path", "model_sha256"),
                    *("rows", "failures"),
                )
            },
            "columns": [_described(file, c, quantiles) for c in file.columns],
            "measures": [_described(file, c, quantiles) for c in file.measures],
            **{key: plan[key] for key in ("vary", "sample", "zip")},
            "samples": len(file.times) if file.kept else 0,
            "units": facts["units"],
            "given": facts["display"].get("given", {}),
            **{key: facts[key] for key in ("parameters", "options", "seconds")},
        }


def _described(file: SweepFile, column: Column, quantiles: bool) -> dict[str, Any]:
    """Return name, unit, extremes and quantiles of a column; None if no row has a value."""
    low, high, pieces = np.nan, np.nan, [np.empty(0)]
    for start in range(0, file.length, SLAB):
        values = file.read(column.dataset, slice(start, start + SLAB))
        low = np.fmin(low, np.fmin.reduce(values))
        high = np.fmax(high, np.fmax.reduce(values))
        if quantiles:
            pieces.append(values[np.isfinite(values)])
    known = {k: None if np.isnan(x) else float(x) for k, x in (("min", low), ("max", high))}
    described = {**column._asdict(), **known}
    if quantiles:
        every = np.concatenate(pieces)
        found = np.quantile(every, QUANTILES).tolist() if every.size else [None] * len(QUANTILES)
        described["quantiles"] = {f"{p:g}": x for p, x in zip(QUANTILES, found, strict=True)}
    return described


def format_sweep(info: Mapping[str, Any], columns: int) -> str:
    """Return the text that ``lagcli info`` prints for a sweep file, with a given line width."""
    _entry = partial(entry, width=LABEL, columns=columns)
    rows = info["rows"]
    lines = _entry(
        "file",
        f"{info['path']}: sweep, HDF5, {file_size(info['bytes'])}, lagcli"
        f" {info['lagcli_version']}, layout {info['schema_version']}",
    )
    lines += _entry("model", f"{info['model_path']} (sha256 {info['model_sha256'][:12]}…)")
    statuses = ", ".join(f"{count} {status}" for status, count in rows.items())
    lines += _entry("rows", f"{sum(rows.values())}: {statuses}")
    for cause, count in info["failures"].items():
        lines += _entry("  failed", f"{count}: {cause}")
    how = "together" if info["zip"] else "all combinations"
    varied = "; ".join(x if len(x) <= _LONGEST else f"{x[:_LONGEST]}…" for x in info["vary"])
    lines += _entry("varied", varied + (f" ({how})" if info["vary"][1:] else ""))
    for names, drawn in info["sample"].items():
        lines += _entry(
            "drawn",
            f"{names}: {counted(drawn['points'], 'point')}, {drawn['kind']}, seed {drawn['seed']}",
        )
    if info["samples"]:
        lines += _entry("kept", f"trajectories of {counted(info['samples'], 'sample')}")
    lines += _entry("parameters", pairs(info["parameters"], info["units"], info["given"]))
    lines += _entry("options", pairs(info["options"]))
    lines += _entry("seconds", pairs(info["seconds"]))
    table = [*info["columns"], *info["measures"]]
    width = max([16, *(len(_title(x)) for x in table)])

    def row(first: str, *values: str) -> str:
        return f"{first:<{width}}" + "".join(f"  {text:>13}" for text in values)

    lines += ["", row("column", "min", "max")]
    lines += [row(_title(x), number(x["min"]), number(x["max"])) for x in table]
    if any("quantiles" in x for x in table):
        lines += ["", row("quantiles", *(f"{100 * p:g} %" for p in QUANTILES))]
        lines += [row(_title(x), *map(number, x["quantiles"].values())) for x in table]
    return "\n".join(lines)


def _title(column: Mapping[str, Any]) -> str:
    unit = column["unit"]
    return column["name"] + ("" if unit == NOT_STATED else f" [{unit}]")
