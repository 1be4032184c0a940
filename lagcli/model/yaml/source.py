"""Text that knows its lines: where a node and each character of its value stand in the file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from lagcli.errors import SourceLocation
from lagcli.model.spelling import shorten

_BREAK = re.compile("\r\n|[\n\r\x85\u2028\u2029]")  # what ends a line of YAML 1.1

Place = tuple[int, int]  # line and column, both from 0


class Source:
    """A text with a name, able to say where a place in it lies.

    Parameters
    ----------
    text : str
    path : str
        What the reader knows the text by.
    numbered : bool
        False for text from the command line, which has no line numbers to show.
    """

    def __init__(self, text: str, path: str, numbered: bool = True):
        self.text = text
        self.path = path
        self.numbered = numbered
        self.lines = _BREAK.split(text)

    def location(self, line: int, column: int, length: int = 1) -> SourceLocation:
        """Return the place at a line and column that count from 0."""
        text = self.lines[line] if line < len(self.lines) else ""
        number = line + 1 if self.numbered else 0
        return SourceLocation(self.path, number, column + 1, max(1, length), text)

    def between(self, start: Place, end: Place) -> str:
        """Return the text from a place up to another, on one line."""
        (line, column), (last, stop) = start, end
        if line == last:
            return self.lines[line][column:stop]
        middle = self.lines[line + 1 : last]
        parts = [self.lines[line][column:], *middle, self.lines[last][:stop]]
        return " ".join(p.strip() for p in parts)


@dataclass(eq=False, slots=True)
class YamlNode:
    """A YAML node with its place: lines and columns count from 0."""

    source: Source
    start: Place
    end: Place

    @property
    def what(self) -> str:
        """Say what the node is, for messages."""
        raise NotImplementedError

    @property
    def location(self) -> SourceLocation:
        """The place of the whole node (of its first line, if it has several)."""
        return _stretch(self.source, self.start, self.end)


@dataclass(eq=False, slots=True)
class Scalar(YamlNode):
    """A scalar; ``value`` is its text, ``style`` one of YAML's ``' " | >`` or None (plain)."""

    value: str
    style: str | None = None
    _places: list[Place] | None = field(default=None, repr=False)

    @property
    def what(self) -> str:
        """Say what the scalar is, for messages."""
        return f"`{shorten(self.value)}`" if self.value.strip() else "nothing"

    @property
    def missing(self) -> bool:
        """Whether nothing stands there, or YAML's word for nothing."""
        text = self.value.strip()
        return not text or (self.style is None and text in ("~", "null", "Null", "NULL"))

    @property
    def location(self) -> SourceLocation:
        """The place of the value; of its first line, if it has several."""
        if self.style in ("|", ">"):
            return self.span(0, len(self.value))
        return _stretch(self.source, self.start, self.end)

    def span(self, start: int, end: int) -> SourceLocation:
        """Return the place of ``value[start:end]`` in the file."""
        if self._places is None:
            self._places = character_places(self.source.lines, self.start, self.style, self.value)
        size = len(self.value.rstrip())
        if not self._places or not size:
            return _stretch(self.source, self.start, self.end)
        if start >= size:
            line, column = self._places[size - 1]
            return self.source.location(line, column + 1)
        last_line, last_column = self._places[max(start, min(end, size) - 1)]
        return _stretch(self.source, self._places[start], (last_line, last_column + 1))


@dataclass(eq=False, slots=True)
class Sequence(YamlNode):
    """A YAML sequence."""

    items: list[YamlNode]

    @property
    def what(self) -> str:
        """Say what the node is, for messages."""
        return "a list"


@dataclass(eq=False, slots=True)
class Mapping(YamlNode):
    """A YAML mapping with scalar keys, in the order of the file."""

    entries: dict[str, tuple[Scalar, YamlNode]]

    @property
    def what(self) -> str:
        """Say what the node is, for messages."""
        return "a mapping"

    def __iter__(self) -> Iterator[tuple[str, Scalar, YamlNode]]:
        """Yield name, key node and value node."""
        return ((name, key, value) for name, (key, value) in self.entries.items())


def _stretch(source: Source, start: Place, end: Place) -> SourceLocation:
    line, column = start
    width = len(source.lines[line]) if line < len(source.lines) else 0
    last = end[1] if end[0] == line else width
    return source.location(line, column, last - column)


_ESCAPE = {"x": 4, "u": 6, "U": 10}  # characters of a double-quoted escape; all others have 2


def character_places(lines: list[str], start: Place, style: str | None, value: str) -> list[Place]:
    """Return the line and column of each character of a scalar's value.

    Walks through the file along the value. Between the two lie quotes, escapes, indentation and
    folded line breaks; where the walk loses its way, the list is empty.
    """
    line, column = start
    if style in ("|", ">"):
        line, column = line + 1, 0
    elif style is not None:
        column += 1
    places: list[Place] = []
    while len(places) < len(value):
        char = value[len(places)]
        if line >= len(lines):
            return []
        text = lines[line]
        if style == '"' and text[column : column + 1] == "\\":
            if column + 1 == len(text):  # an escaped line break joins two lines
                line, column = line + 1, 0
                line, column, _ = _blanks(lines, line, column)
            else:
                places.append((line, column))
                column += _ESCAPE.get(text[column + 1], 2)
            continue
        if char.isspace() or (style in ("|", ">") and not places):
            line, column, run = _blanks(lines, line, column)
            count = len(value) - len(places) - len(value[len(places) :].lstrip())
            breaks = sum(at >= len(lines[on]) for on, at in run)
            if style == '"':  # an escaped blank may follow: count what the file's blanks give
                count = min(count, max(1, breaks - 1) if breaks else len(run))
            if count and not run:
                return []
            places.extend(run[min(i, len(run) - 1)] for i in range(count))
            if char.isspace():
                continue
            text = lines[line] if line < len(lines) else ""
        if text[column : column + 1] != char:
            return []
        places.append((line, column))
        column += 2 if style == "'" and char == "'" else 1
    return places


def _blanks(lines: list[str], line: int, column: int) -> tuple[int, int, list[Place]]:
    """Skip blanks and line ends; return the place after them, and theirs."""
    run: list[Place] = []
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
