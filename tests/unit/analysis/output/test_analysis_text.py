"""Lines that analyses print."""

from __future__ import annotations

from lagcli.analysis.output.text import entry, listed, width, without_rounding


def test_long_texts_continue_below_their_own_beginning() -> None:
    lines = entry("q", ", ".join(["alpha = 1.25"] * 12), indent=4)
    assert len(lines) > 1
    assert max(map(len, lines)) <= width()
    start = lines[0].index("alpha")
    assert lines[0].startswith("    q ")
    assert all(line[:start].isspace() and not line[start].isspace() for line in lines[1:])
    assert entry("q", "") == ["  q        "]


def test_of_many_items_the_first_are_listed() -> None:
    items = [str(i) for i in range(5)]
    assert listed(items, most=5) == "0, 1, 2, 3, 4"
    assert listed(items, most=3) == "0, 1, 2, and 2 more (--json)"


def test_what_is_rounding_beside_the_largest_is_zero() -> None:
    found = without_rounding({"a": -2.0, "b": 1e-13, "c": 1e-12})
    assert found == {"a": -2.0, "b": 0.0, "c": 1e-12}
    assert without_rounding({"a": 1e-30}) == {"a": 1e-30}
    assert without_rounding({}) == {}
