"""YAML composer: text → nodes with source locations.

Nodes are composed from the parser's events and never converted to Python values: the model language
interprets scalars, not YAML's rules for numbers, booleans and dates.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import yaml

from lagcli.errors import Diagnostic, ModelError
from lagcli.model.spelling import shorten
from lagcli.model.yaml.source import NOT_TEXT, Mapping, Position, Scalar, Sequence, Source, YamlNode

MAX_DEPTH = 64  # the format needs 4
MAX_NODES = 300_000  # each use of an alias counts; 5000 bodies need 100 000

# Inside [ ] and { }, YAML ends a name at a bracket; in a model file, x[1] is one name everywhere.
# While YAML parses the text, placeholders replace the brackets after a name. An index contains no
# quotes, and a prime only after a name, so that brackets in two quoted texts are not paired.
_INDEX = re.compile(r"""(?<=[\w)\]*/+=(-])\[(?:[^\[\]{}"':#\n]|(?<=\w)')*\]""")
# Likewise, YAML ends a value at a comma, which in parentheses separates arguments: f(u, v). A quote
# that is no prime, a brace, a comment or the line's end leaves parentheses open.
_PARENTHESIS = re.compile(r"""[()"#{}\n]|(?<![\w)'])(?<!\ufdd1)'""")
_BEFORE_VALUE = re.compile(r"(?:\s|&\S*)*")
_COLON = re.compile(r"\s*:")
_HIDE = str.maketrans("[],", "\ufdd0\ufdd1\ufdd2")
_SHOW = str.maketrans("\ufdd0\ufdd1\ufdd2", "[],")


# A value such as `[1, 0]*x`: YAML would end it at the bracket.
_VECTOR = re.compile(r":[ \t]+(?=\[)")
_MORE = re.compile(r"[ \t]*[-+*/^=<>.·×÷−≤≥≠]")


def _hidden(match: re.Match[str]) -> str:
    return match[0].translate(_HIDE)


def _with_hidden_brackets(text: str) -> str:
    """Return a text for YAML's parser, with brackets only for lists."""
    text = _with_hidden_commas(_INDEX.sub(_hidden, text))
    parts, done = [], 0
    for start in (match.end() for match in _VECTOR.finditer(text)):
        if start < done:
            continue
        closing = _end_of_value(text, start, stop_after_bracket=True)
        if _MORE.match(text, closing):
            end = _end_of_value(text, start)
            parts += [text[done:start], text[start:end].translate(_HIDE)]
            done = end
    return "".join([*parts, text[done:]])


def _with_hidden_commas(text: str) -> str:
    """Return a text for YAML's parser, with commas only outside of parentheses."""
    parts, done, start, depth = [], 0, 0, 0
    for match in _PARENTHESIS.finditer(text):
        if match[0] == "(":
            start = start if depth else match.start()
            depth += 1
        elif match[0] != ")":
            depth = 0
        elif depth:
            depth -= 1
            if not depth:
                parts += [text[done:start], text[start : match.end()].translate(_HIDE)]
                done = match.end()
    return "".join([*parts, text[done:]])


def _end_of_value(text: str, start: int, stop_after_bracket: bool = False) -> int:
    """Return the end of a value that begins with a bracket: the line's end, a comma, or a brace."""
    depth = 0
    for i in range(start, len(text)):
        char = text[i]
        if char in "[(":
            depth += 1
        elif char in "])":
            depth -= 1
            if stop_after_bracket and depth == 0:
                return i + 1
        elif char in '{}"#' or (not depth and char in ",\n"):
            return i
    return len(text)


def compose(source: Source) -> tuple[Mapping, list[Diagnostic]]:
    """Compose one YAML document whose root is a mapping.

    Returns
    -------
    root : Mapping
    diagnostics : list of Diagnostic
        Duplicate keys, keys that are not names, values split by a comma; the root is usable
        nevertheless.

    Raises
    ------
    ModelError
        The text is not YAML, is empty, has another kind of root, or exceeds a bound.
    """
    try:
        try:
            return _Composer(source, getattr(yaml, "CSafeLoader", yaml.SafeLoader)).document()
        except yaml.YAMLError as error:
            if "nesting depth" not in str(error):
                raise
        # libyaml scans ahead and stops at its own bound of 1000 levels: the parser in Python
        # reaches the level where the composer stops
        return _Composer(source, yaml.SafeLoader).document()
    except yaml.YAMLError as error:
        raise ModelError([explain(source, error)]) from None


class _ComposedEntry(NamedTuple):
    key: YamlNode
    value: YamlNode
    bare: bool  # inside { }, without a colon


class _Composer:
    """Builds nodes from events, with bounds on depth, size and aliases."""

    def __init__(self, source: Source, loader: type[yaml.SafeLoader]):
        self.source = source
        self.events = yaml.parse(_with_hidden_brackets(source.text), Loader=loader)
        self.anchors: dict[str, tuple[YamlNode, int]] = {}
        self.open: set[str] = set()
        self.count = 0
        self.diagnostics: list[Diagnostic] = []

    def error(self, kind: str, message: str, event: yaml.Event, help_: str) -> ModelError:
        (line, column), (last, end) = self.positions(event, event)
        location = self.source.location(line, column, end - column if last == line else 1)
        return ModelError([*self.diagnostics, Diagnostic(kind, message, location, help_)])

    def report(
        self, kind: str, message: str, node: YamlNode, help_: str, first: YamlNode | None = None
    ) -> None:
        notes = (("the first one is here", first.location),) if first else ()
        self.diagnostics.append(Diagnostic(kind, message, node.location, help_, notes))

    # the document

    def document(self) -> tuple[Mapping, list[Diagnostic]]:
        root: YamlNode | None = None
        for event in self.events:
            if isinstance(event, yaml.DocumentStartEvent):
                if root is not None:
                    raise self.error(
                        "yaml", "a second document begins here", event, "one file holds one model"
                    )
                root = self.node(next(self.events), 0)
        if root is None or (isinstance(root, Scalar) and root.missing):
            location = self.source.location(0, 0)
            help_ = "a model needs at least `coordinates`, `T`, `parameters` and `initial`"
            raise ModelError(
                [Diagnostic("empty-file", "the file contains no model", location, help_)]
            )
        if not isinstance(root, Mapping):
            message = f"a model file is a mapping of keys, but this is {root.what}"
            help_ = "begin with a line such as `coordinates: [x, y]`"
            raise ModelError([Diagnostic("wrong-type", message, root.location, help_)])
        return root, self.diagnostics

    def grow(self, by: int, event: yaml.Event) -> None:
        self.count += by
        if self.count > MAX_NODES:
            raise self.error(
                "too-large",
                f"the model contains more than {MAX_NODES:,} values",
                event,
                "each use of an alias (*name) counts with all the values it repeats",
            )

    def node(self, event: yaml.Event, depth: int) -> YamlNode:
        if depth > MAX_DEPTH:
            raise self.error(
                "too-deep",
                f"nested deeper than {MAX_DEPTH} levels",
                event,
                "models need at most four levels",
            )
        if isinstance(event, yaml.AliasEvent):
            return self.alias(event)
        assert isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent)
        if event.tag:
            tag = event.tag.replace("tag:yaml.org,2002:", "!!")
            message = f"the tag {shorten(tag)} has no meaning in a model file"
            raise self.error("yaml", message, event, "remove it")
        anchor = event.anchor
        if anchor:
            self.open.add(anchor)
        before = self.count
        self.grow(1, event)
        if isinstance(event, yaml.ScalarEvent):
            start, end = self.positions(event, event)
            value = event.value.translate(_SHOW)
            scalar = Scalar(self.source, start, end, value, event.style or None)
            if event.style == '"':
                self.check_escapes(scalar)
            node: YamlNode = self.without_anchor(scalar) if anchor else scalar
        elif isinstance(event, yaml.SequenceStartEvent):
            node = self.sequence(event, depth)
        else:
            assert isinstance(event, yaml.MappingStartEvent)
            node = self.mapping(event, depth)
        if anchor:
            self.open.discard(anchor)
            self.anchors[anchor] = (node, self.count - before)
        return node

    def check_escapes(self, node: Scalar) -> None:
        """Reject escape sequences of characters that a text cannot contain."""
        if node.value.isprintable():
            return
        if found := re.search(NOT_TEXT, node.value):
            message = f"this is the character U+{ord(found[0]):04X}, which is not text"
            help_ = "remove it; single quotes keep a backslash: 'a\\0'"
            location = node.span(*found.span())
            raise ModelError([*self.diagnostics, Diagnostic("not-text", message, location, help_)])

    def positions(self, first: yaml.Event, last: yaml.Event) -> tuple[Position, Position]:
        start, end = first.start_mark, last.end_mark
        assert start is not None
        assert end is not None
        return (start.line, start.column), (end.line, end.column)

    def without_anchor(self, node: Scalar) -> Scalar:
        """Return a scalar without its anchor."""
        line, column = node.start
        lines = self.source.lines
        while line <= node.end[0] and line < len(lines):
            skipped = _BEFORE_VALUE.match(lines[line], column)
            column = skipped.end() if skipped else column
            if column < len(lines[line]):
                return Scalar(node.source, (line, column), node.end, node.value, node.style)
            line, column = line + 1, 0
        return node

    def alias(self, event: yaml.AliasEvent) -> YamlNode:
        help_ = (
            "in YAML, * at the beginning of a value repeats another one (an alias);\n"
            "put quotes around the value if a product is meant"
        )
        anchor = event.anchor or ""
        if anchor in self.open:
            message = f"the alias *{shorten(anchor)} refers to a value that contains it"
            raise self.error("recursive-alias", message, event, help_)
        if anchor not in self.anchors:
            message = f"the alias *{shorten(anchor)} is not defined"
            raise self.error("yaml", message, event, help_)
        node, size = self.anchors[anchor]
        self.grow(size, event)
        return node

    # collections

    def sequence(self, event: yaml.Event, depth: int) -> Sequence:
        items = []
        while not isinstance(inner := next(self.events), yaml.SequenceEndEvent):
            items.append(self.node(inner, depth + 1))
        return Sequence(self.source, *self.positions(event, inner), items)

    def mapping(self, event: yaml.MappingStartEvent, depth: int) -> YamlNode:
        composed: list[_ComposedEntry] = []
        while not isinstance(inner := next(self.events), yaml.MappingEndEvent):
            key = self.node(inner, depth + 1)
            value = self.node(next(self.events), depth + 1)
            bare = bool(event.flow_style) and self.is_bare(key, value)
            composed.append(_ComposedEntry(key, value, bare))
        start, end = self.positions(event, inner)
        if composed and all(entry.bare for entry in composed):
            text = self.source.between(start, end)
            # braces instead of parentheses are reported when the expression is parsed
            if ":" not in text:
                return Scalar(self.source, start, end, text)
        return Mapping(self.source, start, end, self.entries(self.rejoined(composed)))

    def is_bare(self, key: YamlNode, value: YamlNode) -> bool:
        if not (isinstance(value, Scalar) and not value.value and value.style is None):
            return False
        line, column = key.end
        return not _COLON.match(self.source.lines[line], column)

    def rejoined(self, composed: list[_ComposedEntry]) -> list[_ComposedEntry]:
        """Report entries without a colon, and rejoin values that a comma has split."""
        rejoined: list[_ComposedEntry] = []
        cut: list[YamlNode] = []  # the keys into which commas have split one value
        for entry in self.closed(composed):
            key = entry.key
            if not entry.bare:
                self.join(cut, rejoined)
                cut = []
                rejoined.append(entry)
            elif isinstance(key, Scalar) and ":" in key.value and key.style is None:
                self.join(cut, rejoined)
                cut = []
                rejoined.append(self.split_at_colon(key))
            elif rejoined and isinstance(rejoined[-1].value, Scalar):
                cut.append(key)
            else:
                self.report("yaml", f"{key.what} has no value", key, "write `name: value`")
        self.join(cut, rejoined)
        return rejoined

    def closed(self, composed: list[_ComposedEntry]) -> list[_ComposedEntry]:
        """Report keys with an open parenthesis, which commas have split, and rejoin them."""
        entries: list[_ComposedEntry] = []
        first: int | None = None  # the entry with the parenthesis
        for entry in composed:
            entries.append(entry)
            if not isinstance(key := entry.key, Scalar):
                first = None
            elif entry.bare and key.value.count("(") > key.value.count(")"):
                first = len(entries) - 1
            elif first is not None and not entry.bare:
                start = entries[first].key.start
                text = self.source.between(start, key.end)
                del entries[first:]
                whole = Scalar(self.source, start, key.end, f"{text})")
                self.report(
                    "yaml",
                    f"`(` is not closed in the key `{shorten(text)}`",
                    whole,
                    f"write `{shorten(text)}): …`",
                )
                entries.append(entry._replace(key=whole))
                first = None
        return entries

    def join(self, cut: list[YamlNode], rejoined: list[_ComposedEntry]) -> None:
        """Rejoin a value that commas have split, and report it."""
        if not cut:
            return
        last, end = rejoined[-1], cut[-1].end
        text = self.source.between(last.value.start, end)
        rejoined[-1] = last._replace(value=Scalar(self.source, last.value.start, end, text))
        name = last.key.value if isinstance(last.key, Scalar) else "…"
        self.report(
            "comma",
            f"inside {{ }} a comma ends the value: {cut[0].what} is read as a separate entry",
            cut[0],
            f'put quotes around the whole value: `{name}: "{shorten(text)}"`',
        )

    def split_at_colon(self, key: Scalar) -> _ComposedEntry:
        name, _, rest = key.value.partition(":")
        line, column = key.start
        colon = (line, column + len(name))
        self.diagnostics.append(
            Diagnostic(
                "yaml",
                f"a space is missing after the colon of {key.what}",
                self.source.location(*colon),
                f"write `{shorten(name)}: {shorten(rest)}`",
            )
        )
        after = (line, colon[1] + 1)
        return _ComposedEntry(
            Scalar(self.source, key.start, colon, name),
            Scalar(self.source, after, key.end, rest),
            bare=False,
        )

    def entries(self, composed: list[_ComposedEntry]) -> dict[str, tuple[Scalar, YamlNode]]:
        entries: dict[str, tuple[Scalar, YamlNode]] = {}
        for entry in composed:
            key = entry.key
            if not isinstance(key, Scalar):
                self.report(
                    "wrong-type",
                    f"a key must be a name, but this is {key.what}",
                    key,
                    "put quotes around a value that contains braces or brackets",
                )
            elif key.value in entries:
                self.report(
                    "duplicate-key",
                    f"the key `{shorten(key.value)}` occurs twice in the same mapping",
                    key,
                    "remove or rename one of the two",
                    entries[key.value][0],
                )
            else:
                entries[key.value] = (key, entry.value)
        return entries


_LONGEST_KEY = 1000  # the longest key that YAML reads

_INDENT = (
    "entries of one mapping start in the same column;\n"
    "look at the lines above, too, for a bracket or a quote that is not closed"
)


def explain(source: Source, error: yaml.YAMLError) -> Diagnostic:
    """Return the diagnostic for an error of the YAML parser."""
    problem = str(getattr(error, "problem", None) or getattr(error, "reason", None) or error)
    context = str(getattr(error, "context", None) or "")
    mark = getattr(error, "problem_mark", None)
    opened = getattr(error, "context_mark", None)
    line, column = (mark.line, mark.column) if mark else (0, 0)
    text = source.lines[line] if line < len(source.lines) else ""
    here = text[column : column + 1]

    def at(message: str, help_: str, begin: bool = False) -> Diagnostic:
        position = (opened.line, opened.column) if begin and opened else (line, column)
        return Diagnostic("yaml", message, source.location(*position), help_)

    if here == "\t" or (not text[:column].strip() and "\t" in text[:column]):
        return at("a tab cannot indent a line of YAML", "indent with spaces")
    if "cannot start any token" in problem:
        sign = "a backtick" if here == "`" else f"`{here}`"
        return at(
            f"a value cannot start with {sign}", "put quotes around it, or remove the character"
        )
    if here in "]}" and here:
        return at(
            f"this `{here}` has no opening bracket", "remove it, or open the bracket before it"
        )
    if "quoted scalar" in context and "end of stream" in problem:
        return at("this quote is never closed", "close it, or remove it", begin=True)
    one_line = opened is not None and opened.line == line
    if "mapping values are not allowed" in problem or (here == ":" and one_line):
        return _second_colon(source, line, column)
    if here == "[" and "flow" in context:
        return at(
            "unexpected bracket",
            "an index follows a name directly and is closed on the same line, as in x[1] or"
            " x[1..N]",
        )
    if "flow" in context and "expected" in problem:
        bracket = "[" if "sequence" in context else "{"
        closing = "]" if bracket == "[" else "}"
        return at(
            f"`{bracket}` is never closed, or a comma is missing between its entries",
            f"separate the entries with commas and close with `{closing}`",
            begin=True,
        )
    if "could not find expected ':'" in problem:
        return at(
            "this line is not an entry: a colon and a space are missing",
            "write `name: value`; a value over several lines is indented further than its name",
            begin=True,
        )
    if text[:column].rstrip().endswith(("|", ">")):
        return at("the text after | or > starts on the next line", "move it there, indented")
    if "block sequence entries are not allowed" in problem:
        return at("unexpected list entry `-`", "put each entry of the list on its own line")
    if "escape" in problem or "escape" in context:
        return at(
            "a backslash starts an escape sequence inside double quotes",
            "use single quotes: 'a\\b', or double the backslash",
        )
    if "anchor" in context or "alias" in context:
        return at(
            "a value that starts with * or & must be quoted", 'write it in quotes: "*…"', True
        )
    if text[:column].rstrip().endswith(("]", "}")) and here:
        return at(
            f"`{text[:column].rstrip()[-1]}` ends the value, but more follows",
            "put quotes around the whole value",
        )
    if "did not find expected" in problem or "expected <" in problem:
        return at("this line does not fit the lines before it", _INDENT)
    return at(f"this is not valid YAML: {problem}", "see docs/model-file.md for the format")


def _second_colon(source: Source, line: int, column: int) -> Diagnostic:
    """Explain a colon inside a value that starts on this line or above."""
    text = source.lines[line]
    location = source.location(line, column)
    if ": " in text[:column]:
        message, help_ = "a second colon in one value", "put quotes around the value"
        return Diagnostic("yaml", message, location, help_)
    above = next((n for n in range(line - 1, -1, -1) if source.lines[n].strip()), None)
    before = source.lines[above] if above is not None else ""
    if above is not None and (tight := re.match(r"\s*[\w.']+:(?=\S)", before)):
        message, help_ = "a space is missing after this colon", "write `name: value`"
        location = source.location(above, tight.end() - 1)
        return Diagnostic("yaml", message, location, help_)
    if above is None or column > _LONGEST_KEY:
        return Diagnostic("yaml", "this name is too long", location, "shorten it")
    where = source.location(line, len(text) - len(text.lstrip()), len(text.strip()))
    return Diagnostic(
        "yaml",
        f"this line continues the value that starts in line {above + 1} or above, and a"
        " value cannot contain a colon and a space",
        where,
        "start an entry in the same column as its neighbors, or put quotes around the value",
    )
