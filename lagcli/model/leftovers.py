"""What follows an expression that is complete without it: what may have been meant."""

from __future__ import annotations

from lagcli.model.functions import FUNCTIONS
from lagcli.model.tokens import ExpressionError, Token


def leftover(before: Token, token: Token, after: Token) -> ExpressionError:
    """Return the error of a token that the grammar has no room for, between its neighbours."""
    if token.text == "=":
        return _fail(
            "an equation cannot stand here",
            token,
            "give the expression alone; conditions inside if() compare with `==`",
        )
    if token.kind in ("name", "number") or token.text in ("(", "["):
        return _no_operator(before, token)
    if token.text == ",":
        return _stray_comma(before, token, after)
    if token.text in (")", "]"):
        return _fail(f"this `{token.text}` closes nothing", token, "remove it")
    if token.text == "'":
        return _fail(
            "a prime can only follow a name directly",
            token,
            "name the expression under `definitions`, then prime the name",
        )
    if token.text == "..":
        return _fail(
            "a range cannot stand here", token, "a sum over an index is `sum(x[i], i = 1..N)`"
        )
    return _fail(f"unexpected `{token.text}`", token)


def _fail(message: str, token: Token, help_: str | None = None) -> ExpressionError:
    return ExpressionError("syntax", message, token.start, token.end, help_)


def _no_operator(before: Token, token: Token) -> ExpressionError:
    left, right = before.text, token.text
    if right == "[":
        help_ = f"write the member of a family as `{left}[1]`" if before.kind == "name" else None
        return _fail("an index follows a name directly", token, help_)
    if before.kind == "number" and token.kind == "number":
        message, help_ = "two numbers without an operator between them", None
    else:
        message = f"an operator is missing between `{left}` and `{right}`"
        help_ = f"write a product as `{left}*{right}`"
        if left in FUNCTIONS:
            help_ = f"write a function as `{left}({right})`"
    return ExpressionError("syntax", message, before.start, token.end, help_)


def _stray_comma(before: Token, token: Token, after: Token) -> ExpressionError:
    if before.kind == after.kind == "number":
        number = f"{before.text}.{after.text}"
        return ExpressionError(
            "syntax",
            f"`{before.text},{after.text}` is not a number",
            before.start,
            after.end,
            f"write the decimal point as a dot: `{number}`",
        )
    return _fail("a comma cannot stand here", token, "it separates arguments of functions")
