"""Listings: names stay with their values and units, families are named once."""

from __future__ import annotations

import pytest

from lagcli.results.listing import distinct_numbers, entry, folded, pairs, wrapped


@pytest.mark.parametrize(
    "whole", ["psi = 0.1 rad", "x[2] [m]", "rod[1] -4.905", "0.1 -> 0.16", "12 steps", "at t = 2 s"]
)
def test_what_belongs_together_is_not_broken(whole):
    text = f"some words, {whole}, and others"
    for width in range(len(whole) + 1, len(text) + 1):
        lines = wrapped(text, width)
        assert " ".join(lines) == text
        assert any(whole in line for line in lines)
        assert max(map(len, lines)) <= width


def test_numbers_that_differ_are_distinguished():
    assert distinct_numbers(0.1, 0.16057) == ("0.1", "0.16057")
    assert distinct_numbers(0.5, 0.5 + 1e-9) == ("0.5", "0.500000001")
    assert distinct_numbers(0.1, 0.1 + 2e-17) == ("0.10000000000000001", "0.10000000000000002")


def test_members_with_the_same_value_are_named_once():
    names = [(f"m[{i}]", " = 2") for i in range(1, 5)]
    assert folded([*names, ("m[5]", " = 3"), ("g", " = 9.81")]) == [
        "m[1..4] = 2",
        "m[5] = 3",
        "g = 9.81",
    ]
    assert folded([("a[1]", ""), ("a[2]", ""), ("a[4]", "")]) == ["a[1]", "a[2]", "a[4]"]
    assert folded([("r[1].x", ""), ("r[2].x", ""), ("r[3].x", "")]) == ["r[1..3].x"]


def test_units():
    assert pairs({"N": 3, "l": 0.5}, {"N": "1", "l": "m"}) == "N = 3, l = 0.5 m"


def test_of_very_many_entries_the_first_are_shown():
    text = pairs({f"x[{i}]": float(i) for i in range(100)})
    assert text.endswith("x[23] = 23, … 76 more (--json)")


def test_a_word_that_is_longer_than_a_line_is_broken():
    lines = entry("file", "x" * 50, 8, 28)
    assert lines == ["file    " + "x" * 20, " " * 8 + "x" * 20, " " * 8 + "x" * 10]
