"""Diagnostics as text: place, excerpt, notes and remedy."""

from __future__ import annotations

import pytest

from lagcli.errors import (
    Diagnostic,
    FileError,
    ModelError,
    NumericalError,
    SourceLocation,
    UsageError,
)


def test_a_diagnostic_shows_its_place_its_line_and_a_remedy() -> None:
    place = SourceLocation("pendulum.yaml", 12, 4, 3, "T: m*v^2")
    found = Diagnostic(
        "unknown-name",
        "`m*v` is unknown",
        place,
        "declare it\nunder `parameters`",
        (("first used here", SourceLocation("pendulum.yaml", 3, 1, 1, "V: v")), ("a note", None)),
    )
    assert found.render().splitlines() == [
        "pendulum.yaml:12:4: error[unknown-name]: `m*v` is unknown",
        "   12 | T: m*v^2",
        "      |    ^^^",
        "   note: first used here (pendulum.yaml:3)",
        "    3 | V: v",
        "      | ^",
        "   note: a note",
        "   help: declare it",
        "         under `parameters`",
    ]


def test_text_without_lines_has_no_line_number() -> None:
    place = SourceLocation("--set", 0, 3, 2, "m=2q")
    lines = Diagnostic("bad-number", "no number", place, severity="warning").render().splitlines()
    assert lines == ["--set: warning[bad-number]: no number", "      | m=2q", "      |   ^^"]


@pytest.mark.parametrize(
    ("text", "column", "pad", "marks"),
    [
        ("宽x", 2, 2, 1),  # wide characters take two cells,
        ("e\u0301x", 3, 1, 1),  # combining ones none
        ("\tx", 2, 1, 1),  # a tab is shown as a blank
        ("x宽", 2, 1, 2),
    ],
)
def test_marks_stand_below_what_they_mark(text: str, column: int, pad: int, marks: int) -> None:
    place = SourceLocation("a", 1, column, 1, text)
    *_, below = Diagnostic("k", "m", place).render().splitlines()
    assert below == f"      | {' ' * pad}{'^' * marks}"


def test_a_long_line_is_cut_around_the_place() -> None:
    place = SourceLocation("a", 1, 501, 3, "." * 500 + "bad" + "." * 500)
    _, line, below = Diagnostic("k", "m", place).render().splitlines()
    assert len(line) < 180
    assert line[below.index("^") :].startswith("bad.")
    assert below.count("^") == 3


def test_errors_have_the_exit_statuses_of_the_manual() -> None:
    diagnostic = Diagnostic("k", "no solution", SourceLocation("a", 2, 1))
    assert (UsageError.exit_status, FileError.exit_status) == (2, 4)
    assert NumericalError("x").exit_status == 3
    assert NumericalError(diagnostic).diagnostics == [diagnostic]
    assert "a:2:1: error[k]: no solution" in str(NumericalError(diagnostic))
    both = ModelError([diagnostic, diagnostic])
    assert both.exit_status == 2
    assert str(both).count("no solution") == 2
