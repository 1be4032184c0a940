"""What follows an expression that is complete without it: what may have been meant."""

from __future__ import annotations

import re

from lagcli.model.expression.functions import FUNCTIONS
from lagcli.model.expression.tokens import ExpressionError, Token

#: Words of other languages between the parts of a choice.
_CHOICE = frozenset({"if", "when", "then", "else", "otherwise"})
_PARTS = (
    re.compile(r"(?P<a>.+?) (?:if|when) (?P<condition>.+?) (?:else|otherwise) (?P<b>.+)"),
    re.compile(r"if (?P<condition>.+?) then (?P<a>.+?) else (?P<b>.+)"),
)
_LONGEST = 60  # characters of a choice that is written anew


def leftover(before: Token, token: Token, after: Token, text: str) -> ExpressionError:
    """Return the error of a token that the grammar has no room for, between its neighbours.

    ``text`` is the whole expression.
    """
    if word := next((x for x in (token, before) if x.text in _CHOICE), None):
        return _fail(f"`{word.text}` cannot stand here", word, choice(text))
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


def choice(text: str) -> str:
    """Return how a choice is written that the text writes as in another language."""
    text = " ".join(text[: 2 * _LONGEST].split())
    for parts in _PARTS:
        found = parts.fullmatch(text)
        if found and len(text) <= _LONGEST and _is_simple(list(found.groups())):
            return f"write a choice as `if({found['condition']}, {found['a']}, {found['b']})`"
    return "write a choice as `if(condition, a, b)`, such as `if(t < 1, F, 0)`"


def _is_simple(parts: list[str]) -> bool:
    """Whether no part is cut inside brackets or holds a choice itself."""
    return all(
        part.count("(") == part.count(")")
        and part.count("[") == part.count("]")
        and _CHOICE.isdisjoint(part.split())
        for part in parts
    )


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
