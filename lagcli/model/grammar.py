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
from collections.abc import Callable
from fractions import Fraction

from lagcli.model.functions import FUNCTIONS
from lagcli.model.tokens import ExpressionError, Token, tokenize
from lagcli.model.trees import (
    Call,
    Comparison,
    Logical,
    Name,
    Number,
    Power,
    Product,
    Sum,
    Tree,
    Vector,
)

MAX_NESTING = 50  # what a person can read ends at 10; each level costs eleven Python frames
MAX_DIGITS = 400  # digits of one number
# of a number as written: beyond them lies no double
MAX_EXPONENT = 308
MIN_EXPONENT = -340

COMPARISONS = ("<=", ">=", "==", "!=", "<", ">")
KEYWORDS = frozenset({"and", "or", "not", "if"})


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
        if parser.at("="):
            raise parser.fail(
                "a second `=` in one equation",
                parser.current,
                "give each equation a name and a line of its own",
            )
    parser.expect_end()
    return left, right


class _Parser:
    def __init__(self, text: str):
        self.text = text
        self.tokens = tokenize(text)
        self.position = 0
        self.nesting = 0
        if self.current.kind == "end":
            raise ExpressionError("syntax", "an expression is missing", 0, 0)

    @property
    def current(self) -> Token:
        return self.tokens[self.position]

    def advance(self) -> Token:
        token = self.current
        self.position += 1
        return token

    def at(self, *texts: str) -> bool:
        token = self.current
        return token.text in texts and token.kind != "number"

    def fail(self, message: str, token: Token, help_: str | None = None) -> ExpressionError:
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
                "an equation cannot stand here",
                token,
                "give the expression alone; conditions inside if() compare with `==`",
            )
        if token.kind in ("name", "number") or token.text in ("(", "["):
            raise self.no_operator(before, token)
        if token.text == ",":
            raise self.stray_comma(before, token)
        if token.text in (")", "]"):
            raise self.fail(f"this `{token.text}` closes nothing", token, "remove it")
        if token.text == "'":
            raise self.fail(
                "a prime can only follow a name directly",
                token,
                "name the expression under `definitions`, then prime the name",
            )
        raise self.fail(f"unexpected `{token.text}`", token)

    def no_operator(self, before: Token, token: Token) -> ExpressionError:
        left, right = before.text, token.text
        if right == "[" and before.kind == "name":
            return ExpressionError(
                "not-yet",
                f"members of a family such as `{left}[…]` are not part of this version",
                before.start,
                token.end,
                "give each member a name of its own: `x_1`, `x_2`",
                "family",
            )
        if before.kind == "number" and token.kind == "number":
            message, help_ = "two numbers without an operator between them", None
        else:
            message = f"an operator is missing between `{left}` and `{right}`"
            help_ = f"write a product as `{left}*{right}`"
            if left in FUNCTIONS:
                help_ = f"write a function as `{left}({right})`"
        return ExpressionError("syntax", message, before.start, token.end, help_)

    def stray_comma(self, before: Token, token: Token) -> ExpressionError:
        after = self.tokens[self.position + 1]
        if before.kind == after.kind == "number":
            number = f"{before.text}.{after.text}"
            return ExpressionError(
                "syntax",
                f"`{before.text},{after.text}` is not a number",
                before.start,
                after.end,
                f"write the decimal point as a dot: `{number}`",
            )
        return self.fail("a comma cannot stand here", token, "it separates arguments of functions")

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
            raise self.fail(
                "the expression ends too early", token, "complete it, or remove its end"
            )
        help_ = None
        if token.text in ("*", "/", "^", "**"):
            help_ = "an operator needs something on both sides"
        elif token.text in KEYWORDS:
            help_ = f"`{token.text}` is a word of the grammar and cannot be a name"
        elif token.text == "'":
            help_ = "a prime follows a name directly"
        elif token.text in (")", "]", ",", "="):
            raise self.fail(f"something is missing before `{token.text}`", token)
        raise self.fail(f"unexpected `{token.text}`", token, help_)

    def _number(self, token: Token) -> Number:
        mantissa, _, exponent = token.text.lower().partition("e")
        power = int(exponent[:9] or 0)
        if len(mantissa) > MAX_DIGITS or not MIN_EXPONENT <= power <= MAX_EXPONENT:
            raise ExpressionError(
                "bad-number",
                "this number is beyond what a double can hold",
                token.start,
                token.end,
                f"numbers have at most {MAX_DIGITS} digits and exponents from {MIN_EXPONENT} to"
                f" {MAX_EXPONENT}",
            )
        if re.match("0[0-9]", mantissa):
            raise self.fail(
                f"`{token.text}` is not a number of the grammar: it begins with 0",
                token,
                "write the number without the 0; dates and times are not numbers",
            )
        following = self.current
        if following.start == token.end:
            whole = token.text + following.text
            if following.kind == "number":
                raise ExpressionError(
                    "syntax",
                    f"`{whole}` is not a number: it has two points",
                    token.start,
                    following.end,
                    "write one decimal point",
                )
            if re.fullmatch(r"0[xXbBoO][0-9a-fA-F]+", whole):
                raise ExpressionError(
                    "syntax",
                    f"`{whole}` is not a number of the grammar",
                    token.start,
                    following.end,
                    "write a decimal number",
                )
        return Number(token.start, token.end, Fraction(token.text.lower()))

    def _name(self, token: Token) -> Tree:
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
            raise self.fail(f"`{opening.text}` is never closed", opening, f"add `{closing}`")
        if token.text == "=":
            raise self.fail(
                "an equation cannot stand in parentheses",
                token,
                "conditions compare with `==`; sums over an index are not part of this version",
            )
        if token.text in (")", "]"):
            raise self.fail(
                f"`{opening.text}` is closed by `{token.text}`", token, f"write `{closing}`"
            )
        self.expect_end()
