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
    nested: str = "",
) -> list[str]:
    """Break a formula into lines.

    Parameters
    ----------
    tokens : sequence of str and Break
    measure : function of str
        Function that returns the width of a piece.
    first, following : float
        Widths of the first line and of the others.
    nested : str
        What a line begins with for each bracket that is open there.

    Returns
    -------
    list of str
        Lines within the widths, except for pieces without a break that are longer.
    """
    layout = _Layout(tokens, measure, first, following, nested)
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
        nested: str,
    ):
        self.nested, self.indentation = nested, measure(nested)
        self.pieces: list[str] = [""]
        self.breaks: list[Break] = []
        for token in tokens:
            if isinstance(token, Break):
                self.pieces.append("")
                self.breaks.append(token)
            else:
                self.pieces[-1] += token
        self._measured(measure)
        self._keep_brackets_whole(following)
        self._measured(measure)
        self.room, self.following = first, following
        self.found, self.used = [""], 0.0
        self.begun = False  # whether the line holds more than its indentation

    def _measured(self, measure: Callable[[str], float]) -> None:
        """Measure the pieces and the spaces between them."""
        self.spaces = [measure(x.space) for x in self.breaks]
        widths = map(measure, self.pieces)
        steps = [x + y for x, y in zip(widths, [*self.spaces, 0.0], strict=True)]
        self.ends = [0.0, *accumulate(steps)]  # with the space that follows

    def _keep_brackets_whole(self, following: float) -> None:
        """Drop the breaks inside brackets that fit on a line with what they are attached to."""
        dropped: set[int] = set()
        begun: list[int] = []
        found: list[tuple[float, int, int, float]] = []
        for i, piece in enumerate(self.pieces):
            for char in piece:
                if char in "([{":
                    begun.append(i)
                elif char in ")]}" and begun:
                    first = begun.pop()
                    if first < i:
                        room = following - len(begun) * self.indentation
                        found.append((self._width(first, i), first, i, room))
        for _, first, last, room in sorted(found):
            start, end = first, last
            while start - 1 in dropped:
                start -= 1
            while end in dropped:
                end += 1
            if self._width(start, end) <= room:
                dropped.update(range(first, last))
        pieces, breaks = [self.pieces[0]], []
        for i, (at, piece) in enumerate(zip(self.breaks, self.pieces[1:], strict=True)):
            if i in dropped:
                pieces[-1] += at.space + piece
            else:
                pieces.append(piece)
                breaks.append(at)
        self.pieces, self.breaks = pieces, breaks

    def _width(self, start: int, end: int) -> float:
        """Return the width of pieces, including the last one."""
        trailing = self.spaces[end] if end < len(self.spaces) else 0.0
        return self.ends[end + 1] - self.ends[start] - trailing

    def _newline(self) -> None:
        text = "".join(self.found)
        level = sum(map(text.count, "([{")) - sum(map(text.count, ")]}"))
        self.found.append(self.nested * level)
        self.room, self.used = self.following, level * self.indentation
        self.begun = False

    def place(self, start: int, end: int, space: str, gap: float, full: float = 1 / 3) -> bool:
        """Append pieces to the lines; return whether they were broken.

        Pieces that must be broken anyway begin on a line that is used up to the share ``full``.
        """
        wanted = self._width(start, end)
        begun = self.begun
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
            self.begun = True
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
