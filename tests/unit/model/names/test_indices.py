"""Indices and ranges of families: whole numbers from parameters and indices."""

from __future__ import annotations

import pytest

from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.trees import IndexedSumExpr, Name
from lagcli.model.names.members import MAX_MEMBERS, Indices, form_errors, names_in


def parameter(name: Name) -> int:
    if name.text != "N":
        raise ExpressionError("unknown-name", f"no `{name.text}`", name.start, name.end)
    return 7


INDICES = Indices({"i": 3}, parameter)


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
