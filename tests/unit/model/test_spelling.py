"""Names that were probably meant, and text short enough for a message."""

from __future__ import annotations

import pytest

from lagcli.model.spelling import did_you_mean, nearest, shorten


@pytest.mark.parametrize(
    ("name", "known", "found"),
    [
        ("lenght", ["length", "mass", "g"], ["length"]),
        ("PHI", ["phi", "psi"], ["phi"]),
        ("µ", ["μ"], ["μ"]),  # micro sign and mu
        ("q", ["mass"], []),
        ("", [], []),
    ],
)
def test_nearest(name: str, known: list[str], found: list[str]) -> None:
    assert nearest(name, known, 1) == found


def test_among_many_names_too() -> None:
    known = [f"x[{i}]" for i in range(2000)] + ["mass_of_rod"]
    assert nearest("mass_of_rot", known, 1) == ["mass_of_rod"]


def test_suggestions_as_a_question() -> None:
    assert did_you_mean([]) is None
    assert did_you_mean(["a", "`b` of T"]) == "did you mean `a` or `b` of T?"


def test_text_is_shown_on_one_line() -> None:
    assert shorten("a\n  b\t c") == "a b c"
    assert shorten("a\x1b[31mb") == "a�[31mb"
    assert shorten("x" * 70) == "x" * 59 + "…"
    assert shorten("x" * 60) == "x" * 60
