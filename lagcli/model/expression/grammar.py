"""Parser of the expression language: text → syntax tree.

::

    condition  := conjunction ("or" conjunction)*
    conjunction:= negation ("and" negation)*
    negation   := "not" negation | comparison
    comparison := sum (("<" | "<=" | ">" | ">=" | "==" | "!=") sum)*
    sum        := ["+" | "-"] product (("+" | "-") product)*
    product    := power (("*" | "/") power)*
    power      := ["+" | "-"] primary [("^" | "**") power]
    primary    := whole component*
    component  := "." NAME | "[" sum ["," sum] "]"
    whole      := NUMBER ["deg"] | name "'"* | NAME "(" condition ("," condition)* ")"
                | "sum" "(" condition "," NAME "=" range ")"
                | "(" condition ")" | "[" condition ("," condition)* "]"
    name       := NAME indices* ("." NAME indices*)*
    indices    := "[" sum ["," sum] "]"
    range      := sum ".." sum

A sign binds less tightly than a power: -x^2 is -(x^2). An exponent may have a sign: x^-2.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from copy import copy
from fractions import Fraction

from lagcli.model.expression.tokens import ExpressionError, Token, error_at, tokenize
from lagcli.model.expression.trees import (
    BRACKETS,
    CallExpr,
    Comparison,
    ComponentExpr,
    IndexedSumExpr,
    LogicalExpr,
    Name,
    NumberExpr,
    PowerExpr,
    ProductExpr,
    Range,
    SumExpr,
    Tree,
    VectorExpr,
)

MAX_NESTING = 50  # readable expressions have 10 at most; each level takes eleven Python frames

MAX_DIGITS = 400  # digits of one number
# range of decimal exponents of doubles
MAX_EXPONENT = 308
MIN_EXPONENT = -340

#: Of a declaration: the name of the index, and its values.
Span = tuple[str | None, Range | Tree]
COMPARISONS = ("<=", ">=", "==", "!=", "<", ">")
_SIGNS, _FACTORS, _POWERS = ("+", "-"), ("*", "/"), ("^", "**")
#: Components of vectors, and of the quaternion of a rotation.
COMPONENTS = ("x", "y", "z", "0", "1", "2", "3")
KEYWORDS = frozenset({"and", "or", "not", "if"})


def parse(text: str) -> Tree:
    """Parse one expression.

    Raises
    ------
    ExpressionError
        The text has a syntax error or exceeds a bound of the grammar.
    """
    parser = _Parser(text)
    tree = parser.condition()
    parser.expect_end()
    return tree


def parse_spans(text: str, start: int, end: int) -> list[Span]:
    """Parse the indices or ranges between the brackets of a declaration, ``text[start:end]``.

    Returns
    -------
    list of (index, range)
        Of one or two: the name of the index, if it has one, and the Range of the members, or the
        Tree of the index of a single member.

    Raises
    ------
    ExpressionError
    """
    parser = _Parser(text[:end], start)
    spans = [parser.span()]
    if parser.at(","):
        parser.advance()
        spans.append(parser.span())
    if parser.at(","):
        raise parser.fail("a family has at most two indices", parser.current)
    parser.expect_end()
    return spans


def parse_equation(text: str) -> tuple[Tree, Tree | None]:
    """Parse ``lhs`` or ``lhs = rhs``; the right side is None without ``=``."""
    parser = _Parser(text)
    left = parser.condition()
    right = None
    if parser.at("="):
        parser.advance()
        right = parser.condition()
        if parser.at("="):
            raise parser.fail(
                "a second `=` in one equation",
                parser.current,
                "give each equation its own name and line",
            )
    parser.expect_end()
    return left, right


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


def _spanning(tree: Tree, start: int, end: int) -> Tree:
    """Return a tree in parentheses, with their span."""
    spanning = copy(tree)
    spanning.start, spanning.end = start, end
    return spanning


class _Parser:
    def __init__(self, text: str, start: int = 0):
        self.text = text
        self.tokens = tokenize(text, start)
        self.position = self.nesting = 0
        self.current = self.tokens[0]
        if self.current.kind == "end":
            raise ExpressionError("syntax", "missing expression", start, start)

    def advance(self) -> Token:
        """Return the current token and advance to the next one; stay at the end."""
        token = self.current
        if token.kind != "end":
            self.position += 1
            self.current = self.tokens[self.position]
        return token

    def at(self, *texts: str) -> bool:
        return self.current.text in texts

    def fail(self, message: str, token: Token, help_: str | None = None) -> ExpressionError:
        return ExpressionError("syntax", message, token.start, token.end, help_)

    def nest(self) -> None:
        self.nesting += 1
        if self.nesting > MAX_NESTING:
            raise self.fail(
                f"nested deeper than {MAX_NESTING} levels",
                self.current,
                "define parts of it under `definitions`",
            )

    def expect_end(self) -> None:
        """Raise ExpressionError unless all tokens are consumed."""
        if self.current.kind != "end":
            from lagcli.model.expression.syntax_hints import unexpected_token

            raise unexpected_token(self.tokens, self.position, self.text)

    @property
    def end(self) -> int:
        """The end of the last token, which may close a parenthesis."""
        return self.tokens[self.position - 1].end

    def condition(self) -> Tree:
        self.nest()
        tree = self._joined("or", self._conjunction)
        self.nesting -= 1
        return tree

    def _conjunction(self) -> Tree:
        return self._joined("and", self._negation)

    def _joined(self, word: str, part: Callable[[], Tree]) -> Tree:
        operands = [part()]
        while self.at(word):
            self.advance()
            operands.append(part())
        if len(operands) == 1:
            return operands[0]
        return LogicalExpr(operands[0].start, operands[-1].end, word, tuple(operands))

    def _negation(self) -> Tree:
        if self.at("not"):
            token = self.advance()
            self.nest()
            inner = self._negation()
            self.nesting -= 1
            return LogicalExpr(token.start, inner.end, "not", (inner,))
        return self._comparison()

    def _comparison(self) -> Tree:
        operands, operators = [self.sum()], []
        while self.at(*COMPARISONS):
            operators.append(self.advance().text)
            operands.append(self.sum())
        if not operators:
            return operands[0]
        return Comparison(operands[0].start, operands[-1].end, tuple(operands), tuple(operators))

    def sum(self) -> Tree:
        """Parse terms with their signs."""
        start = self.current.start
        terms = [(self._sign(), self._product())]
        while self.current.text in _SIGNS:
            terms.append((self._sign(), self._product()))
        if len(terms) == 1 and terms[0][0] == 1:
            return terms[0][1]
        return SumExpr(start, self.end, tuple(terms))

    def _sign(self) -> int:
        """Parse any number of consecutive signs."""
        sign = 1
        while self.current.text in _SIGNS:
            if self.advance().text == "-":
                sign = -sign
        return sign

    def _product(self) -> Tree:
        start = self.current.start
        factors = [(1, self._power())]
        while self.current.text in _FACTORS:
            exponent = 1 if self.advance().text == "*" else -1
            factors.append((exponent, self._power()))
        if len(factors) == 1:
            return factors[0][1]
        return ProductExpr(start, self.end, tuple(factors))

    def _power(self) -> Tree:
        start = self.current.start
        sign = self._sign()
        own = self.current.start
        base = self._primary()
        if self.current.text in _POWERS:
            self.advance()
            self.nest()
            exponent = self._power()
            self.nesting -= 1
            base = PowerExpr(own, self.end, base, exponent)
        return base if sign == 1 else SumExpr(start, self.end, ((-1, base),))

    def _primary(self) -> Tree:
        tree = self._whole()
        while self.at(".", "[") and self.current.start == tree.end:
            if isinstance(tree, NumberExpr) or (self.at("[") and isinstance(tree, Name)):
                break  # `2[` and `x'[1]`: the caller reports them
            tree = self._component(tree)
        return tree

    def _component(self, tree: Tree) -> Tree:
        """Parse ``.x``, ``[1]`` or ``[1, 3]`` after a vector or matrix."""
        opening = self.advance()
        if opening.text == "[":
            indices = self._indices(opening)
            return ComponentExpr(tree.start, self.end, tree, "", indices)
        key = self.advance()
        if key.text not in COMPONENTS:
            help_ = "the components of a vector are `.x`, `.y` and `.z`, or `[1]`, `[2]`, …"
            raise self.fail(f"`.{key.text}` is not a component", key, help_)
        return ComponentExpr(tree.start, key.end, tree, key.text)

    def _indices(self, opening: Token) -> tuple[Tree, ...]:
        """Parse one index or two, and the closing bracket."""
        indices = [self.sum()]
        if self.at("..", "="):
            raise self.fail(
                "a range is not allowed here",
                self.current,
                "ranges are allowed in declarations of families and in `sum(x[i], i = 1..N)`",
            )
        if self.at(","):
            self.advance()
            indices.append(self.sum())
            if self.at(","):
                raise self.fail("there are at most two indices", self.current)
        self._close("]", opening)
        return tuple(indices)

    def _whole(self) -> Tree:
        token = self.advance()
        if token.kind == "number":
            number = read_number(token, self.current)
            return self._degrees(number) if self.at("deg") else number
        if token.kind == "name" and token.text not in KEYWORDS - {"if"}:
            return self._name(token)
        if token.text == "(":
            inner = self.condition()
            self._close(")", token)
            if self.at(".", "[") and self.current.start == self.end:
                return self._component(_spanning(inner, token.start, self.end))
            return inner
        if token.text == "[":
            items = self._arguments("]", token)
            return VectorExpr(token.start, self.tokens[self.position - 1].end, items)
        if token.kind == "end":
            raise self.fail(
                "the expression ends too early", token, "complete it, or remove the last operator"
            )
        help_ = None
        if token.text in ("*", "/", "^", "**"):
            help_ = "an operator needs operands on both sides"
        elif token.text in KEYWORDS:
            help_ = f"`{token.text}` is a keyword and cannot be a name"
        elif token.text == "'":
            help_ = "a prime must directly follow a name"
        elif token.text in (")", "]", ",", "="):
            raise self.fail(f"an operand is missing before `{token.text}`", token)
        raise self.fail(f"unexpected `{token.text}`", token, help_)

    def _degrees(self, number: NumberExpr) -> Tree:
        """Return an angle in degrees: ``30 deg`` is 30*pi/180."""
        unit = self.advance()
        factors = (
            (1, number),
            (1, Name(unit.start, unit.end, "pi", 0)),
            (-1, NumberExpr(unit.start, unit.end, Fraction(180))),
        )
        return ProductExpr(number.start, unit.end, factors)

    def _name(self, token: Token) -> Tree:
        if self.at("("):
            opening = self.advance()
            if token.text == "sum":
                return self._series(token, opening)
            arguments = self._arguments(")", opening)
            return CallExpr(token.start, self.tokens[self.position - 1].end, token.text, arguments)
        text, indices, end, primes = self._member(token)
        while self.at("'") and self.current.start == end:
            end = self.advance().end
            primes += 1
        if token.text == "if":
            from lagcli.model.expression.syntax_hints import choice

            raise self.fail("`if` needs three arguments", token, choice(self.text))
        if self.at("^", "**") and self.tokens[self.position + 1].kind == "number":
            power, following = self.tokens[self.position + 1 : self.position + 3]
            if following.text == "(":  # sin^2(x): a number cannot be followed by "("
                raise self.fail(
                    f"`{token.text}^{power.text}(…)` is not an expression",
                    token,
                    f"write `{token.text}(…)^{power.text}`",
                )
        return Name(token.start, end, text, primes, indices)

    def _member(self, token: Token) -> tuple[str, tuple[Tree, ...], int, int]:
        """Parse the indices after a name, and dotted names after them."""
        text, end, primes = token.text, token.end, 0
        indices: list[Tree] = []
        while self.at("[") and self.current.start == end:
            opening = self.advance()
            if self.at("]"):
                raise self.fail("missing index", self.current, f"write `{token.text}[1]`")
            inside = self._indices(opening)
            indices += inside
            end = self.end
            text += BRACKETS[len(inside)]
            if self.at("."):
                self.advance()
                following = self.advance()
                text, end = f"{text}.{following.text}", following.end
            if self.at("_dot", "_ddot"):
                suffix = self.advance()
                primes, end = 1 + (suffix.text == "_ddot"), suffix.end
                break
        return text, tuple(indices), end, primes

    # indexed sums

    def span(self) -> Span:
        """Parse an index or a range, with the name of its index."""
        index = self.index_name()
        tree = self.sum()
        if index is not None or self.at(".."):
            tree = self.range_from(tree)
        return index, tree

    def index_name(self) -> str | None:
        """Parse ``i =``, if present."""
        if self.current.kind != "name" or self.tokens[self.position + 1].text != "=":
            return None
        token = self.advance()
        self.advance()
        if "." in token.text or token.text in KEYWORDS:
            raise self.fail(f"`{token.text}` cannot be the name of an index", token)
        return token.text

    def range_from(self, first: Tree) -> Range:
        """Parse the rest of a range."""
        if not self.at(".."):
            raise self.fail(
                "missing range",
                self.current,
                "write a range as `i = 1..N`, ends included",
            )
        self.advance()
        last = self.sum()
        return Range(first.start, last.end, first, last)

    def _series(self, token: Token, opening: Token) -> IndexedSumExpr:
        if not self.at(")"):
            term = self.condition()
            if self.at(","):
                self.advance()
                index = self.index_name()
                if index is not None:
                    span = self.range_from(self.sum())
                    if self.at(","):
                        raise self.fail("a sum has one range", self.current, "nest two sums")
                    self._close(")", opening)
                    end = self.tokens[self.position - 1].end
                    return IndexedSumExpr(token.start, end, term, index, span)
        raise self.fail(
            "a sum needs an index and its range",
            token,
            "write `sum(x[i], i = 1..N)`; a sum of a few terms is `a + b + c`",
        )

    def _arguments(self, closing: str, opening: Token) -> tuple[Tree, ...]:
        if self.at(closing):
            self.advance()
            return ()
        items = [self.condition()]
        while self.at(","):
            self.advance()
            items.append(self.condition())
        self._close(closing, opening)
        return tuple(items)

    def _close(self, closing: str, opening: Token) -> None:
        if self.at(closing):
            self.advance()
            return
        token = self.current
        if token.kind == "end":
            raise self.fail(f"`{opening.text}` is not closed", opening, f"add `{closing}`")
        if token.text == "=":
            raise self.fail(
                "an equation is not allowed in parentheses",
                token,
                "use `==` in conditions; a range comes last, as in `sum(x[i], i = 1..N)`"
                if self.tokens[self.position - 1].kind == "name"
                else "use `==` in conditions",
            )
        if token.text in (")", "]"):
            raise self.fail(
                f"`{opening.text}` is closed by `{token.text}`", token, f"write `{closing}`"
            )
        self.expect_end()
