"""Tokenizer of the expression language.

Characters of printed formulas are translated: ``½·m·ẋ²`` is ``(1/2)*m*x'^2``.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from functools import cache
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
    """A range of the text: a token or a tree."""

    @property
    def start(self) -> int:
        """The first character."""

    @property
    def end(self) -> int:
        """The offset after the last character."""


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


_DECIMAL = re.compile(r"\s*[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?\s*")


def is_number(text: str) -> bool:
    """Whether a text is a number, not an expression."""
    return _DECIMAL.fullmatch(text) is not None


def decimal(text: str) -> float | None:
    """Return the number that a text denotes in model files and tables; None for any other text.

    Spellings that only programming languages know, such as ``1_0``, ``infinity`` and digits of
    other scripts, are not numbers.
    """
    return float(text) if _DECIMAL.fullmatch(text) else None


#: Characters equivalent to a character of the language.
_SAME = str.maketrans("·⋅∙×÷−–′’", "****/--''")
_SAME_MARKS = {"≤": "<=", "≥": ">=", "≠": "!="}
_POWER_DIGITS = "⁰¹²³⁴⁵⁶⁷⁸⁹"
_POWERS = str.maketrans(_POWER_DIGITS, "0123456789")
_FRACTIONS = "¼½¾⅐⅑⅒⅓⅔⅕⅖⅗⅘⅙⅚⅛⅜⅝⅞"
#: Accents over a letter: first and second time derivative.
_DOTS = {"\u0307": 1, "\u0308": 2}
#: Letters of alphabets that look like second derivatives.
_LETTERS = frozenset("äëïöüÿÄËÏÖÜŸϊϋΪΫ")

#: Characters before the dot of a component: ``R[1].x``, ``omega(R).x``, ``r'.x``.
_BEFORE_DOT = r"(?<=[\])'])"
_NUMBER = r"(?:[0-9]++(?:\.(?!\.)[0-9]*+)?|(?<![\])'])\.[0-9]++)(?:[eE][+-]?[0-9]++)?"
#: Component of a quaternion: ``e.0``.
_PART = r"[0-3](?:_d?dot)?(?![\w.])"
#: suffixes of members: Qc.rod[2].x[3], x[3]_dot and e[1].0_dot
_AFTER_MEMBER = rf"{_BEFORE_DOT}\.(?=[^\W\d_]|{_PART})|(?<=[\]0-3])_d?dot(?!\w)"
_MARK = rf"\*\*|<=|>=|==|!=|\.\.|[-+*/^()\[\],<>=']|{_AFTER_MEMBER}"
_PRINTED = rf"⁻?[{_POWER_DIGITS}]+|[{_FRACTIONS}]|[{''.join(_SAME_MARKS)}″]"


@cache
def _token(ascii: bool) -> re.Pattern[str]:
    """Return the pattern of a token: for ASCII text one that is compiled in a third of the time."""
    other = "" if ascii else _POWER_DIGITS + _FRACTIONS  # which \w matches
    letter, more = rf"[^\W\d_{other}]", rf"[^\W{other}]*+"
    dotted = more if ascii else rf"{more}(?:[\u0307\u0308]{more})*+"
    word = rf"{letter}{dotted}(?:\.{letter}{dotted}|\.{_PART})*"
    printed = "" if ascii else f"|(?P<printed>{_PRINTED})"
    return re.compile(rf"\s*+(?:(?P<number>{_NUMBER})|(?P<name>{word})|(?P<mark>{_MARK}){printed})")


_BLANK = re.compile(r"\s*")
_PRIME = "use the plain apostrophe `'` for a time derivative"
_GROUP = "group with parentheses ( )"
_HINTS = {
    "—": "use the plain hyphen `-` for minus",
    "‘": _PRIME,
    "`": _PRIME,
    "√": "write a root as `sqrt(x)`",
    "⁄": "write a quotient as `a/b`",
    "•": "write a product as `a*b`",
    **dict.fromkeys(
        "₀₁₂₃₄₅₆₇₈₉", "write an index as in `x_1`, the member of a family as in `x[1]`"
    ),
    "∞": "a number must be finite",
    "°": "an angle in degrees is a value with a unit: `30 deg`",
    "|": "write an absolute value as `abs(x)`",
    "{": _GROUP,
    "}": _GROUP,
    ";": "separate arguments with commas",
    "%": "write percent as a number, 0.05",
    "&": "write `and`",
    "!": "write `not`",
    "~": "`~` is null in YAML; give an expression",
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
    tokens: list[Token] = []
    position = start
    plain = text if text.isascii() else text.translate(_SAME)
    match_token = _token(plain.isascii()).match
    while match := match_token(plain, position):
        kind = match.lastgroup
        assert kind is not None
        token, position = match[kind], match.end()
        begin = position - len(token)
        if token.isascii():
            tokens.append(Token(kind, token, begin, position))
        elif kind == "printed":
            tokens.extend(_printed(token, begin, position))
        else:
            name, primes = without_dots(token)
            foreign = _first_invalid(name.replace(".", "_"))
            if foreign is not None:
                raise _unexpected(text, begin + foreign)
            tokens.append(Token(kind, name, begin, position))
            tokens.extend([Token("mark", "'", position, position)] * primes)
    rest = _BLANK.match(text, position)
    assert rest is not None
    if rest.end() < len(text):
        raise _unexpected(text, rest.end())
    tokens.append(Token("end", "", len(text), len(text)))
    return tokens


def _printed(token: str, start: int, end: int) -> Iterator[Token]:
    """Yield the tokens that a power, a fraction, a comparison or a double prime represents."""
    if token == "″":
        yield Token("mark", "'", start, end)
        yield Token("mark", "'", end, end)
    elif token in _SAME_MARKS:
        yield Token("mark", _SAME_MARKS[token], start, end)
    elif token in _FRACTIONS:
        over, _, under = unicodedata.normalize("NFKC", token).partition("⁄")
        yield Token("mark", "(", start, end)
        yield Token("number", over, start, end)
        yield Token("mark", "/", start, end)
        yield Token("number", under, start, end)
        yield Token("mark", ")", start, end)
    else:
        yield Token("mark", "^", start, end)
        if token[0] == "⁻":
            yield Token("mark", "-", start, end)
        yield Token("number", token.lstrip("⁻").translate(_POWERS), start, end)


def without_dots(name: str) -> tuple[str, int]:
    """Return a name without the dots over a letter, and the derivative that they represent.

    ``ẋ_A`` is the first derivative of ``x_A``; ``ä`` is a letter.
    """
    if name.isascii():
        return name, 0
    letters, primes = "", 0
    for char in name:
        decomposed = char if char in _LETTERS else unicodedata.normalize("NFD", char)
        rest = "".join(c for c in decomposed if c not in _DOTS)
        primes += sum(_DOTS.get(c, 0) for c in decomposed)
        letters += char if rest == decomposed else rest
    return letters, primes


def words(text: str) -> list[str]:
    """Return the words of a text that may be intended as names."""
    return re.findall(r"[^\W\d]\w*", text)


_GROUPED = r"[0-9]+(?:_[0-9]+)+"
_SPECIAL = r"[+-]?\.(?:inf|nan)\b"


def _unexpected(text: str, at: int) -> ExpressionError:
    """Return the error for an invalid character, with its likely meaning."""
    for grouped in re.finditer(_GROUPED, text):
        if grouped.start() <= at < grouped.end():
            plain = grouped[0].replace("_", "")
            return ExpressionError(
                "syntax",
                f"`{grouped[0]}` is not a number",
                *grouped.span(),
                f"write the digits without `_`: {plain}",
            )
    if special := re.compile(_SPECIAL, re.IGNORECASE).match(text, at):
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
