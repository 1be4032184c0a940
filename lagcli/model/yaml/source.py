"""Source text, and YAML nodes with the source positions of their characters."""

from __future__ import annotations

import re
from collections.abc import Iterator

from lagcli.errors import SourceLocation
from lagcli.model.spelling import shorten

#: What YAML excludes, listed: the complement of what it allows takes ten times as long to compile.
NOT_TEXT = "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x86-\x9f\ud800-\udfff\ufffe\uffff]"

_BREAK = re.compile("\r\n|[\n\r\x85]|[\u2028\u2029]")  # line breaks of YAML 1.1

Position = tuple[int, int]  # line and column, both from 0


class Source:
    """A named text with line and column positions.

    Parameters
    ----------
    text : str
    path : str
        Name of the text in messages.
    numbered : bool
        False for text from the command line, which has no line numbers.
    """

    def __init__(self, text: str, path: str, numbered: bool = True):
        self.text = text
        self.path = path
        self.numbered = numbered
        self.lines = _BREAK.split(text)

    def location(self, line: int, column: int, length: int = 1) -> SourceLocation:
        """Return the location at a 0-based line and column."""
        text = self.lines[line] if line < len(self.lines) else ""
        number = line + 1 if self.numbered else 0
        return SourceLocation(self.path, number, column + 1, max(1, length), text)

    def between(self, start: Position, end: Position) -> str:
        """Return the text between two positions, joined to one line."""
        (line, column), (last, stop) = start, end
        if line == last:
            return self.lines[line][column:stop]
        middle = self.lines[line + 1 : last]
        parts = [self.lines[line][column:], *middle, self.lines[last][:stop]]
        return " ".join(p.strip() for p in parts)


class YamlNode:
    """A YAML node with its positions; lines and columns count from 0."""

    __slots__ = ("end", "source", "start")

    def __init__(self, source: Source, start: Position, end: Position):
        self.source, self.start, self.end = source, start, end

    @property
    def what(self) -> str:
        """Description of the node for messages."""
        raise NotImplementedError

    @property
    def location(self) -> SourceLocation:
        """The location of the whole node; of its first line, if it has several."""
        return _location_of(self.source, self.start, self.end)


class Scalar(YamlNode):
    """A YAML scalar; ``value`` is its text, ``style`` one of ``' " | >`` or None (plain)."""

    __slots__ = ("_positions", "style", "value")

    def __init__(
        self, source: Source, start: Position, end: Position, value: str, style: str | None = None
    ):
        self.source, self.start, self.end = source, start, end
        self.value, self.style = value, style
        self._positions: list[Position] | None = None

    @property
    def what(self) -> str:
        """Description of the scalar for messages."""
        return f"`{shorten(self.value)}`" if self.value.strip() else "nothing"

    @property
    def missing(self) -> bool:
        """Whether the value is empty or null."""
        text = self.value.strip()
        return not text or (self.style is None and text in ("~", "null", "Null", "NULL"))

    @property
    def location(self) -> SourceLocation:
        """The location of the value; of its first line, if it has several."""
        if self.style in ("|", ">"):
            return self.span(0, len(self.value))
        return _location_of(self.source, self.start, self.end)

    def span(self, start: int, end: int) -> SourceLocation:
        """Return the location of ``value[start:end]`` in the file."""
        if self._positions is None:
            self._positions = character_positions(
                self.source.lines, self.start, self.style, self.value
            )
        size = len(self.value.rstrip())
        if not self._positions or not size:
            return _location_of(self.source, self.start, self.end)
        if start >= size:
            line, column = self._positions[size - 1]
            return self.source.location(line, column + 1)
        last_line, last_column = self._positions[max(start, min(end, size) - 1)]
        return _location_of(self.source, self._positions[start], (last_line, last_column + 1))


class Derived(Scalar):
    """A scalar that is not in the file: it is located where what it was made from is.

    Parameters
    ----------
    value : str
    place : SourceLocation
    made_from : YamlNode
        Node of the file.
    parts : tuple of (start, Scalar, offset)
        Which of its characters are in the file: ``value[start:]`` begins as
        ``scalar.value[offset:]`` does, up to the end of the scalar.
    """

    __slots__ = ("parts", "place")

    def __init__(
        self,
        value: str,
        place: SourceLocation,
        made_from: YamlNode,
        parts: tuple[tuple[int, Scalar, int], ...] = (),
    ):
        super().__init__(made_from.source, made_from.start, made_from.end, value)
        self.place, self.parts = place, parts

    @property
    def location(self) -> SourceLocation:
        """The location of what it was made from."""
        return self.place

    def span(self, start: int, end: int) -> SourceLocation:
        """Return the location of ``value[start:end]`` in the file, if it is there."""
        for first, scalar, offset in self.parts:
            length = len(scalar.value) - offset
            if first <= start and end <= first + length:
                return scalar.span(start - first + offset, end - first + offset)
        return self.place


class Sequence(YamlNode):
    """A YAML sequence."""

    __slots__ = ("items",)

    def __init__(self, source: Source, start: Position, end: Position, items: list[YamlNode]):
        self.source, self.start, self.end, self.items = source, start, end, items

    @property
    def what(self) -> str:
        """Description of the node for messages."""
        return "a list"


class Mapping(YamlNode):
    """A YAML mapping with scalar keys, in the order of the file."""

    __slots__ = ("entries",)

    def __init__(
        self,
        source: Source,
        start: Position,
        end: Position,
        entries: dict[str, tuple[Scalar, YamlNode]],
    ):
        self.source, self.start, self.end, self.entries = source, start, end, entries

    @property
    def what(self) -> str:
        """Description of the node for messages."""
        return "a mapping"

    def __iter__(self) -> Iterator[tuple[str, Scalar, YamlNode]]:
        """Yield name, key node and value node."""
        return ((name, key, value) for name, (key, value) in self.entries.items())


def _location_of(source: Source, start: Position, end: Position) -> SourceLocation:
    line, column = start
    width = len(source.lines[line]) if line < len(source.lines) else 0
    last = end[1] if end[0] == line else width
    return source.location(line, column, last - column)


_ESCAPE = {"x": 4, "u": 6, "U": 10}  # characters of a double-quoted escape; all others have 2


def character_positions(
    lines: list[str], start: Position, style: str | None, value: str
) -> list[Position]:
    """Return the line and column of each character of a scalar's value.

    Walks through the source and the value in parallel, across quotes, escapes, indentation and
    folded line breaks. The list is empty if the two cannot be matched.
    """
    line, column = start
    if style in ("|", ">"):
        line, column = line + 1, 0
    elif style is not None:
        column += 1
    positions: list[Position] = []
    while len(positions) < len(value):
        char = value[len(positions)]
        if line >= len(lines):
            return []
        text = lines[line]
        if style == '"' and text[column : column + 1] == "\\":
            if column + 1 == len(text):  # an escaped line break joins two lines
                line, column = line + 1, 0
                line, column, _ = _blanks(lines, line, column)
            else:
                positions.append((line, column))
                column += _ESCAPE.get(text[column + 1], 2)
            continue
        if char.isspace() or (style in ("|", ">") and not positions):
            line, column, run = _blanks(lines, line, column)
            count = len(value) - len(positions) - len(value[len(positions) :].lstrip())
            breaks = sum(at >= len(lines[on]) for on, at in run)
            if style == '"':  # an escaped blank may follow: count the source's blanks only
                count = min(count, max(1, breaks - 1) if breaks else len(run))
            if count and not run:
                return []
            positions.extend(run[min(i, len(run) - 1)] for i in range(count))
            if char.isspace():
                continue
            text = lines[line] if line < len(lines) else ""
        if text[column : column + 1] != char:
            return []
        positions.append((line, column))
        column += 2 if style == "'" and char == "'" else 1
    return positions


def _blanks(lines: list[str], line: int, column: int) -> tuple[int, int, list[Position]]:
    """Skip blanks and line breaks; return the position after them, and their positions."""
    run: list[Position] = []
    while line < len(lines):
        if column >= len(lines[line]):
            run.append((line, column))
            line, column = line + 1, 0
        elif lines[line][column] in " \t":
            run.append((line, column))
            column += 1
        else:
            break
    return line, column, run
