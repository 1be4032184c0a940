"""Ranges of quantities: one line per family."""

from __future__ import annotations

import re

from hypothesis import given
from hypothesis import strategies as st

from lagcli.results.ranges import ValueRange, families_of, range_lines, ranges_of

NUMBERS = st.floats(allow_nan=False, width=32)


def _range(name: str, low: float | None, high: float | None, unit: str = "N") -> ValueRange:
    return ValueRange(name, unit, low, f"low of {name}", high, f"high of {name}")


def test_a_family_has_one_line_with_the_members_of_its_ends() -> None:
    rods = [_range(f"lambda.rod[{i}]", -i, 10.0 - i) for i in range(1, 61)]
    (found,) = families_of(rods)
    assert found == (
        *("lambda.rod[1..60]", "N", -60, "rod[60], low of lambda.rod[60]"),
        *(9.0, "rod[1], high of lambda.rod[1]"),
    )


def test_families_differ_by_unit_and_lack_no_member() -> None:
    names = ["a[1]", "a[2]", "a[4]", "b[1]", "b[2]", "k[1,1]", "k[1,2]", "k[2,1]", "k[2,2]"]
    names += ["d[1,1]", "d[1,2]", "d[2,1]", "p", "2[x]"]
    shown = [x.name for x in families_of(_range(n, 0, 1) for n in names)]
    assert shown == [
        *("a[1..2, 4]", "b[1]", "b[2]", "k[1..2,1..2]", "d[1,1]", "d[1,2]", "d[2,1]", "p", "2[x]"),
    ]
    mixed = [_range(f"a[{i}]", 0, 1, unit) for i in range(3) for unit in ("N", "N*m")]
    assert [(x.name, x.unit) for x in families_of(mixed)] == [("a[0..2]", "N"), ("a[0..2]", "N*m")]


@given(st.lists(st.tuples(NUMBERS, NUMBERS), min_size=3, max_size=30))
def test_the_ends_are_those_of_the_members(values: list[tuple[float, float]]) -> None:
    members = [_range(f"r[{i}]", *sorted(x)) for i, x in enumerate(values)]
    (family,) = families_of(members)
    assert family.low == min(min(x) for x in values)
    assert family.high == max(max(x) for x in values)
    at = {x.name: x for x in members}
    low, high = family.low_at.split(",")[0], family.high_at.split(",")[0]
    assert (at[low].low, at[high].high) == (family.low, family.high)


def test_a_quantity_without_values_has_a_dash() -> None:
    empty = {"min": None, "t_min": None, "max": None, "t_max": None}
    some = {"min": 1.0, "t_min": 0.0, "max": 2.0, "t_max": 3.0}
    unknown = ranges_of({"a": empty, "b": some}, {"b": "N"})
    assert range_lines(unknown, 80) == ["a      -", "b [N]  1 (0 s) … 2 (3 s)"]
    family = ranges_of({"c[1]": empty, "c[2]": some, "c[3]": empty}, {})
    assert range_lines(family, 80) == ["c[1..3]  1 (c[2], 0 s) … 2 (c[2], 3 s)"]
    assert range_lines([], 80) == []


@given(
    st.lists(st.tuples(st.text("ab[1]", max_size=40), NUMBERS), max_size=6), st.integers(60, 120)
)
def test_lines_are_aligned_and_fit(rows: list[tuple[str, float]], columns: int) -> None:
    lines = range_lines([_range(n, x, x)._replace(low_at="1 s", high_at="2 s") for n, x in rows],
                        columns, 4)  # fmt: skip
    assert all(len(line) <= columns for line in lines)
    ends = {line.index(" (1 s)") for line in lines if " (1 s)" in line}
    assert len(ends) <= 1
    if lines and "…" in lines[0] and "min" not in lines[0]:
        assert all(re.search(r"\(1 s\) … ", line) for line in lines)
