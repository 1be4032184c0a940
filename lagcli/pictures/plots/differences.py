"""Differences between runs, for legends."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from lagcli.pictures.plots.curves import Catalogue, look_of_value, pretty_unit, raw
from lagcli.pictures.run_file import RunFile

_DIGITS = 4
_MOST = 3  # names in a label


def labels_of(runs: Sequence[RunFile]) -> tuple[list[str], list[float] | None, str]:
    """Return a label for each run, and values if a single number distinguishes the runs.

    Parameters
    ----------
    runs : sequence of Run

    Returns
    -------
    labels : list of str
        For matplotlib. By the parameters that differ; otherwise by initial values, by options, or
        by file names.
    values : list of float or None
        Values of the differing parameter; of several, the one with the most values.
    name : str
        Label of that parameter with its unit, and of the others that differ.
    """
    if len(runs) < 2:
        return [""] * len(runs), None, ""
    tables = [dict(run.varied or run.record.parameters) for run in runs]
    differing = _differing(tables)
    notation = Catalogue(runs[0]).notation
    units = {name: pretty_unit(unit) for name, unit in runs[0].record.units.items()}
    looks = {name: look_of_value(notation, name) for name in differing}
    if differing:
        labels = [
            ", ".join(
                f"{looks[name]} = {table[name]:.{_DIGITS}g} {_written(units.get(name))}".rstrip()
                for name in _chosen(differing, tables)
                if name in table
            )
            for table in tables
        ]
        complete = [name for name in differing if all(name in table for table in tables)]
        if not complete:
            return _unique(labels, runs), None, ""
        name = max(complete, key=lambda name: len({table[name] for table in tables}))
        unit = _written(units.get(name))
        titled = f"{looks[name]} [{unit}]" if unit else looks[name]
        others = [looks[x] for x in differing if x != name]
        if others:
            titled += f" ({', '.join(others[:_MOST])} var{'ies' if len(others) == 1 else 'y'} too)"
        return _unique(labels, runs), [table[name] for table in tables], titled
    starts = [dict(run.initial) for run in runs]
    chosen = _differing(starts)
    if chosen and len(chosen) <= _MOST:
        labels = [
            ", ".join(
                f"{look_of_value(notation, name)}(0) = {start.get(name, math.nan):.{_DIGITS}g}"
                for name in chosen
            )
            for start in starts
        ]
        return _unique(labels, runs), None, ""
    options = [{k: str(v) for k, v in run.record.options.items()} for run in runs]
    chosen = _differing(options)[:_MOST]
    labels = [", ".join(f"{raw(k)} = {raw(o[k])}" for k in chosen if k in o) for o in options]
    return _unique(labels, runs), None, ""


def _written(unit: str | None) -> str:
    """Return a unit as it stands behind a number: none of a pure number."""
    return "" if unit in (None, "1") else str(unit)


def _differing(tables: Sequence[dict[str, float]] | Sequence[dict[str, str]]) -> list[str]:
    names = dict.fromkeys(name for table in tables for name in table)
    return [name for name in names if len({table.get(name) for table in tables}) > 1]


def _chosen(differing: list[str], tables: Sequence[dict[str, float]]) -> list[str]:
    """Return the smallest number of leading names that distinguish all runs."""
    for count in range(1, len(differing) + 1):
        seen = {tuple(table.get(name) for name in differing[:count]) for table in tables}
        if len(seen) == len(tables):
            return differing[:count]
    return differing[:_MOST]


def _unique(labels: list[str], runs: Sequence[RunFile]) -> list[str]:
    """Return the labels, with file names added if two are equal."""
    if len(set(labels)) == len(labels) and all(labels):
        return labels
    stems = [Path(run.name).stem for run in runs]
    if len(set(stems)) < len(stems):
        stems = [run.name for run in runs]
    return [
        f"{label} ({raw(stem)})" if label else raw(stem)
        for label, stem in zip(labels, stems, strict=True)
    ]
