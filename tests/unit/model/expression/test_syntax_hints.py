"""Errors at tokens after a complete expression: what was meant, and how it is written."""

import pytest

from lagcli.model.expression.syntax_hints import choice, unexpected_token
from lagcli.model.expression.tokens import ExpressionError, tokenize


def error(text: str, at: int) -> ExpressionError:
    """Return the error at a token of a text, by its number."""
    return unexpected_token(tokenize(text), at, text)


@pytest.mark.parametrize(
    ("text", "at", "span", "message", "help_"),
    [
        ("sin x", 1, (0, 5), "an operator is missing between `sin` and `x`", "as `sin(x)`"),
        ("3 x", 1, (0, 3), "an operator is missing between `3` and `x`", "as `3*x`"),
        ("(a) x", 3, (2, 5), "an operator is missing between `)` and `x`", "as `(…)*x`"),
        ("0.66 m", 1, (0, 6), "missing between `0.66` and `m`", "write 0.66 m as `0.66`, or"),
        ("500 ms", 1, (0, 6), "missing between `500` and `ms`", "write 500 ms as `0.5`, or"),
        ("2 N*mm + 1", 1, (0, 3), "missing between `2` and `N`", "write 2 N*mm as `0.002`, or"),
        ("(1 + t/1s)", 6, (7, 9), "missing between `1` and `s`", "write 1 s as `1`, or"),
        ("0.5 km/h*x", 1, (0, 6), "missing between `0.5` and `km`", "write 0.5 km/h as `0.1388"),
        ("2 mm sin(x)", 1, (0, 4), "missing between `2` and `mm`", "write 2 mm as `0.002`, or"),
        ("2 3", 1, (0, 3), "two numbers without an operator between them", None),
        ("1,5", 1, (0, 3), "`1,5` is not a number", "as a dot: `1.5`"),
        ("a, b", 1, (1, 2), "unexpected comma", "separate arguments"),
        ("x)", 1, (1, 2), "this `)` has no opening bracket", "remove it"),
        ("x = 2", 1, (2, 3), "an equation is not allowed here", "use `==`"),
        ("1 .. 2", 1, (2, 4), "a range is not allowed here", "sum(x[i], i = 1..N)"),
        ("x [1]", 1, (2, 3), "an index must directly follow a name", "as `x[1]`"),
        ("a if b", 1, (2, 4), "`if` is not allowed here", "write a choice as"),
    ],
)
def test_unexpected_tokens(
    text: str, at: int, span: tuple[int, int], message: str, help_: str | None
) -> None:
    found = error(text, at)
    assert (found.start, found.end) == span
    assert str(found).endswith(message)
    assert (found.help is None) if help_ is None else (help_ in (found.help or ""))


def test_the_first_token_has_nothing_before_it() -> None:
    assert str(error(")", 0)) == "this `)` has no opening bracket"


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("a if t < 1 else b", "if(t < 1, a, b)"),
        ("a when t < 1 otherwise b", "if(t < 1, a, b)"),
        ("if c then 1 else 2", "if(c, 1, 2)"),
    ],
)
def test_choices_of_other_languages_are_rewritten(text: str, written: str) -> None:
    assert choice(text) == f"write a choice as `{written}`"


@pytest.mark.parametrize("text", ["a if (b else c", "a if b else c if d else e", "if", "x" * 200])
def test_other_choices_get_an_example(text: str) -> None:
    assert choice(text).startswith("write a choice as `if(condition, a, b)`")
