"""Entries of what `info` prints: a label, and a text that is wrapped beside it."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

WIDTH = 100


def number(value: Any, digits: int = 6) -> str:
    """Return a number as people read it; a dash for none."""
    if value is None:
        return "-"
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value)


def pairs(values: Mapping[str, Any], units: Mapping[str, str] | None = None) -> str:
    """Return ``name = value unit`` for each entry."""
    shown = (f"{name} = {number(x)} {(units or {}).get(name, '')}" for name, x in values.items())
    return ", ".join(map(str.rstrip, shown))


def entry(label: str, text: str, width: int) -> list[str]:
    """Return a label of some width with its text, wrapped and indented; nothing for no text."""
    text = "".join(c if c.isprintable() or c.isspace() else "�" for c in text)
    lines = textwrap.wrap(text, WIDTH - width, break_on_hyphens=False)
    labels = [label] + [""] * len(lines)
    return [f"{left:<{width}}{line}" for left, line in zip(labels, lines, strict=False)]
