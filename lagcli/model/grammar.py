"""The grammar of expressions: text → tree.

::

    condition  := conjunction ("or" conjunction)*
    conjunction:= negation ("and" negation)*
    negation   := "not" negation | comparison
    comparison := sum (("<" | "<=" | ">" | ">=" | "==" | "!=") sum)*
    sum        := ["+" | "-"] product (("+" | "-") product)*
    product    := power (("*" | "/") power)*
    power      := ["+" | "-"] primary [("^" | "**") power]
    primary    := NUMBER | NAME "'"* | NAME "(" condition ("," condition)* ")"
                | "(" condition ")" | "[" condition ("," condition)* "]"

A sign in front of a product applies to the product's first power as a whole: -x^2 is -(x^2), and
an exponent may carry a sign: x^-2.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction

MAX_NESTING = 50  # what a person can read ends at 10; each level costs eleven Python frames
MAX_DIGITS = 400  # digits of one number
MAX_EXPONENT = 308  # of a number as written: beyond it lies no double

COMPARISONS = ("<=", ">=", "==", "!=", "<", ">")
KEYWORDS = frozenset({"and", "or", "not", "if"})


class ExpressionError(Exception):
    """A text that is not an expression, or names what is not there.

    Parameters
    ----------
    kind, message, help : str
        As in a Diagnostic.
    start, end : int
        Offsets in the expression's text.
    """

    def __init__(self, kind: str, message: str, start: int, end: int, help: str | None = None):
        super().__init__(message)
        self.kind, self.message, self.start, self.end, self.help = kind, message, start, end, help


@dataclass(frozen=True)
class Tree:
    """A piece of an expression, from ``start`` to ``end`` of its text."""

    start: int
    end: int


@dataclass(frozen=True)
class Number(Tree):
    """A number, exactly as written."""

    value: Fraction


@dataclass(frozen=True)
class Name(Tree):
    """A name with its primes; ``text`` may be dotted (``lambda.guide``)."""

    text: str
    primes: int


@dataclass(frozen=True)
class Call(Tree):
    """A function applied to arguments."""

    function: str
    arguments: tuple[Tree, ...]


@dataclass(frozen=True)
class Sum(Tree):
    """Terms with their signs, +1 or -1."""

    terms: tuple[tuple[int, Tree], ...]


@dataclass(frozen=True)
class Product(Tree):
    """Factors with their exponents, +1 or -1, from left to right."""

    factors: tuple[tuple[int, Tree], ...]


@dataclass(frozen=True)
class Power(Tree):
    """Base and exponent."""

    base: Tree
    exponent: Tree


@dataclass(frozen=True)
class Comparison(Tree):
    """A chain of comparisons: a < b <= c."""

    operands: tuple[Tree, ...]
    operators: tuple[str, ...]


@dataclass(frozen=True)
class Logical(Tree):
    """``and``, ``or``, ``not`` and what they join."""

    operator: str
    operands: tuple[Tree, ...]


@dataclass(frozen=True)
class Vector(Tree):
    """A vector of scalars, or a matrix of rows."""

    items: tuple[Tree, ...]


@dataclass(frozen=True)
class _Token:
    kind: str  # number, name, mark, end
    text: str
    start: int
    end: int


_NUMBER = re.compile(r"(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_NAME = re.compile(r"[^\W\d_]\w*(?:\.[^\W\d_]\w*)*", re.UNICODE)
_MARK = re.compile(r"\*\*|<=|>=|==|!=|[-+*/^()\[\],<>=']")
_HINTS = {
    "²": "write a power as `x^2`",
    "³": "write a power as `x^3`",
    "·": "write a product as `a*b`",
    "×": "write a product as `a*b`",
    "−": "use the plain hyphen `-` for minus",
    "–": "use the plain hyphen `-` for minus",
    "’": "use the plain apostrophe `'` for a time derivative",
    "′": "use the plain apostrophe `'` for a time derivative",
    "|": "write an absolute value as `abs(x)`",
    "{": "group with parentheses ( )",
    "}": "group with parentheses ( )",
    ";": "separate arguments with commas",
    "%": "write percent as a number, 0.05",
    "&": "write `and`",
    "!": "write `not`",
    ":": "a time such as 12:30 is not a number; write seconds",
    "_": "a name begins with a letter",
    "$": "names are written bare: `m`, not `$m`",
    "@": "the grammar has no such sign",
}


def _tokens(text: str) -> list[_Token]:
    tokens, position = [], 0
    while position < len(text):
        char = text[position]
        if char.isspace():
            position += 1
            continue
        if match := _NUMBER.match(text, position):
            tokens.append(_Token("number", match[0], position, match.end()))
        elif match := _NAME.match(text, position):
            if any(c.isdigit() and not c.isascii() for c in match[0]) or not match[0].isprintable():
                at = position + next(i for i, c in enumerate(match[0]) if not c.isascii() and c.isdigit())
                raise ExpressionError(
                    "syntax", f"unexpected `{text[at]}`", at, at + 1, _HINTS.get(text[at])
                )
            tokens.append(_Token("name", match[0], position, match.end()))
        elif match := _MARK.match(text, position):
            tokens.append(_Token("mark", match[0], position, match.end()))
        else:
            shown = char if char.isprintable() else f"U+{ord(char):04X}"
            raise ExpressionError(
                "syntax", f"unexpected `{shown}`", position, position + 1, _HINTS.get(char)
            )
        position = match.end()
    tokens.append(_Token("end", "", len(text), len(text)))
    return tokens


def parse(text: str) -> Tree:
    """Parse one expression.

    Raises
    ------
    ExpressionError
        The text is not of the grammar, or exceeds one of its bounds.
    """
    parser = _Parser(text)
    tree = parser.condition()
    parser.expect_end()
    return tree


def parse_equation(text: str) -> tuple[Tree, Tree | None]:
    """Parse ``lhs`` or ``lhs = rhs``; the right side is None where there is no ``=``."""
    parser = _Parser(text)
    left = parser.condition()
    right = None
    if parser.at("="):
        parser.advance()
        right = parser.condition()
    parser.expect_end()
    return left, right


class _Parser:
    def __init__(self, text: str):
        self.text = text
        self.tokens = _tokens(text)
        self.position = 0
        self.nesting = 0
        if self.current.kind == "end":
            raise ExpressionError("syntax", "an expression is missing", 0, 0)

    @property
    def current(self) -> _Token:
        return self.tokens[self.position]

    def advance(self) -> _Token:
        token = self.current
        self.position += 1
        return token

    def at(self, *texts: str) -> bool:
        token = self.current
        return token.text in texts and token.kind != "number"

    def fail(self, message: str, token: _Token, help_: str | None = None) -> ExpressionError:
        return ExpressionError("syntax", message, token.start, token.end, help_)

    def nest(self) -> None:
        self.nesting += 1
        if self.nesting > MAX_NESTING:
            raise self.fail(
                f"nested deeper than {MAX_NESTING} levels",
                self.current,
                "name parts of it under `definitions`",
            )

    def expect_end(self) -> None:
        token = self.current
        if token.kind == "end":
            return
        before = self.tokens[self.position - 1] if self.position else token
        if token.text == "=":
            raise self.fail(
                "an equation cannot stand here", token, "compare with `==`, and only inside if()"
            )
        if token.kind in ("name", "number") or token.text in ("(", "["):
            left, right = before.text, token.text
            if token.kind == "number" and before.kind == "number":
                raise self.fail("two numbers without an operator between them", token)
            raise self.fail(
                f"an operator is missing between `{left}` and `{right}`",
                token,
                f"write a product as `{left}*{right}`"
                if token.kind != "name" or before.kind == "number" or before.text == ")"
                else f"write a product as `{left}*{right}`, a function as `{left}({right})`",
            )
        if token.text == ",":
            raise self.fail(
                "a comma cannot stand here", token, "write the decimal point as a dot: 0.5"
            )
        if token.text == ")":
            raise self.fail("this parenthesis closes nothing", token)
        if token.text == "'":
            raise self.fail("a prime can only follow a name", token, "write (a*b)' as a definition")
        raise self.fail(f"unexpected `{token.text}`", token)

    def condition(self) -> Tree:
        self.nest()
        tree = self._joined("or", self._conjunction)
        self.nesting -= 1
        return tree

    def _conjunction(self) -> Tree:
        return self._joined("and", self._negation)

    def _joined(self, word: str, part) -> Tree:  # type: ignore[no-untyped-def]
        operands = [part()]
        while self.at(word):
            self.advance()
            operands.append(part())
        if len(operands) == 1:
            return operands[0]
        return Logical(operands[0].start, operands[-1].end, word, tuple(operands))

    def _negation(self) -> Tree:
        if self.at("not"):
            token = self.advance()
            self.nest()
            inner = self._negation()
            self.nesting -= 1
            return Logical(token.start, inner.end, "not", (inner,))
        return self._comparison()

    def _comparison(self) -> Tree:
        operands, operators = [self._sum()], []
        while self.at(*COMPARISONS):
            operators.append(self.advance().text)
            operands.append(self._sum())
        if not operators:
            return operands[0]
        return Comparison(operands[0].start, operands[-1].end, tuple(operands), tuple(operators))

    def _sum(self) -> Tree:
        start = self.current.start
        terms = [(self._sign(), self._product())]
        while self.at("+", "-"):
            terms.append((self._sign(), self._product()))
        if len(terms) == 1 and terms[0][0] == 1:
            return terms[0][1]
        return Sum(start, terms[-1][1].end, tuple(terms))

    def _sign(self) -> int:
        """Read any number of signs: the operator and the sign of what follows it."""
        sign = 1
        while self.at("+", "-"):
            if self.advance().text == "-":
                sign = -sign
        return sign

    def _product(self) -> Tree:
        factors = [(1, self._power())]
        while self.at("*", "/"):
            exponent = 1 if self.advance().text == "*" else -1
            factors.append((exponent, self._power()))
        if len(factors) == 1:
            return factors[0][1]
        return Product(factors[0][1].start, factors[-1][1].end, tuple(factors))

    def _power(self) -> Tree:
        start = self.current.start
        sign = self._sign()
        base = self._primary()
        if self.at("^", "**"):
            self.advance()
            self.nest()
            exponent = self._power()
            self.nesting -= 1
            base = Power(base.start, exponent.end, base, exponent)
        return base if sign == 1 else Sum(start, base.end, ((-1, base),))

    def _primary(self) -> Tree:
        token = self.advance()
        if token.kind == "number":
            return self._number(token)
        if token.kind == "name" and token.text not in KEYWORDS - {"if"}:
            return self._name(token)
        if token.text == "(":
            inner = self.condition()
            self._close(")", token)
            return inner
        if token.text == "[":
            items = self._arguments("]", token)
            return Vector(token.start, self.tokens[self.position - 1].end, items)
        self.position -= 1
        if token.kind == "end":
            raise self.fail("the expression ends too early", token, "something is missing here")
        help_ = None
        if token.text in ("*", "/", "^", "**"):
            help_ = "an operator needs something on both sides"
        elif token.text in KEYWORDS:
            help_ = f"`{token.text}` is a word of the grammar and cannot be a name"
        raise self.fail(f"unexpected `{token.text}`", token, help_)

    def _number(self, token: _Token) -> Number:
        mantissa, _, exponent = token.text.lower().partition("e")
        if len(mantissa) > MAX_DIGITS or abs(int(exponent[:9] or 0)) > MAX_EXPONENT:
            raise ExpressionError(
                "bad-number",
                "this number is beyond what a double can hold",
                token.start,
                token.end,
                f"numbers have at most {MAX_DIGITS} digits and exponents up to {MAX_EXPONENT}",
            )
        following = self.current
        if following.kind == "number" and following.start == token.end:
            raise self.fail("a number with two points", following)
        if following.kind == "name" and following.start == token.end:
            name = following.text
            if re.match(r"^(_\d+|x[0-9a-fA-F]+|[jJ]$)", name):
                raise self.fail(
                    f"`{token.text}{name}` is not a number", following, "write a decimal number"
                )
        return Number(token.start, token.end, Fraction(token.text.lower()))

    def _name(self, token: _Token) -> Tree:
        if self.at("("):
            opening = self.advance()
            arguments = self._arguments(")", opening)
            return Call(token.start, self.tokens[self.position - 1].end, token.text, arguments)
        primes, end = 0, token.end
        while self.at("'") and self.current.start == end:
            end = self.advance().end
            primes += 1
        if token.text == "if":
            raise self.fail("`if` needs three arguments", token, "write if(condition, a, b)")
        if self.at("^", "**") and self.tokens[self.position + 1].kind == "number":
            power, following = self.tokens[self.position + 1 : self.position + 3]
            if following.text == "(":  # sin^2(x): no name can be followed by a number and "("
                raise self.fail(
                    f"`{token.text}^{power.text}(…)` is not an expression",
                    token,
                    f"write `{token.text}(…)^{power.text}`",
                )
        return Name(token.start, end, token.text, primes)

    def _arguments(self, closing: str, opening: _Token) -> tuple[Tree, ...]:
        if self.at(closing):
            self.advance()
            return ()
        items = [self.condition()]
        while self.at(","):
            self.advance()
            items.append(self.condition())
        self._close(closing, opening)
        return tuple(items)

    def _close(self, closing: str, opening: _Token) -> None:
        if self.at(closing):
            self.advance()
            return
        token = self.current
        if token.kind == "end":
            raise self.fail(
                f"`{opening.text}` is never closed", opening, f"add `{closing}`"
            )
        self.expect_end()
