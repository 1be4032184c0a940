"""Places of nodes and characters, YAML's errors in plain words, bounds."""

from __future__ import annotations

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from random_cases import some

from lagcli.errors import Diagnostic, ModelError, SourceLocation
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.composing import MAX_DEPTH, compose
from lagcli.model.yaml.source import (
    Mapping,
    Scalar,
    Sequence,
    Source,
    YamlNode,
    character_positions,
)


def value(text: str, key: str = "a") -> Scalar:
    root, diagnostics = compose(Source(text, "f"))
    assert not diagnostics
    node = root.entries[key][1]
    assert isinstance(node, Scalar)
    return node


def errors(text: str) -> str:
    try:
        _, diagnostics = compose(Source(text, "f"))
    except ModelError as error:
        return str(error)
    return "\n\n".join(d.render() for d in diagnostics)


STYLES = [
    "a: one two + three",
    "a: one\n  two\n\n  + three\n",
    "a: 'one ''two'' + three'",
    "a: 'one\n  two\n  + three'",
    'a: "one \\u0074wo + \\tthree"',
    'a: "one \\\n  two\n  + three"',
    'a: "one\\n two  + three"',
    "a: |\n  one\n    two\n\n  + three\n",
    "a: >-\n  one two\n\n\n  + three",
    "a: |2\n    one two + three\n",
    "a: &anchor one two + three",
    "ä高: {b: 1, a: one two + three}",
    "{a: one two\n   + three, b: 2}",
    "a: one two + three  # comment",
    "a:\r\n  one two\r\n  + three\r\n",
]


@pytest.mark.parametrize("text", STYLES)
def test_each_character_stands_where_its_place_says(text: str) -> None:
    root, _ = compose(Source(text, "f"))
    while "a" not in root.entries:
        inner = next(iter(root))[2]
        assert isinstance(inner, Mapping)
        root = inner
    node = root.entries["a"][1]
    assert isinstance(node, Scalar)
    lines = node.source.lines
    for word in ("one", "wo", "+", "three"):
        start = node.value.index(word)
        place = node.span(start, start + len(word))
        found = lines[place.line - 1][place.column - 1 :][: place.length]
        assert found == word, (word, found)
    escaped = node.value.index("two")
    place = node.span(escaped, escaped + 3)
    assert place.text[place.column - 1 :][: place.length] in ("two", "\\u0074wo")


@settings(deadline=None)
@given(
    st.lists(st.sampled_from(["x", "y_1", "'", '"', "\\", "ä", "高", "\t", " ", "\n", "#", ":"])),
    st.sampled_from(["'", '"', "|", ">", None]),
    st.integers(0, 3),
)
def test_places_are_right_or_absent(parts: list[str], style: str | None, depth: int) -> None:
    node: object = "".join(parts)
    for _ in range(depth):
        node = {"k": node}
    text = yaml.dump({"a": node}, default_style=style, allow_unicode=True, width=20)
    source = Source(text, "f")
    inner = compose(source)[0].entries["a"][1]
    while isinstance(inner, Mapping):
        inner = inner.entries["k"][1]
    assert isinstance(inner, Scalar)
    places = character_positions(source.lines, inner.start, inner.style, inner.value)
    assert len(places) in (0, len(inner.value))
    if inner.value.strip():
        assert places  # the walk never loses its way in what YAML writes
    for char, (line, column) in zip(inner.value, places, strict=False):
        there = source.lines[line][column : column + 1]
        assert there == char or there == "\\" or char.isspace()


def test_an_end_stands_behind_the_last_character() -> None:
    assert value("a: x +   \n").span(3, 3).column == 7
    assert value("a: |\n  x +\n").span(4, 4).column == 6


def test_columns_count_characters() -> None:
    place = value('ä: "高"\na: Größe*x').span(6, 7)
    assert (place.line, place.column) == (2, 10)


def test_line_ends_are_those_of_yaml() -> None:
    assert Source("a\r\nb\rc\x0bd\u2028e", "f").lines == ["a", "b", "c\x0bd", "e"]


def test_excerpt_marks_stand_under_wide_characters() -> None:
    location = SourceLocation("f", 1, 4, 2, "高さ*xy")
    assert Diagnostic("k", "m", location).render().splitlines()[-1] == "      |      ^^"


def test_excerpt_of_a_long_line_is_cut_around_the_place() -> None:
    location = SourceLocation("f", 1, 501, 3, "a" * 500 + "bcd" + "e" * 500)
    line, marks = Diagnostic("k", "m", location).render().splitlines()[1:]
    assert len(line) < 200
    assert line[marks.index("^") :].startswith("bcd")


def test_tabs_are_one_column() -> None:
    location = SourceLocation("f", 1, 3, 1, "\t\tx")
    line, marks = Diagnostic("k", "m", location).render().splitlines()[1:]
    assert line[marks.index("^")] == "x"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a:\n\tb: 1\n", ["2:1", "tab", "spaces"]),
        ("a: b: c\n", ["1:5", "second colon", "quotes"]),
        ("a: [1, 2\nb: 3\n", ["1:4", "`[` is never closed"]),
        ("a: {b: 1\nc: 3\n", ["1:4", "`{` is never closed"]),
        ("a: [1]]\n", ["1:7", "`]` has no opening bracket"]),
        ('a: "b\n', ["1:4", "quote", "never closed"]),
        ("a: @b\n", ["1:4", "cannot start with `@`"]),
        ("a: *b\n", ["1:4", "alias *b is not defined", "quotes"]),
        ("a: *b*c\n", ["1:4", "must be quoted"]),
        ("a:\n  b:1\n  c: 2\n", ["2:4", "space is missing after this colon"]),
        ("a: 1\n  b: 2\n", ["2:3", "value that starts in line 1"]),
        ("a:\n   b: 1\n  c: 2\n", ["3:3", "same column"]),
        ("a: | b\n", ["1:6", "starts on the next line"]),
        ('a: "\\d"\n', ["1:5", "backslash"]),
        ("a: !!float 1\n", ["1:4", "tag !!float"]),
        ("a: 1\n---\nb: 2\n", ["2:1", "second document"]),
        ("a: [x] y\n", ["`]` ends the value"]),
        ("", ["1:1", "contains no model"]),
        ("# nothing\n", ["contains no model"]),
        ("- a\n", ["is a list"]),
        ("a: &a [*a]\n", ["1:8", "value that contains it"]),
        ("a: 1\nb: 2\na: 3\n", ["3:1", "twice", "(f:1)"]),
        ("? [x]\n: 1\n", ["key must be a name"]),
        ("a: {b, c: 1}\n", ["`b` has no value"]),
        ("a: {b:1, c: 2}\n", ["space is missing after the colon"]),
    ],
)
def test_yaml_errors(text: str, words: list[str]) -> None:
    found = errors(text)
    for word in words:
        assert word in found


def test_a_comma_in_braces_is_explained_and_mended() -> None:
    root, diagnostics = compose(Source("a: {b: x, y, and z, c: 1, 2}", "f"))
    assert [d.kind for d in diagnostics] == ["comma", "comma"]
    assert '`b: "x, y, and z"`' in diagnostics[0].render()
    inner = root.entries["a"][1]
    assert isinstance(inner, Mapping)
    assert {k: v.value for k, _, v in inner if isinstance(v, Scalar)} == {
        "b": "x, y, and z",
        "c": "1, 2",
    }


def test_commas_in_parentheses_separate_arguments() -> None:
    text = """functions: {hinge(u, v, w): "u*v + w", g(a, b): a - b}
a: {b: max(x, hypot(x', 2*(y + min(1, (2))))), c: 3, d: length (of a, b)}
e: [f(x[1, 2]', y), 4]
h: {i: a's (b, c), j: 1}
k: (a, b
l: {m: 1, n: 2}  # (o, p
"""
    root, diagnostics = compose(Source(text, "f"))
    assert diagnostics == []

    def plain(node: YamlNode) -> object:
        if isinstance(node, Mapping):
            return {key: plain(item) for key, _, item in node}
        if isinstance(node, Sequence):
            return [plain(item) for item in node.items]
        assert isinstance(node, Scalar)
        return node.value

    assert plain(root) == {
        "functions": {"hinge(u, v, w)": "u*v + w", "g(a, b)": "a - b"},
        "a": {"b": "max(x, hypot(x', 2*(y + min(1, (2)))))", "c": "3", "d": "length (of a, b)"},
        "e": ["f(x[1, 2]', y)", "4"],
        "h": {"i": "a's (b, c)", "j": "1"},
        "k": "(a, b",
        "l": {"m": "1", "n": "2"},
    }


@pytest.mark.parametrize("before", ["", "g(a): a, ", "g(a, b): a + b, "])
@pytest.mark.parametrize("arguments", ["u, v", "u, v, w"])
def test_an_open_parenthesis_of_a_key_is_one_error(before: str, arguments: str) -> None:
    root, diagnostics = compose(Source(f"a: {{{before}f({arguments}: u*v, h(x): x}}", "f"))
    (found,) = diagnostics
    assert found.message == f"`(` is not closed in the key `f({arguments}`"
    assert found.help == f"write `f({arguments}): …`"
    assert found.location is not None
    assert found.location.column == 5 + len(before)
    inner = root.entries["a"][1]
    assert isinstance(inner, Mapping)
    assert [key for key, _, _ in inner][-2:] == [f"f({arguments})", "h(x)"]


def test_braces_for_parentheses_are_text() -> None:
    assert value("a: {m*g}").value == "{m*g}"


@pytest.mark.parametrize("levels", some([MAX_DEPTH + 1, 999, 1001, 10_000], 1))
@pytest.mark.parametrize(
    "text",
    ["[", "{", "{a: ", "- ", "? ", "[{", "a:\n"],
    ids=["[", "{", "{a:", "-", "?", "[{", "a:"],
)
def test_depth_is_bounded(text: str, levels: int) -> None:
    if text == "a:\n":
        nested = "\n".join(" " * level + "a:" for level in range(min(levels, 2000)))
    else:
        nested = text * levels if text in "- ? " else "a: " + text * levels
    assert f"nested deeper than {MAX_DEPTH} levels" in errors(nested)


def test_depth_up_to_the_bound_is_read() -> None:
    deep = "a: " + "[" * (MAX_DEPTH - 1) + "]" * (MAX_DEPTH - 1)
    assert isinstance(compose(Source(deep, "f"))[0].entries["a"][1], Sequence)


def test_aliases_are_bounded() -> None:
    doubled = (f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 60))
    assert "more than 300,000 values" in errors("a0: &a0 [x, x]\n" + "".join(doubled))


def test_aliases_denote_what_they_name() -> None:
    root, _ = compose(Source("a: &n 1 kg\nb: *n\n", "f"))
    assert root.entries["b"][1] is root.entries["a"][1]


def test_nearest() -> None:
    assert nearest("lenght", ["length", "mass"]) == ["length"]
    assert nearest("Phi", ["phi"]) == ["phi"]
    assert nearest("µ", ["μ"]) == ["μ"]  # micro sign, Greek mu
    assert nearest("q", ["mass"]) == []
    many = [f"p_{i}" for i in range(100_000)]
    assert nearest("p_77x", many)
    assert did_you_mean(["a", "`b` (line 3)"]) == "did you mean `a` or `b` (line 3)?"
    assert did_you_mean([]) is None


def test_shorten() -> None:
    assert shorten("a\n b") == "a b"
    assert len(shorten("x" * 10_000_000)) == 60
