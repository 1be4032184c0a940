"""Line breaking of long formulas."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate


@dataclass(frozen=True)
class Break:
    """A possible line break.

    Parameters
    ----------
    depth : int
        Level of nesting. Between two breaks of a depth lies a term, a factor or the content of a
        bracket; it is broken only if it is longer than a line.
    space : str
        Text at this position if the line is not broken.
    term : bool
        Whether a term of a sum follows, which starts a line if the previous term was broken.
    """

    depth: int
    space: str = " "
    term: bool = False


Token = str | Break


def flat(tokens: Sequence[Token]) -> str:
    """Return a formula on one line."""
    return "".join(x.space if isinstance(x, Break) else x for x in tokens)


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
    layout = _Layout(tokens, measure, first, following)
    layout.place(0, len(layout.breaks), "", 0.0)
    return layout.found


class _Layout:
    """Lines being filled."""

    def __init__(
        self,
        tokens: Sequence[Token],
        measure: Callable[[str], float],
        first: float,
        following: float,
    ):
        self.pieces: list[str] = [""]
        self.breaks: list[Break] = []
        for token in tokens:
            if isinstance(token, Break):
                self.pieces.append("")
                self.breaks.append(token)
            else:
                self.pieces[-1] += token
        self.spaces = [measure(x.space) for x in self.breaks]
        widths = map(measure, self.pieces)
        steps = [x + y for x, y in zip(widths, [*self.spaces, 0.0], strict=True)]
        self.ends = [0.0, *accumulate(steps)]  # with the space that follows
        self.room, self.following = first, following
        self.found, self.used = [""], 0.0

    def _width(self, start: int, end: int) -> float:
        """Return the width of pieces, including the last one."""
        trailing = self.spaces[end] if end < len(self.spaces) else 0.0
        return self.ends[end + 1] - self.ends[start] - trailing

    def _newline(self) -> None:
        self.found.append("")
        self.room, self.used = self.following, 0.0

    def place(self, start: int, end: int, space: str, gap: float, full: float = 1 / 3) -> bool:
        """Append pieces to the lines; return whether they were broken.

        Pieces that must be broken anyway begin on a line that is used up to the share ``full``.
        """
        wanted = self._width(start, end)
        begun = bool(self.found[-1])
        if self.used + gap * begun + wanted > self.room and begun:
            inside = wanted > self.following and start < end
            if not inside or self.used > self.room * full:
                self._newline()
                begun = False
        if not begun:
            space, gap = "", 0.0
        if self.used + gap + wanted <= self.room or start == end:
            between = [*(x.space for x in self.breaks[start:end]), ""]
            parts = zip(self.pieces[start : end + 1], between, strict=True)
            self.found[-1] += space + "".join(map("".join, parts))
            self.used += gap + wanted
            return False
        depth = min(x.depth for x in self.breaks[start:end])
        cuts = [i for i in range(start, end) if self.breaks[i].depth == depth]
        broken = self.place(start, cuts[0], space, gap)
        for cut, last in zip(cuts, [*cuts[1:], end], strict=True):
            if broken and self.breaks[cut].term:
                self._newline()
            at = self.breaks[cut]
            full = 1 / 3 if at.term else 2 / 3
            broken = self.place(cut + 1, last, at.space, self.spaces[cut], full)
        return True
