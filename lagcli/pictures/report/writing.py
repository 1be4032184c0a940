"""Numbers, units and tables in HTML."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import TypeVar

_Item = TypeVar("_Item")
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def number(value: float | None, digits: int = 6) -> str:
    """Format a number: −5.15836, 2.4·10⁻⁹; a dash for None."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    mantissa = mantissa.replace("-", "−")
    if not exponent:
        return mantissa
    return f"{mantissa}·10{str(int(exponent)).translate(_RAISED)}"


def unit(text: str | None) -> str:
    """Format a unit: m/s², N m."""
    if not text or text == "1":
        return ""
    shown = re.sub(r"(?:\^|\*\*)(-?\d+)", lambda m: m[1].translate(_RAISED), text)
    return shown.replace("*", " ")


def axis_unit(text: str | None) -> str:
    """Format a unit for an axis: 1 for a number; empty if unknown."""
    return "1" if text == "1" else unit(text)


def table(
    caption: str,
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    numeric: Sequence[int] = (),
    kind: str = "",
) -> str:
    """Return a table that scrolls on a narrow screen.

    Parameters
    ----------
    caption, head : text and texts
        HTML.
    rows : iterable of sequences of str
        HTML; the first cell of a row is its header. Columns without text are omitted.
    numeric : sequence of int
        Indices of numerical columns.
    kind : str
        A class, for the style sheet.
    """
    filled = list(rows)
    wide = [i for i in range(len(head)) if not i or any(row[i] for row in filled)]
    classes = ['class="number"' if i in numeric else "" for i in range(len(head))]
    titles = "".join(f'<th scope="col" {classes[i]}>{head[i]}</th>' for i in wide)
    lines = []
    for row in filled:
        cells = "".join(f"<td {classes[i]}>{row[i]}</td>" for i in wide[1:])
        lines.append(f'<tr><th scope="row">{row[0]}</th>{cells}</tr>')
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(_plain(caption))}">'
        f'<table class="{kind}"><caption>{caption}</caption><thead><tr>{titles}</tr></thead>'
        f"<tbody>{''.join(lines)}</tbody></table></div>"
    )


def chosen(names: Sequence[str], most: int, few: int | None = None) -> list[int]:
    """Return the indices of a limited number of names: of each family the first ones and the last.

    Parameters
    ----------
    names : sequence of str
        Names; members of families are x[1], x[2], ….
    most : int
        Number up to which all names are returned.
    few : int, optional
        Approximate number that is returned otherwise; ``most`` by default.
    """
    if len(names) <= most:
        return list(range(len(names)))
    few = most if few is None else few
    families: dict[str, list[int]] = {}
    for i, name in enumerate(names):
        families.setdefault(name.partition("[")[0], []).append(i)
    share = max(2, few // len(families))
    found = [i for f in families.values() for i in (f if len(f) <= share else _ends(f, share))]
    found = sorted(found)
    return found if len(found) <= most else _ends(found, few)


def elided(places: Sequence[int], items: Sequence[_Item], dots: _Item) -> list[_Item]:
    """Return items with ellipses where their indices have gaps."""
    found: list[_Item] = []
    for n, item in enumerate(items):
        if n and places[n] > places[n - 1] + 1:
            found.append(dots)
        found.append(item)
    return found


def _ends(places: list[int], most: int) -> list[int]:
    return [*places[: most - 1], places[-1]]


def _plain(html: str) -> str:
    return re.sub(r"<[^>]*>", "", html)


def paragraphs(text: str | None) -> str:
    """Return a description: its paragraphs, escaped."""
    blocks = (text or "").strip().split("\n\n")
    return "".join(f"<p>{escape(' '.join(b.split()))}</p>" for b in blocks if b.strip())


def with_code(text: str) -> str:
    """Return a text in HTML, with names in backticks as code."""
    return re.sub("`([^`]+)`", r"<code>\1</code>", escape(text))
