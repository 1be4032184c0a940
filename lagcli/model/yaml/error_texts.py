"""Messages for YAML syntax errors, in terms of model files."""

from __future__ import annotations

import re

import yaml

from lagcli.errors import Diagnostic
from lagcli.model.yaml.source import Source

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
