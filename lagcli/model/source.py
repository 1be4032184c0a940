"""YAML text → nodes that know their place in it.

Nodes are composed from the parser's events, never constructed into Python values: what a scalar
means is decided by the model language, not by YAML's rules for numbers, booleans and dates.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from dataclasses import dataclass, field

import yaml

from lagcli.errors import Diagnostic, ModelError, SourceLocation

MAX_BYTES = 10_000_000  # a model of 10⁵ lines is a mistake, and must not cost minutes
MAX_DEPTH = 64  # the format needs 4
MAX_NODES = 1_000_000  # aliases counted as often as they are used


class Source:
    """A text with a name, able to say where an offset in it lies.

    Parameters
    ----------
    text : str
    path : str
        What the reader knows the text by.
    numbered : bool
        False for text from the command line, which has no lines to show.
    """

    def __init__(self, text: str, path: str, numbered: bool = True):
        self.text = text
        self.path = path
        self.numbered = numbered
        self.lines = text.splitlines() or [""]

    def location(self, line: int, column: int, length: int = 1) -> SourceLocation:
        """Return the place at a line and column that count from 0."""
        if not self.numbered:
            return SourceLocation(self.path, 0, 0)
        text = self.lines[line] if line < len(self.lines) else ""
        return SourceLocation(self.path, line + 1, column + 1, length, text)


@dataclass
class Node:
    """A YAML node with its place: lines and columns count from 0."""

    source: Source
    line: int
    column: int
    end_line: int
    end_column: int

    @property
    def location(self) -> SourceLocation:
        """The place of the whole node (of its first line, if it has several)."""
        length = self.end_column - self.column if self.end_line == self.line else 1
        return self.source.location(self.line, self.column, max(1, length))

    what = "a node"


@dataclass
class Scalar(Node):
    """A scalar; ``value`` is its text."""

    value: str
    style: str | None
    _places: list[tuple[int, int]] | None = field(default=None, repr=False)

    @property
    def what(self) -> str:
        """Say what the node is, for messages."""
        return f"`{shorten(self.value)}`" if self.value else "nothing"

    def span(self, start: int, end: int) -> SourceLocation:
        """Return the place of ``value[start:end]`` in the file."""
        if self._places is None:
            self._places = self._map_places()
        if not self._places:
            return self.location
        start = min(start, len(self._places) - 1)
        line, column = self._places[start]
        last_line, last_column = self._places[max(start, min(end, len(self._places)) - 1)]
        length = last_column - column + 1 if last_line == line and end > start else 1
        return self.source.location(line, column, max(1, length))

    def _map_places(self) -> list[tuple[int, int]]:
        """Return the line and column of each character of the value.

        The characters of a scalar stand in the file in the same order, with line breaks, quotes
        and indentation between them; where that fails (escapes), the list is empty.
        """
        lines, line, column = self.source.lines, self.line, self.column
        if self.style in ("|", ">"):
            line, column = line + 1, 0
        elif self.style in ("'", '"'):
            column += 1
        places: list[tuple[int, int]] = []
        for char in self.value:
            if char.isspace():
                places.append((line, column))
                continue
            while line < len(lines) and (column >= len(lines[line]) or lines[line][column] != char):
                column += 1
                if column >= len(lines[line]):
                    line, column = line + 1, 0
            if line > self.end_line or line >= len(lines):
                return []
            places.append((line, column))
            column += 1
        return places


@dataclass
class Sequence(Node):
    """A YAML sequence."""

    items: list[Node]
    what = "a list"


@dataclass
class Mapping(Node):
    """A YAML mapping with scalar keys, in the order of the file."""

    entries: dict[str, tuple[Scalar, Node]]
    what = "a mapping"

    def __iter__(self) -> Iterator[tuple[str, Scalar, Node]]:
        """Yield name, key node and value node."""
        return ((name, key, value) for name, (key, value) in self.entries.items())


def shorten(text: str, width: int = 60) -> str:
    """Return the text on one line, cut to a width that a message can carry."""
    text = " ".join("".join(c if c.isprintable() or c.isspace() else "�" for c in text).split())
    return text if len(text) <= width else text[: width - 1] + "…"


def nearest(name: str, known: list[str], count: int = 3) -> list[str]:
    """Return the known names that look most like a name."""
    lower: dict[str, str] = {}
    for k in known:
        lower.setdefault(k.lower(), k)
    close = difflib.get_close_matches(name.lower(), list(lower), n=count, cutoff=0.6)
    return [lower[c] for c in close]


class _Refused(Exception):
    def __init__(self, diagnostic: Diagnostic):
        self.diagnostic = diagnostic


def parse(source: Source) -> tuple[Mapping, list[Diagnostic]]:
    """Parse one YAML document whose root is a mapping.

    Returns
    -------
    root : Mapping
    diagnostics : list of Diagnostic
        Duplicate keys and keys that are not names; the root is usable beside them.

    Raises
    ------
    ModelError
        The text is not YAML, is empty, has another root, or exceeds a bound.
    """
    try:
        return _Composer(source).document()
    except _Refused as refused:
        raise ModelError([refused.diagnostic]) from None
    except yaml.YAMLError as error:
        raise ModelError([_yaml_diagnostic(source, error)]) from None


def _yaml_diagnostic(source: Source, error: yaml.YAMLError) -> Diagnostic:
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    problem = getattr(error, "problem", None) or str(error).split("\n", 1)[0]
    location = source.location(mark.line, mark.column) if mark else source.location(0, 0)
    text = location.text
    help_text = None
    if "\t" in text[: len(text) - len(text.lstrip())] or "character that cannot start" in problem:
        help_text = "indent with spaces, and put quotes around a value that begins with @, ` or %"
    elif "mapping values are not allowed" in problem:
        help_text = "put quotes around a value that contains a colon followed by a space"
    elif "alias" in problem or "anchor" in problem:
        help_text = "a value that begins with * or & needs quotes"
    return Diagnostic("yaml", f"this is not valid YAML: {problem}", location, help_text)


class _Composer:
    """Builds nodes from events, with bounds on depth, size and aliases."""

    def __init__(self, source: Source):
        self.source = source
        loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
        self.events = yaml.parse(source.text, Loader=loader)
        self.anchors: dict[str, tuple[Node, int]] = {}
        self.open: set[str] = set()
        self.count = 0
        self.diagnostics: list[Diagnostic] = []

    def refuse(self, kind: str, message: str, event: yaml.Event | None, help_: str) -> _Refused:
        mark = event.start_mark if event else None
        location = self.source.location(mark.line, mark.column) if mark else None
        return _Refused(Diagnostic(kind, message, location, help_))

    def document(self) -> tuple[Mapping, list[Diagnostic]]:
        root: Node | None = None
        for event in self.events:
            if isinstance(event, yaml.DocumentStartEvent):
                if root is not None:
                    raise self.refuse(
                        "yaml", "a second document begins here", event, "one file holds one model"
                    )
                root = self.node(next(self.events), 0)
        if root is None or (isinstance(root, Scalar) and not root.value.strip()):
            raise _Refused(
                Diagnostic(
                    "empty-file",
                    "the file holds no model",
                    self.source.location(0, 0),
                    "a model needs at least `coordinates`, `T`, `parameters` and `initial`",
                )
            )
        if not isinstance(root, Mapping):
            raise _Refused(
                Diagnostic(
                    "wrong-type",
                    f"a model file is a mapping of keys, but this is {root.what}",
                    root.location,
                    "begin with a line such as `coordinates: [x, y]`",
                )
            )
        return root, self.diagnostics

    def grow(self, by: int, event: yaml.Event) -> None:
        self.count += by
        if self.count > MAX_NODES:
            raise self.refuse(
                "too-large",
                f"the model expands to more than {MAX_NODES:,} values",
                event,
                "aliases (*name) repeat what they name: use fewer of them",
            )

    def node(self, event: yaml.Event, depth: int) -> Node:
        if depth > MAX_DEPTH:
            raise self.refuse(
                "too-deep", f"nested deeper than {MAX_DEPTH} levels", event, "flatten the structure"
            )
        if isinstance(event, yaml.AliasEvent):
            return self.alias(event)
        anchor = event.anchor
        if anchor:
            self.open.add(anchor)
        before = self.count
        self.grow(1, event)
        if isinstance(event, yaml.ScalarEvent):
            node: Node = self.scalar(event)
        elif isinstance(event, yaml.SequenceStartEvent):
            node = self.sequence(event, depth)
        else:
            node = self.mapping(event, depth)
        if anchor:
            self.open.discard(anchor)
            self.anchors[anchor] = (node, self.count - before)
        return node

    def alias(self, event: yaml.AliasEvent) -> Node:
        if event.anchor in self.open:
            raise self.refuse(
                "recursive-alias",
                f"the alias *{event.anchor} stands inside what it names",
                event,
                "a value cannot contain itself; quote an expression that begins with *",
            )
        if event.anchor not in self.anchors:
            raise self.refuse(
                "yaml",
                f"the alias *{event.anchor} names no anchor",
                event,
                "quote an expression that begins with *",
            )
        node, size = self.anchors[event.anchor]
        self.grow(size, event)
        return node

    def scalar(self, event: yaml.ScalarEvent) -> Scalar:
        s, e = event.start_mark, event.end_mark
        return Scalar(self.source, s.line, s.column, e.line, e.column, event.value, event.style)

    def sequence(self, event: yaml.Event, depth: int) -> Sequence:
        items = []
        while not isinstance(inner := next(self.events), yaml.SequenceEndEvent):
            items.append(self.node(inner, depth + 1))
        s, e = event.start_mark, inner.end_mark
        return Sequence(self.source, s.line, s.column, e.line, e.column, items)

    def mapping(self, event: yaml.Event, depth: int) -> Mapping:
        entries: dict[str, tuple[Scalar, Node]] = {}
        while not isinstance(inner := next(self.events), yaml.MappingEndEvent):
            key = self.node(inner, depth + 1)
            value = self.node(next(self.events), depth + 1)
            if not isinstance(key, Scalar):
                self.diagnostics.append(
                    Diagnostic(
                        "wrong-type",
                        f"a key must be a name, but this is {key.what}",
                        key.location,
                        "put quotes around a value that contains braces or brackets",
                    )
                )
            elif key.value in entries:
                first = entries[key.value][0]
                self.diagnostics.append(
                    Diagnostic(
                        "duplicate-key",
                        f"the key `{shorten(key.value)}` stands twice in the same mapping",
                        key.location,
                        "remove or rename one of the two",
                        (("the first one is here", first.location),),
                    )
                )
            else:
                entries[key.value] = (key, value)
        s, e = event.start_mark, inner.end_mark
        return Mapping(self.source, s.line, s.column, e.line, e.column, entries)
