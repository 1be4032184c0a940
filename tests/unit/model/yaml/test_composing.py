"""Errors of the YAML parser, said in terms of model files, at the place of the cause."""

import pytest
import yaml

from lagcli.model.yaml.composing import explain
from lagcli.model.yaml.source import Source


@pytest.mark.parametrize(
    ("text", "message", "place", "remedy"),
    [
        ("a: 1\n\tb: 2\n", "a tab cannot indent a line of YAML", (2, 1), "spaces"),
        ("a: @x\n", "a value cannot start with `@`", (1, 4), "quotes"),
        ("a: `x\n", "a value cannot start with a backtick", (1, 4), "quotes"),
        ('a: "x\n', "this quote is never closed", (1, 4), "close it"),
        ("a: [1, 2\nb: 3\n", "`[` is never closed, or a comma is missing", (1, 4), "`]`"),
        ("a: {b: 1\n", "`{` is never closed, or a comma is missing", (1, 4), "`}`"),
        ("a: b: c\n", "a second colon in one value", (1, 5), "quotes"),
        ("a:1\nb: 2\n", "a space is missing after this colon", (1, 2), "`name: value`"),
        ("a: 1\nbare\nc: 2\n", "a colon and a space are missing", (2, 1), "`name: value`"),
        ('a: "\\q"\n', "a backslash starts an escape sequence", (1, 5), "single quotes"),
        ("a: [1] 2\n", "`]` ends the value, but more follows", (1, 8), "quotes"),
        ("a: 1\n  b: 2\n", "continues the value that starts in line 1", (2, 3), "same column"),
        ("a: | text\n", "the text after | or > starts on the next line", (1, 6), "indented"),
        ("a: 1\n]\n", "this `]` has no opening bracket", (2, 1), "remove it"),
    ],
)
def test_what_is_wrong_where(text: str, message: str, place: tuple[int, int], remedy: str) -> None:
    with pytest.raises(yaml.YAMLError) as found:
        list(yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)))
    said = explain(Source(text, "model.yaml"), found.value)
    assert said.kind == "yaml"
    assert message in said.message
    assert said.location is not None
    assert (said.location.line, said.location.column) == place
    assert remedy in (said.help or "")
