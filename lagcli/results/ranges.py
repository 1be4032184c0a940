"""Ranges of quantities along a run as text: one line per quantity, or per family of quantities."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from operator import itemgetter
from typing import Any, NamedTuple

from lagcli.results.listing import number

_INDEX = re.compile(r"\d+(?=[^\[\]]*\])")
#: Smallest number of members that are printed as a family.
FAMILY = 3


class ValueRange(NamedTuple):
    """Smallest and largest value of a quantity; None if there is none.

    Parameters
    ----------
    name, unit : str
    low, high : float or None
    low_at, high_at : str
        Where these are: a time, or a member of the family and a time.
    """

    name: str
    unit: str
    low: float | None
    low_at: str
    high: float | None
    high_at: str

    @property
    def label(self) -> str:
        """The name with its unit in brackets."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


def ranges_of(
    extremes: Mapping[str, Mapping[str, Any]],
    units: Mapping[str, str | None],
    time: str = "t",
) -> list[ValueRange]:
    """Return the ranges of quantities from JSON values, one for each family of a common unit.

    Parameters
    ----------
    extremes : mapping
        ``min``, ``max`` and their times, such as ``t_min``, by name; None if there is none.
    units : mapping of str to str
        Units by name.
    time : str
        First part of the keys of the times.
    """
    single = [
        ValueRange(
            name,
            units.get(name) or "",
            *(x["min"], f"{number(x[f'{time}_min'], 4)} s" if x["min"] is not None else ""),
            *(x["max"], f"{number(x[f'{time}_max'], 4)} s" if x["max"] is not None else ""),
        )
        for name, x in extremes.items()
    ]
    return families_of(single)


def families_of(ranges: Iterable[ValueRange]) -> list[ValueRange]:
    """Return ranges with one in place of those of each family."""
    return [_range_of(name, members) for name, members in by_family(ranges)]


def by_family(items: Iterable[Any]) -> list[tuple[str, list[Any]]]:
    """Group items with a ``name`` and a ``unit`` by family.

    Returns
    -------
    list of (str, list)
        The name of the group, ``rod[1..20]`` of a family, and its members, in the order of the
        first ones. Families of fewer than three members, and those of several indices that lack
        some, are not grouped.
    """
    groups: dict[tuple[str, str], list[Any]] = {}
    for x in items:
        groups.setdefault((_INDEX.sub("#", x.name), x.unit), []).append(x)
    families: list[tuple[str, list[Any]]] = []
    for (pattern, _), members in groups.items():
        indices = [[int(i) for i in _INDEX.findall(x.name)] for x in members]
        columns = [sorted(set(column)) for column in zip(*indices, strict=True)]
        if FAMILY <= len(members) == math.prod(map(len, columns)):
            parts = pattern.split("#")
            spans = [*map(span, columns), ""]
            name = "".join(part + span for part, span in zip(parts, spans, strict=True))
            families.append((name, members))
        else:
            families += [(x.name, [x]) for x in members]
    return families


def span(indices: Sequence[int]) -> str:
    """Return increasing indices, with ranges of consecutive ones: 1..4, 6."""
    places = enumerate(indices)
    runs = [[i for _, i in run] for _, run in groupby(places, lambda x: x[1] - x[0])]
    return ", ".join(str(r[0]) if len(r) == 1 else f"{r[0]}..{r[-1]}" for r in runs)


def _range_of(name: str, members: Sequence[ValueRange]) -> ValueRange:
    """Return the range of a family, with the members that have its ends."""
    if len(members) == 1:
        return members[0]
    unit = members[0].unit
    lows = [(x.low, x) for x in members if x.low is not None]
    highs = [(x.high, x) for x in members if x.high is not None]
    if not lows or not highs:
        return ValueRange(name, unit, None, "", None, "")
    low, of_low = min(lows, key=itemgetter(0))
    high, of_high = max(highs, key=itemgetter(0))
    low_at = f"{_member(of_low.name)}, {of_low.low_at}"
    return ValueRange(name, unit, low, low_at, high, f"{_member(of_high.name)}, {of_high.high_at}")


def _member(name: str) -> str:
    """Return a name without its prefix, which the family's name shows: lambda.rod[1] as rod[1]."""
    return name.split(".", 1)[-1]


def range_lines(ranges: Sequence[ValueRange], columns: int, margin: int = 0) -> list[str]:
    """Return ranges as lines of equal columns: ``rod[1..60]  -358 (rod[1], 1.24 s) … -1.7 (…)``.

    Where this is too wide, each end has a line.

    Parameters
    ----------
    ranges : sequence of ValueRange
    columns : int
        Length of the longest line.
    margin : int
        Spaces before each line.
    """
    if not ranges:
        return []
    lows = _cells([(x.low, x.low_at) for x in ranges])
    highs = _cells([(x.high, x.high_at) for x in ranges])
    label = max(len(x.label) for x in ranges)
    before = " " * margin
    if margin + label + 2 + len(lows[0]) + 3 + len(highs[0]) <= columns:
        return [
            f"{before}{x.label:<{label}}  {'-' if x.low is None else f'{low} … {high}'}".rstrip()
            for x, low, high in zip(ranges, lows, highs, strict=True)
        ]
    label = min(label, max(16, columns - margin - 6 - max(len(lows[0]), len(highs[0]))))
    lines = []
    for x, low, high in zip(ranges, lows, highs, strict=True):
        shown = x.label if len(x.label) <= label else x.label[: label - 1] + "…"
        if x.low is None:
            lines.append(f"{before}{shown:<{label}}  -")
            continue
        lines.append(f"{before}{shown:<{label}}  min {low}".rstrip())
        lines.append(f"{before}{'':<{label}}  max {high}".rstrip())
    return lines


def _cells(ends: Sequence[tuple[float | None, str]]) -> list[str]:
    """Return numbers right-aligned, followed by their places, as cells of equal width."""
    numbers = [number(value) for value, _ in ends]
    places = [f" ({at})" if at else "" for _, at in ends]
    width, room = max(map(len, numbers)), max(map(len, places))
    return [f"{n:>{width}}{at:<{room}}" for n, at in zip(numbers, places, strict=True)]
