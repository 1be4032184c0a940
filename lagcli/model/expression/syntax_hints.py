"""Error messages for unexpected tokens after a complete expression."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fractions import Fraction

from lagcli.functions import FUNCTIONS
from lagcli.model.expression.tokens import ExpressionError, Token
from lagcli.model.expression.units import is_unit, to_si

#: Keywords of conditionals in other languages.
_CHOICE = frozenset({"if", "when", "then", "else", "otherwise"})
_PARTS = (
    re.compile(r"(?P<a>.+?) (?:if|when) (?P<condition>.+?) (?:else|otherwise) (?P<b>.+)"),
    re.compile(r"if (?P<condition>.+?) then (?P<a>.+?) else (?P<b>.+)"),
)
_VELOCITY = re.compile(r"[^\W\d][\w.\[\],]*'+$")
_TERM = re.compile(r"[^<>=,+-]+")
_END = re.compile(r"(?<=[\w°)])(?!\w)")
_LONGEST = 60  # maximum number of characters of a conditional that is rewritten


def unexpected_token(tokens: Sequence[Token], at: int, text: str) -> ExpressionError:
    """Return the error for an unexpected token, given the tokens and the whole expression."""
    before, token, after = tokens[max(0, at - 1)], tokens[at], tokens[at + 1]
    if word := next((x for x in (token, before) if x.text in _CHOICE), None):
        return _fail(f"`{word.text}` is not allowed here", word, choice(text))
    if token.text == "=":
        return _fail(
            "an equation is not allowed here",
            token,
            "give only the expression; use `==` in conditions of if()",
        )
    if token.kind in ("name", "number") or token.text in ("(", "["):
        return _no_operator(before, token, text)
    if token.text == ",":
        return _stray_comma(before, token, after)
    if token.text in (")", "]"):
        return _fail(f"this `{token.text}` has no opening bracket", token, "remove it")
    if token.text == "'":
        return _fail(
            "a prime must directly follow a name",
            token,
            "define the expression under `definitions` and add the prime to its name",
        )
    if token.text == "..":
        return _fail(
            "a range is not allowed here", token, "an indexed sum is written `sum(x[i], i = 1..N)`"
        )
    return _fail(f"unexpected `{token.text}`", token)


def choice(text: str) -> str:
    """Return how to write a conditional that uses the syntax of another language."""
    text = " ".join(text[: 2 * _LONGEST].split())
    for parts in _PARTS:
        match = parts.fullmatch(text)
        if match and len(text) <= _LONGEST and _is_simple(list(match.groups())):
            return f"write a choice as `if({match['condition']}, {match['a']}, {match['b']})`"
    return "write a choice as `if(condition, a, b)`, such as `if(t < 1, F, 0)`"


def _is_simple(parts: list[str]) -> bool:
    """Whether the parts have balanced brackets and contain no conditional."""
    return all(
        part.count("(") == part.count(")")
        and part.count("[") == part.count("]")
        and _CHOICE.isdisjoint(part.split())
        for part in parts
    )


def _fail(message: str, token: Token, help_: str | None = None) -> ExpressionError:
    return ExpressionError("syntax", message, token.start, token.end, help_)


def _no_operator(before: Token, token: Token, text: str) -> ExpressionError:
    # the text itself, as `½` and `x²` are several tokens
    left = text[before.start : before.end] or before.text
    right = text[token.start : token.end]
    velocity = _VELOCITY.search(text, 0, before.end) if before.text == "'" else None
    left = velocity[0] if velocity else left
    if right == "[":
        help_ = f"write the member of a family as `{left}[1]`" if before.kind == "name" else None
        if before.text == "'":  # of a name with dots
            help_ = "write the velocity of a member as `x[1]'`"
        return _fail("an index must directly follow a name", token, help_)
    if before.kind == "number" and token.kind == "number":
        message, help_ = "two numbers without an operator between them", None
    elif before.kind == "number" and token.text == "(" and right != "(":
        message = f"`{left}{right}` is not a number"
        help_ = f"write a mixed number as a sum, `({left} + {right})`"
    else:
        message = f"an operator is missing between `{left}` and `{right}`"
        factors = ("(…)" if x in ("(", ")") else x for x in (left, right))
        help_ = f"write a product as `{'*'.join(factors)}`"
        if left in FUNCTIONS:
            help_ = f"write a function as `{left}({right})`"
        elif velocity and token.kind == "number":
            help_ = f"write a power as `{left}^{right}`, a product as `{left}*{right}`"
        elif before.kind == "number" and (unit := _unit_at(text, token.start)):
            of_names = f"if `{right}` is a name and not a unit, {help_}"
            help_ = _without_unit(before.text, unit, of_names)
    return ExpressionError("syntax", message, before.start, token.end, help_)


def _unit_at(text: str, start: int) -> str | None:
    """Return the longest unit at a position, within a term: of ``m/s*x`` the first three."""
    match = _TERM.match(text, start)
    if match is None:
        return None
    ends = [end.start() for end in _END.finditer(match[0])]
    units = (match[0][:end].strip() for end in reversed(ends))
    return next(filter(is_unit, units), None)


def _without_unit(number: str, unit: str, product: str) -> str:
    """Return how to write a number with a unit in an expression."""
    factor, value = to_si(unit), Fraction(number)
    exact = float(value * factor) if isinstance(factor, Fraction) else float(value) * factor
    si = number if factor == 1 else f"{exact:.15g}"
    return (
        f"numbers in expressions are in SI: write {number} {unit} as `{si}`, or give it a name and"
        f" its unit under `parameters`;\n{product}"
    )


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
    return _fail("unexpected comma", token, "commas separate arguments of functions")
