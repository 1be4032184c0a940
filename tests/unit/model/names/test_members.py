"""Names of members of families, and their ranges in messages."""

from __future__ import annotations

import pytest

from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.trees import IndexedSumExpr, Name
from lagcli.model.names.members import (
    MAX_MEMBERS,
    IndexEvaluator,
    family_of,
    form_errors,
    format_members,
    indices_of,
    names_in,
    with_indices,
)


def test_indices_fill_the_brackets_in_order() -> None:
    assert with_indices("Qc.rod[].x[]", (2, 3)) == "Qc.rod[2].x[3]"
    assert with_indices("y", ()) == "y"
    assert with_indices("u[,]", (1, 2)) == "u[1,2]"
    assert with_indices("r[].x", (4,)) == "r[4].x"


def test_a_member_has_an_index_and_a_family() -> None:
    assert (indices_of("x[-3]"), family_of("x[-3]")) == ((-3,), "x[]")
    assert (indices_of("x"), family_of("x")) == ((), "x")
    assert (indices_of("u[2,-3]"), family_of("u[2,-3]")) == ((2, -3), "u[,]")
    assert (indices_of("r[2].x"), family_of("r[2].x")) == ((2,), "r[].x")


@pytest.mark.parametrize(
    ("indices", "shown"),
    [
        ((3, 1, 2), "`x[1..3]`"),
        ((0, 2, 3, 9), "`x[0]`, `x[2..3]`, `x[9]`"),
        ((-1, 0, 5), "`x[-1..0]`, `x[5]`"),
        (range(0, 12, 2), "`x[0]`, `x[2]`, `x[4]`, `x[6]`, …"),
    ],
)
def test_members_are_shown_as_ranges(indices, shown: str) -> None:
    assert format_members("x", [f"x[{k}]" for k in indices]) == shown


def test_members_with_two_indices_are_shown_as_ranges() -> None:
    assert format_members("u", ["u[1,2]", "u[2,2]", "u[1,3]", "u[2,3]"]) == "`u[1..2, 2..3]`"


def parameter(name: Name) -> int:
    if name.text != "N":
        raise ExpressionError("unknown-name", f"no `{name.text}`", name.start, name.end)
    return 7


INDICES = IndexEvaluator({"i": 3}, parameter)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("i", 3),
        ("N - i - 1", 3),
        ("2*i/3", 2),
        ("N/2 + 1/2", 4),  # exact
        ("2^i", 8),
        ("floor(N/2) + ceil(N/2)", 7),
        ("min(i, N)*max(1, 2) - abs(-4)", 2),
        ("floor(pi)", 3),
    ],
)
def test_values(text: str, value: int) -> None:
    assert INDICES.at(parse(text)) == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("N/2", "an index is a whole number, not 3.5"),
        ("i/0", "division by zero"),
        ("10^9 + 1", "too large"),
        ("2^-1", "not a valid index"),
        ("10^61", "not a valid index"),
        ("sin(i)", "not allowed in an index"),
        ("floor(1, 2)", "wrong number of arguments"),
        ("q", "no `q`"),
    ],
)
def test_values_that_are_none(text: str, message: str) -> None:
    with pytest.raises(ExpressionError) as error:
        INDICES.at(parse(text))
    assert message in error.value.message


def span(text: str) -> range:
    tree = parse(f"sum(x, k = {text})")
    assert isinstance(tree, IndexedSumExpr)
    return INDICES.range(tree.range)


def test_ranges_have_both_ends_and_may_be_empty() -> None:
    assert list(span("i..N - 2")) == [3, 4, 5]
    assert list(span("1..0")) == []
    assert len(span(f"1..{MAX_MEMBERS}")) == MAX_MEMBERS
    with pytest.raises(ExpressionError) as error:
        span(f"0..{MAX_MEMBERS}")
    assert "is too long" in error.value.message


def test_the_form_is_checked_without_values() -> None:
    assert list(form_errors(parse("2*(i + N)^2 + floor(q/2)"))) == []
    (error,) = form_errors(parse("1 + sin(i)"))
    assert (error.start, error.end) == (4, 10)
    assert [name.text for name in names_in(parse("i + N*max(q, 2)"))] == ["i", "N", "q"]
