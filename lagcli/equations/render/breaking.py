"""Line breaking of long formulas."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

LAST_RESORT = 100  # added to the depth of breaks between factors
SHORT = 150  # added to the depth of breaks in a bracket that is short


@dataclass(frozen=True)
class Break:
    """A possible line break; breaks of lower depth are preferred."""

    depth: int
    space: str = " "


Token = str | Break


def with_break_penalty(tokens: Sequence[Token]) -> list[Token]:
    """Return tokens with breaks of lower preference than those between factors."""
    return [Break(x.depth + SHORT, x.space) if isinstance(x, Break) else x for x in tokens]


def lines(
    tokens: Sequence[Token],
    measure: Callable[[str], float],
    first: float,
    following: float,
) -> list[str]:
    """Break a formula into lines.

    Parameters
    ----------
    tokens : sequence of str and Break
    measure : function of str
        Function that returns the width of a piece.
    first, following : float
        Widths of the first line and of the others.

    Returns
    -------
    list of str
        Lines within the widths, except for pieces without a break that are longer.
    """
    pieces: list[str] = [""]
    breaks: list[Break] = []
    for token in tokens:
        if isinstance(token, Break):
            pieces.append("")
            breaks.append(token)
        else:
            pieces[-1] += token
    widths = [measure(p) for p in pieces]
    spaces = [measure(b.space) for b in breaks]
    found: list[str] = []
    start, room = 0, first
    while True:
        total, ends = widths[start], [start]
        for i in range(start, len(breaks)):
            total += spaces[i] + widths[i + 1]
            if total > room:
                break
            ends.append(i + 1)
        if ends[-1] == len(pieces) - 1:
            found.append(_joined(pieces, breaks, start, len(pieces) - 1))
            return found
        end = _best(ends, breaks, widths, spaces, room, following)
        found.append(_joined(pieces, breaks, start, end))
        start, room = end + 1, following


def _best(
    ends: Sequence[int],
    breaks: Sequence[Break],
    widths: Sequence[float],
    spaces: Sequence[float],
    room: float,
    following: float,
) -> int:
    """Return the index of the last piece of a line.

    This is the last of the best breaks, unless the line would be nearly empty and the next part
    would have to be broken anyway.
    """
    used, total = {}, 0.0
    for i in ends:
        total += widths[i] + (spaces[i - 1] if i > ends[0] else 0)
        used[i] = total
    for depth in sorted({breaks[i].depth for i in ends}):
        last = max(i for i in ends if breaks[i].depth == depth)
        if used[last] >= room / 3:
            return last
        term = widths[last + 1]
        for i in range(last + 1, len(breaks)):
            if breaks[i].depth <= depth or term > following:
                break
            term += spaces[i] + widths[i + 1]
        if term <= following:
            return last
    return ends[-1]


def _joined(pieces: Sequence[str], breaks: Sequence[Break], start: int, end: int) -> str:
    parts = [pieces[start]]
    for i in range(start, end):
        parts += [breaks[i].space, pieces[i + 1]]
    return "".join(parts)
