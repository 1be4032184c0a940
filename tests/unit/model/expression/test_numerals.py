"""Numbers: exact values, and the errors of those that are not decimal or out of range."""

from fractions import Fraction

import pytest

from lagcli.model.expression.numerals import MAX_DIGITS, read_number
from lagcli.model.expression.tokens import ExpressionError, tokenize


def number(text: str) -> Fraction:
    """Return the number that a text begins with."""
    first, second = tokenize(text)[:2]
    return read_number(first, second).value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.1", Fraction(1, 10)),
        ("2e-3", Fraction(1, 500)),
        ("1.5E2", Fraction(150)),
        (".25", Fraction(1, 4)),
        ("0", Fraction(0)),
        ("0.0625", Fraction(1, 16)),
        ("1e308", Fraction(10) ** 308),
    ],
)
def test_numbers_are_exact(text: str, value: Fraction) -> None:
    assert number(text) == value


@pytest.mark.parametrize("text", ["1e309", "1e-341", "1" * (MAX_DIGITS + 1), "1e9999999999"])
def test_numbers_beyond_doubles(text: str) -> None:
    with pytest.raises(ExpressionError, match="beyond what a double can hold") as found:
        number(text)
    assert found.value.kind == "bad-number"
    assert (found.value.start, found.value.end) == (0, len(text))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("007", "starts with 0"),
        ("1.2.3", "two decimal points"),
        ("0x1F", "`0x1F` is not a number"),
        ("0b10", "`0b10` is not a number"),
    ],
)
def test_numbers_that_are_not_decimal(text: str, message: str) -> None:
    with pytest.raises(ExpressionError, match=message):
        number(text)
