"""Values of formulas as `derive` prints them: read from the text alone."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Mapping

_RAISED = {ord(a): b for a, b in zip("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789", strict=True)}
_FRACTIONS = "½⅓⅔¼¾⅕⅖⅗⅘⅙⅚⅛⅜⅝⅞"
_FUNCTIONS = {"sin": math.sin, "cos": math.cos, "tan": math.tan, "√": math.sqrt}
_TOKEN = re.compile(
    r"\s*(?:(?P<number>[⁰¹²³⁴⁵⁶⁷⁸⁹]+⁄[₀-₉]+|\d+(?:\.\d+)?|[" + _FRACTIONS + r"])"
    r"|(?P<power>[⁰¹²³⁴⁵⁶⁷⁸⁹]+|\^\(\d+/\d+\))"
    r"|(?P<name>√|[^\W\d⁰¹²³⁴⁵⁶⁷⁸⁹" + _FRACTIONS + r"]\u0307?\u0308?"
    r"(?:[^\W⁰¹²³⁴⁵⁶⁷⁸⁹" + _FRACTIONS + r"]|\.)*)"
    r"|(?P<sign>[-+−/()\[\]{}]))"
)


def printed_value(text: str, values: Mapping[str, float]) -> float:
    """Return the value of a formula.

    Parameters
    ----------
    text : str
        Products have spaces between their factors; ``a b/c`` divides by ``c`` alone.
    values : mapping of str to float
        Of all names as they are printed: φ, φ̇, λ_guide, m₁.
    """
    reader = _Reader(text, {unicodedata.normalize("NFC", k): v for k, v in values.items()})
    found = reader.sum()
    assert reader.kind is None, text
    return found


class _Reader:
    def __init__(self, text: str, values: Mapping[str, float]):
        self.text, self.values = unicodedata.normalize("NFC", text).strip(), values
        self.at, self.kind, self.token = 0, None, ""
        self._next()

    def _next(self) -> None:
        if self.at >= len(self.text):
            self.kind, self.token = None, ""
            return
        match = _TOKEN.match(self.text, self.at)
        assert match, self.text[self.at :]
        self.at = match.end()
        self.kind = match.lastgroup
        self.token = match[match.lastgroup]

    def sum(self) -> float:
        total, sign = 0.0, 1
        if self.token == "−":
            sign = -1
            self._next()
        while True:
            total += sign * self.product()
            if self.token not in ("+", "−"):
                return total
            sign = 1 if self.token == "+" else -1
            self._next()

    def product(self) -> float:
        total = self.factor()
        while self.kind in ("number", "name") or self.token in ("(", "[", "{", "/"):
            if self.token == "/":
                self._next()
                total /= self.factor()
            else:
                total *= self.factor()
        return total

    def factor(self) -> float:
        kind, token = self.kind, self.token
        self._next()
        if kind == "number":
            return self.raised(_number(token))
        if token in _FUNCTIONS:
            power = self.power()
            return _FUNCTIONS[token](self.factor() if token == "√" else self.argument()) ** power
        if kind == "name":
            return self.raised(self.values[token])
        assert token in "([{", token
        inside = self.sum()
        assert self.token == {"(": ")", "[": "]", "{": "}"}[token]
        self._next()
        return self.raised(inside)

    def argument(self) -> float:
        """Return the argument of a function: in parentheses, or one name."""
        if self.kind == "name":
            found = self.values[self.token]
        else:
            assert self.token == "("
            self._next()
            found = self.sum()
            assert self.token == ")"
        self._next()
        return found

    def raised(self, base: float) -> float:
        return base ** self.power()

    def power(self) -> float:
        if self.kind != "power":
            return 1
        token = self.token
        self._next()
        if token.startswith("^"):
            top, bottom = token[2:-1].split("/")
            return int(top) / int(bottom)
        return int(token.translate(_RAISED))


def _number(token: str) -> float:
    if token in _FRACTIONS:
        return unicodedata.numeric(token)
    if "⁄" in token:
        top, bottom = token.split("⁄")
        return int(top.translate(_RAISED)) / int(unicodedata.normalize("NFKC", bottom))
    return float(token)
