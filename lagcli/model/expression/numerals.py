"""Numbers of the expression language: exact, within the range of doubles."""

from __future__ import annotations

import re
from fractions import Fraction

from lagcli.model.expression.tokens import ExpressionError, Token, error_at
from lagcli.model.expression.trees import NumberExpr

_DECIMAL = re.compile(r"\s*[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?\s*")
MAX_DIGITS = 400  # digits of one number
# range of decimal exponents of doubles
MAX_EXPONENT = 308
MIN_EXPONENT = -340


def read_number(token: Token, following: Token) -> NumberExpr:
    """Return the number of a token, given the token that follows.

    Raises
    ------
    ExpressionError
        The number is out of range or is not decimal.
    """
    mantissa, _, exponent = token.text.lower().partition("e")
    power = int(exponent[:9] or 0)
    if len(mantissa) > MAX_DIGITS or not MIN_EXPONENT <= power <= MAX_EXPONENT:
        raise error_at(
            "bad-number",
            "this number is beyond what a double can hold",
            token,
            f"numbers have at most {MAX_DIGITS} digits and exponents from {MIN_EXPONENT} to"
            f" {MAX_EXPONENT}",
        )
    if re.match("0[0-9]", mantissa):
        raise error_at(
            "syntax",
            f"`{token.text}` is not a number: it starts with 0",
            token,
            "remove the leading 0; dates and times are not numbers",
        )
    if following.start == token.end:
        whole = token.text + following.text
        if following.kind == "number":
            raise ExpressionError(
                "syntax",
                f"`{whole}` is not a number: it has two decimal points",
                token.start,
                following.end,
                "write one decimal point",
            )
        if re.fullmatch(r"0[xXbBoO][0-9a-fA-F]+", whole):
            raise ExpressionError(
                "syntax",
                f"`{whole}` is not a number",
                token.start,
                following.end,
                "write a decimal number",
            )
    return NumberExpr(token.start, token.end, Fraction(token.text.lower()))


def is_number(text: str) -> bool:
    """Whether a text is a number, not an expression."""
    return _DECIMAL.fullmatch(text) is not None


def decimal(text: str) -> float | None:
    """Return the number that a text denotes in model files and tables; None for any other text.

    Spellings that only programming languages know, such as ``1_0``, ``infinity`` and digits of
    other scripts, are not numbers.
    """
    return float(text) if _DECIMAL.fullmatch(text) else None
