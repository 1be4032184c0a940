"""Listings in text output: names with values and units, wrapped."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from lagcli.prose import wrapped

#: Width of text that is not written to a terminal.
WIDTH = 100
#: Largest number of entries of a long list, such as one for each coordinate.
_SHOWN = 24
_MEMBER = re.compile(r"([^\[\]]*\[)(\d+)(\].*)", re.DOTALL)


def number(value: Any, digits: int = 6) -> str:
    """Format a number for reading; a dash for None, and true and false as in model files."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value)


def file_size(count: int) -> str:
    """Return a number of bytes in the largest unit in which it is at least one."""
    size = float(count)
    for symbol in ("B", "kB", "MB"):
        if size < 1000:
            return f"{size:.3g} {symbol}"
        size /= 1000
    return f"{size:.3g} GB"


def distinct_numbers(before: float, after: float, digits: int = 6) -> tuple[str, str]:
    """Format two different numbers with at least a number of digits, and enough to distinguish
    them."""
    for n in range(digits, 18):
        shown = f"{before:.{n}g}", f"{after:.{n}g}"
        if shown[0] != shown[1]:
            break
    return shown


def folded(items: Iterable[tuple[str, str]]) -> list[str]:
    """Return names with their suffixes; consecutive members with equal ones as one: x[1..9] [m].

    Parameters
    ----------
    items : iterable of (name, text)
    """
    runs: list[tuple[str, str, int, int]] = []  # before and after the index, first and last
    for name, text in items:
        member = _MEMBER.fullmatch(name)
        if member is None:
            runs.append((name, text, 0, -1))
            continue
        before, index, after = member[1], int(member[2]), member[3] + text
        if runs and runs[-1][:2] == (before, after) and runs[-1][3] == index - 1:
            runs[-1] = (before, after, runs[-1][2], index)
        else:
            runs.append((before, after, index, index))
    shown: list[str] = []
    for before, after, start, end in runs:
        if end < start:
            shown.append(before + after)
        elif end - start < 2:
            shown += [f"{before}{i}{after}" for i in range(start, end + 1)]
        else:
            shown.append(f"{before}{start}..{end}{after}")
    return shown


def pairs(
    values: Mapping[str, Any],
    units: Mapping[str, str] | None = None,
    given: Mapping[str, str] | None = None,
) -> str:
    """Return ``name = value unit`` for each entry; of many, the first ones.

    What was ``given`` in another unit precedes the value: ``omega = 1500 rpm = 157.08 rad/s``.
    """
    units, given = units or {}, given or {}
    shown = folded(
        (name, (f" = {given[name]}" if name in given else "") + _value(x, units.get(name, "")))
        for name, x in values.items()
    )
    return ", ".join(shortened(shown))


def shortened(items: Sequence[str]) -> list[str]:
    """Return items; of many, the first ones and the number of the others."""
    if len(items) <= _SHOWN + 2:
        return list(items)
    return [*items[:_SHOWN], f"… {len(items) - _SHOWN} more (--json)"]


def _value(value: Any, unit: str) -> str:
    return f" = {number(value)}" + (f" {unit}" if unit not in ("", "1") else "")


def entry(label: str, text: str, width: int, columns: int = WIDTH) -> list[str]:
    """Return a label of given width with its text, wrapped and indented; empty for an empty
    text."""
    text = "".join(c if c.isprintable() or c.isspace() else "�" for c in text)
    lines = []
    for line in wrapped(text, columns - width):
        lines += [line[i : i + columns - width] for i in range(0, len(line), columns - width)]
    labels = [label] + [""] * len(lines)
    return [f"{left:<{width}}{line}" for left, line in zip(labels, lines, strict=False)]
