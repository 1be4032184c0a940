"""Tokenizer of the expression language."""

from __future__ import annotations

import re
from typing import NamedTuple, Protocol


class ExpressionError(Exception):
    """Syntax or name error in an expression.

    Parameters
    ----------
    kind, message, help : str
        As in a Diagnostic.
    start, end : int
        Offsets in the expression's text.
    subject : str, optional
        Subject of the error; errors with the same kind and subject are reported once.
    """

    def __init__(
        self,
        kind: str,
        message: str,
        start: int,
        end: int,
        help: str | None = None,
        subject: str | None = None,
    ):
        super().__init__(message)
        self.kind, self.message, self.start, self.end = kind, message, start, end
        self.help, self.subject = help, subject


class Span(Protocol):
    """What has offsets in the text: a token, a tree."""

    @property
    def start(self) -> int:
        """The first character."""

    @property
    def end(self) -> int:
        """The place after the last one."""


def error_at(
    kind: str, message: str, place: Span, help: str | None = None, subject: str | None = None
) -> ExpressionError:
    """Return the error at a token or a tree; see `ExpressionError`."""
    return ExpressionError(kind, message, place.start, place.end, help, subject)


class Token(NamedTuple):
    """A number, a name, a mark, or the end of the text."""

    kind: str
    text: str
    start: int
    end: int


def is_name(text: str) -> bool:
    """Whether a text is a name: a letter followed by letters, digits and ``_``."""
    return bool(text) and text[0].isalpha() and _first_invalid(text) is None


def _first_invalid(text: str) -> int | None:
    """Return the offset of the first character not allowed in names, such as ², ½ and ٣."""
    for i, char in enumerate(text):
        if not (char == "_" or char.isalpha() or char in "0123456789"):
            return i
    return None


_NUMBER = r"(?:[0-9]++(?:\.(?!\.)[0-9]*+)?|\.[0-9]++)(?:[eE][+-]?[0-9]++)?"
_WORD = r"[^\W\d_]\w*(?:\.[^\W\d_]\w*)*"
#: suffixes of members: Qc.rod[2].x[3] and x[3]_dot
_AFTER_MEMBER = r"(?<=\])\.(?=[^\W\d_])|(?<=\])_d?dot(?!\w)"
_MARK = rf"\*\*|<=|>=|==|!=|\.\.|[-+*/^()\[\],<>=']|{_AFTER_MEMBER}"
_TOKEN = re.compile(rf"\s*+(?:(?P<number>{_NUMBER})|(?P<name>{_WORD})|(?P<mark>{_MARK}))")
_BLANK = re.compile(r"\s*")
_MINUS = "use the plain hyphen `-` for minus"
_PRIME = "use the plain apostrophe `'` for a time derivative"
_PRODUCT = "write a product as `a*b`"
_GROUP = "group with parentheses ( )"
_HINTS = {
    "²": "write a power as `x^2`",
    "³": "write a power as `x^3`",
    "½": "write `1/2`",
    "·": _PRODUCT,
    "×": _PRODUCT,
    "∙": _PRODUCT,
    "⋅": _PRODUCT,
    "÷": "write a quotient as `a/b`",
    "−": _MINUS,
    "–": _MINUS,
    "—": _MINUS,
    "’": _PRIME,
    "′": _PRIME,
    "‘": _PRIME,
    "`": _PRIME,
    "√": "write a root as `sqrt(x)`",
    "≤": "write `<=`",
    "≥": "write `>=`",
    "≠": "write `!=`",
    "∞": "a number must be finite",
    "°": "an angle in degrees is a value with a unit: `30 deg`",
    "|": "write an absolute value as `abs(x)`",
    "{": _GROUP,
    "}": _GROUP,
    ";": "separate arguments with commas",
    "%": "write percent as a number, 0.05",
    "&": "write `and`",
    "!": "write `not`",
    "~": "`~` means nothing in YAML; give an expression",
    "?": "write a choice as `if(condition, a, b)`",
    ":": "a time such as 12:30 is not a number: give seconds",
    ".": "a number needs a digit before or after its point",
    "_": "a name starts with a letter",
    "$": "write `m`, not `$m`",
    "\\": "write `alpha`, not `\\alpha`",
    "#": "in YAML, a comment needs a space before the #",
    "'": "a prime follows a name",
    '"': "quote the whole value or nothing",
}


def tokenize(text: str, start: int = 0) -> list[Token]:
    """Split an expression, ``text[start:]``, into tokens, the end included.

    Raises
    ------
    ExpressionError
        At the first invalid character.
    """
    tokens, position = [], start
    while match := _TOKEN.match(text, position):
        kind = match.lastgroup
        assert kind is not None
        token, position = match[kind], match.end()
        if kind == "name" and not token.isascii():
            foreign = _first_invalid(token.replace(".", "_"))
            if foreign is not None:
                raise _unexpected(text, match.start(kind) + foreign)
        tokens.append(Token(kind, token, position - len(token), position))
    rest = _BLANK.match(text, position)
    assert rest is not None
    if rest.end() < len(text):
        raise _unexpected(text, rest.end())
    tokens.append(Token("end", "", len(text), len(text)))
    return tokens


def words(text: str) -> list[str]:
    """Return the words of a text that may be meant as names."""
    return re.findall(r"[^\W\d]\w*", text)


_GROUPED = re.compile(r"[0-9]+(?:_[0-9]+)+")
_SPECIAL = re.compile(r"[+-]?\.(?:inf|nan)\b", re.IGNORECASE)


def _unexpected(text: str, at: int) -> ExpressionError:
    """Return the error for an invalid character, with its likely meaning."""
    for grouped in _GROUPED.finditer(text):
        if grouped.start() <= at < grouped.end():
            plain = grouped[0].replace("_", "")
            return ExpressionError(
                "syntax",
                f"`{grouped[0]}` is not a number",
                *grouped.span(),
                f"write the digits without `_`: {plain}",
            )
    if special := _SPECIAL.match(text, at):
        return ExpressionError(
            "syntax",
            f"`{special[0]}` is not allowed in a model",
            *special.span(),
            "numbers must be finite",
        )
    char = text[at]
    shown = f"`{char}`" if char.isprintable() else f"the invisible character U+{ord(char):04X}"
    help_ = _HINTS.get(char) if char.isprintable() else "remove it"
    return ExpressionError("syntax", f"unexpected {shown}", at, at + 1, help_)
