"""Counts with their nouns, and lines that keep numbers with their names and units."""

from __future__ import annotations

import pytest

from lagcli.prose import counted, wrapped


@pytest.mark.parametrize(
    ("number", "noun", "shown"),
    [
        (0, ("row",), "0 rows"),
        (1, ("row",), "1 row"),
        (2, ("row",), "2 rows"),
        (1, ("branch", "branches"), "1 branch"),
        (3, ("branch", "branches"), "3 branches"),
    ],
)
def test_nouns_follow_their_number(number: int, noun: tuple[str, ...], shown: str) -> None:
    assert counted(number, *noun) == shown


def test_lines_break_between_entries() -> None:
    text = "h_M = 5.8 mm = 0.0058 m; r_0 = 2.5 mm; x [m] -1.5; t_end -> 3 s; of 12 steps at t = 3 s"
    for width in range(24, 60):
        lines = wrapped(text, width)
        assert " ".join(lines) == text
        assert max(map(len, lines)) <= width
        for line in lines:
            assert not line.endswith((" =", "->", " 12", " t", "h_M", "r_0", " 5.8", " x"))
