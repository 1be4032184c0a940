"""Formulas in MathML Core, which browsers render without scripts, in HTML."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from html import escape, unescape

from lagcli.equations.typesetting import nodes as t
from lagcli.equations.typesetting.latex import needs_space
from lagcli.equations.typesetting.nodes import Line, Node
from lagcli.equations.typesetting.notation import symbol_mathml
from lagcli.equations.typesetting.text import TextFormula
from lagcli.equations.typesetting.writer import (
    LAST_RESORT,
    PREFIX,
    Break,
    DisplayWriter,
    Token,
    cases_of,
    is_named,
    rows_of,
    spelling_of,
)

_RELATIONS = {"<=": "≤", ">=": "≥", "!=": "≠", "==": "=", "<": "<", ">": ">"}
_THIN = '<mspace width="0.17em"/>'
_APPLY, _TIMES = "<mo>\u2061</mo>", "<mo>\u2062</mo>"
_TALL = ("<mfrac>", "<mtable")


def operator(sign: str, form: str = "infix") -> str:
    """Return an operator with explicit spacing."""
    return f'<mo form="{form}">{escape(sign)}</mo>'


@cache
def width(mathml: str) -> int:
    """Estimate the width of a formula in characters."""
    text = re.sub(r"<mstyle.*?</mstyle>", "", mathml)  # dots above
    return len(re.sub("[\u2061\u2062]", "", unescape(re.sub(r"<[^>]*>", "", text))))


class MathmlFormula(DisplayWriter):
    """Writer for formulas in MathML."""

    plus, minus = operator("+"), operator("−")
    negative, comma = operator("−", "prefix"), operator(",")
    space = _THIN

    def mathml(self, node: Node) -> str:
        """Return a formula without line breaks as one element."""
        return _row(_joined(self.tokens(node)))

    def _write_virtualdisplacement(self, node: t.VirtualDisplacement, depth: int) -> list[Token]:
        bold = self.names.displacement_is_product(node.of.name)
        sign = symbol_mathml(r"\boldsymbol{\delta}") if bold else "<mi>δ</mi>"
        return [f"<mrow>{sign}{self._symbol(node.of)}</mrow>"]

    def _write_partial(self, node: t.Partial, depth: int) -> list[Token]:
        top, bottom = (f"<mrow><mo>∂</mo>{self.mathml(x)}</mrow>" for x in (node.of, node.by))
        return [f"<mfrac>{top}{bottom}</mfrac>"]

    def _write_rate(self, node: t.Rate, depth: int) -> list[Token]:
        rate = "<mfrac><mi>d</mi><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>"
        return [rate, _THIN, *self._fenced([self.mathml(node.of)])]

    def _write_sign(self, node: t.Sign, depth: int) -> list[Token]:
        return [symbol_mathml(node.latex)]

    def _write_entry(self, node: t.Entry, depth: int) -> list[Token]:
        comma = '<mo separator="true">,</mo>'
        below = comma.join(map(self._symbol, node.indices))
        return [f"<msub>{symbol_mathml(node.matrix.latex)}{_row(below)}</msub>"]

    def _write_indexedsum(self, node: t.IndexedSum, depth: int) -> list[Token]:
        below = _row(f"<mi>{node.index}</mi>{operator('=')}{self.mathml(node.first)}")
        sign = f"<munderover><mo>∑</mo>{below}{self.mathml(node.last)}</munderover>"
        return [sign, _THIN, *self._summand(node.term, depth)]

    def _write_quotient(self, node: t.Quotient, depth: int) -> list[Token]:
        top, bottom = self.mathml(node.numerator), self.mathml(node.denominator)
        return [f"<mfrac>{top}{bottom}</mfrac>"]

    def _write_root(self, node: t.Root, depth: int) -> list[Token]:
        inside = self.mathml(node.radicand)
        if node.degree == 2:
            return [f"<msqrt>{inside}</msqrt>"]
        return [f"<mroot>{inside}<mn>{node.degree}</mn></mroot>"]

    def _write_relation(self, node: t.Relation, depth: int) -> list[Token]:
        sign = operator(_RELATIONS.get(node.operator, node.operator))
        left = _row(_joined(self._before(node.left, 0)))
        return [f"{left}{sign}{self.mathml(node.right)}"]

    def _negated(self, number: str) -> str:
        return f"<mrow>{self.negative}{number}</mrow>"

    def _digits(self, digits: str) -> str:
        return f"<mn>{digits}</mn>"

    def _scientific(self, mantissa: str, power: int) -> str:
        ten = f"<msup><mn>10</mn>{self.number(Fraction(power))}</msup>"
        return f"<mrow><mn>{mantissa}</mn>{operator('⋅')}{ten}</mrow>"

    def _fraction(self, value: Fraction) -> str:
        # small, as within a line of text
        parts = f"<mn>{value.numerator}</mn><mn>{value.denominator}</mn>"
        return f'<mstyle displaystyle="false" scriptlevel="0"><mfrac>{parts}</mfrac></mstyle>'

    def _symbol(self, node: t.Symbol, raised: str = "") -> str:
        """Return a name, with an exponent above its subscript if given."""
        base, below = self._name(node)
        if raised:
            tag = "msubsup" if below else "msup"
            if base.startswith("<mover>"):  # the exponent belongs to the letter, not to its dots
                base = f'<mpadded height="0.7em">{base}</mpadded>'
            return f"<{tag}>{base}{below}{raised}</{tag}>"
        symbol = f"<msub>{base}{below}</msub>" if below else base
        if node.kind == "multiplier":
            name = escape(node.name)
            return f'<mrow class="multiplier" data-constraint="{name}">{symbol}</mrow>'
        return symbol

    def _name(self, node: t.Symbol) -> tuple[str, str]:
        match node.kind:
            case "multiplier":
                return "<mi>λ</mi>", self.names.mathml_multiplier(node.name)
            case "force":
                base, below = self.names.mathml(node.name)
                letter = f"<mi>{self.names.force[0]}</mi>"
                return letter, f"<msub>{base}{below}</msub>" if below else base
            case "constant":
                return "<mi>π</mi>", ""
            case "constraint":
                return f"<mi>{escape(node.name)}</mi>", ""
        return self.names.mathml(node.name, node.dots)

    def _write_product(self, node: t.Product, depth: int) -> list[Token]:
        tokens: list[Token] = []
        for i, factor in enumerate(node.factors):
            part = self._factor(node, i, depth)
            if i:
                apart = needs_space(node.factors[i - 1], factor) or _named(factor)
                tokens += [Break(depth + LAST_RESORT), _THIN if apart else _TIMES]
            tokens += part
        return tokens

    def _write_power(self, node: t.Power, depth: int) -> list[Token]:
        raised, base = self.mathml(node.exponent), node.base
        if (
            isinstance(base, t.Call)
            and base.function in PREFIX
            and isinstance(node.exponent, t.Number)
        ):
            name = f"<msup><mi>{base.function}</mi>{raised}</msup>"
            return [name, _APPLY, *self._arguments(base, depth)]
        if isinstance(base, t.Symbol):
            return [self._symbol(base, raised)]
        *before, last = self._tight(base, depth)
        if not before:
            return [f"<msup>{_row(str(last))}{raised}</msup>"]
        # the closing bracket carries the exponent
        return [*before, f"<msup>{last}{raised}</msup>"]

    def _write_call(self, node: t.Call, depth: int) -> list[Token]:
        name, arguments = node.function, node.arguments
        spelling = spelling_of(name)
        if spelling.fences is not None:
            opening, closing = spelling.fences
            return [_between(opening, self.mathml(arguments[0]), closing)]
        if name in ("dot", "cross"):
            sign = operator("⋅" if name == "dot" else "×")
            left, right = (_joined(self._tight(a, depth)) for a in arguments)
            return [f"<mrow>{left}{sign}{right}</mrow>"]
        if name == "exp":
            return [f"<msup><mi>e</mi>{self.mathml(arguments[0])}</msup>"]
        if name == "transpose":
            base = _row(_joined(self._tight(arguments[0], depth)))
            return [f'<msup>{base}<mi mathvariant="normal">T</mi></msup>']
        stem, _, index = (spelling.mathml or name).partition("_")
        sign = f"<mi>{escape(stem)}</mi>"
        if len(stem) == 1:
            sign = f'<mi mathvariant="normal">{escape(stem)}</mi>'
        if index:
            sign = f"<msub>{sign}<mi>{escape(index)}</mi></msub>"
        return [sign, _APPLY, *self._arguments(node, depth)]

    def _write_vector(self, node: t.Vector, depth: int) -> list[Token]:
        rows = "".join(
            "<mtr>" + "".join(f"<mtd>{self.mathml(x)}</mtd>" for x in items) + "</mtr>"
            for items in rows_of(node)
        )
        return [_between("(", f"<mtable>{rows}</mtable>", ")")]

    def _write_component(self, node: t.Component, depth: int) -> list[Token]:
        parts = [
            f"<mn>{x}</mn>" if x.isdigit() else f"<mi>{x}</mi>" for x in node.subscript.split(",")
        ]
        of = self._tight(node.of, depth)
        if isinstance(node.of, t.Symbol) and self.names.component_is_name(
            node.of.name, node.subscript
        ):
            of = self._fenced(of)
        base = _row(_joined(of))
        return [f"<msub>{base}{_row(operator(',').join(parts))}</msub>"]

    def _write_cases(self, node: t.Cases, depth: int) -> list[Token]:
        cases, rest = cases_of(node)
        rows = []
        for when, then in cases:
            condition = f"<mtext>if\u00a0</mtext>{self.mathml(when)}"
            rows.append(f"<mtd>{self.mathml(then)}</mtd><mtd><mrow>{condition}</mrow></mtd>")
        rows.append(f"<mtd>{self.mathml(rest)}</mtd><mtd><mtext>else</mtext></mtd>")
        table = "".join(f"<mtr>{row}</mtr>" for row in rows)
        return [_between("{", f'<mtable class="cases">{table}</mtable>', "")]

    def _write_logical(self, node: t.Logical, depth: int) -> list[Token]:
        parts = [
            _joined(self._fenced([self.mathml(o)])) if isinstance(o, t.Logical) else self.mathml(o)
            for o in node.operands
        ]
        if node.operator == "not":
            return [f"<mrow><mtext>not\u00a0</mtext>{_joined(self._fenced([parts[0]]))}</mrow>"]
        # browsers ignore ordinary spaces at the ends
        word = f"<mtext>\u00a0{node.operator}\u00a0</mtext>"
        return [f"<mrow>{word.join(parts)}</mrow>"]

    def _fenced(self, inner: list[Token]) -> list[Token]:
        text = _joined(inner)
        opening, closing = ("[", "]") if ">(</mo>" in text and ">[</mo>" not in text else ("(", ")")
        tall = any(tag in text for tag in _TALL)
        if not any(isinstance(x, Break) for x in inner):
            return [_between(opening, text, closing, stretchy=tall)]
        # brackets with a line break between them cannot stretch to their content
        size = ' stretchy="true" symmetric="true" minsize="2.2em"' if tall else ' stretchy="false"'
        first, last = (
            f'<mo form="{form}" fence="true"{size}>{sign}</mo>'
            for form, sign in (("prefix", opening), ("postfix", closing))
        )
        return [first, *inner, last]


def _between(opening: str, inside: str, closing: str, stretchy: bool = True) -> str:
    size = "true" if stretchy else "false"
    left, right = (
        f'<mo form="{form}" fence="true" stretchy="{size}">{sign}</mo>' if sign else ""
        for form, sign in (("prefix", opening), ("postfix", closing))
    )
    return f"<mrow>{left}{inside}{right}</mrow>"


def _joined(tokens: Sequence[Token]) -> str:
    return "".join(x for x in tokens if isinstance(x, str))


def _row(mathml: str) -> str:
    return f"<mrow>{mathml}</mrow>"


def _named(factor: Node) -> bool:
    """Whether a factor starts with a function name, which needs a space before it."""
    base = factor.base if isinstance(factor, t.Power) else factor
    return is_named(base)


#: Characters on a line of the narrowest screen; shorter formulas are not split.
_PIECE = 26
#: Maximum characters of a side that stays on the line of the equality sign.
_SHORT = 8


def equation(line: Line, formula: MathmlFormula, text: TextFormula, terms: bool = False) -> str:
    """Return a formula or an equation as a block element.

    Parameters
    ----------
    line : Line
    formula : MathmlFormula
    text : TextFormula
        Writer of the text for screen readers.
    terms : bool
        Whether each term of the sides is in elements with its number, counted along the line, as
        ``data-term``.

    Returns
    -------
    str
        ``<div class="equation">``.
    """
    sides = _numbered_terms(line, formula) if terms else list(map(formula.tokens, line.sides))
    first, *others = sides
    parts: list[list[Token]] = [first]
    for side in others:
        if _width(side) <= _SHORT or _width(parts[-1]) <= _SHORT:
            # x = … and … = 0 are not broken at the equality sign
            parts[-1] += [operator("="), *side]
        else:
            parts.append([operator("="), *side])
    spoken = " = ".join(map(text.text, line.sides))
    return (
        f'<div class="equation" role="math" aria-label="{escape(spoken)}">'
        + "<wbr>".join(map(_pieces, parts))
        + "</div>"
    )


def _numbered_terms(line: Line, formula: MathmlFormula) -> list[list[Token]]:
    """Return the tokens of each side, with those of a term in elements with its number."""
    sides: list[list[Token]] = []
    number = 0
    for side in line.sides:
        tokens: list[Token] = []
        for token in formula.term_tokens(side):
            if isinstance(token, list):
                tokens += [
                    part
                    if isinstance(part, Break)
                    else f'<mrow class="term" data-term="{number}">{part}</mrow>'
                    for part in token
                ]
                number += 1
            else:
                tokens.append(token)
        sides.append(tokens)
    return sides


def inline(node: Node, formula: MathmlFormula) -> str:
    """Return an inline formula."""
    return f'<math displaystyle="true">{formula.mathml(node)}</math>'


def _width(tokens: Sequence[Token]) -> int:
    return width("".join(x for x in tokens if isinstance(x, str)))


def _pieces(tokens: Sequence[Token]) -> str:
    """Return a formula split at its best breaks, and recursively its parts."""
    whole = "".join(x for x in tokens if isinstance(x, str))
    depths = [x.depth for x in tokens if isinstance(x, Break)]
    if not depths or width(whole) <= _PIECE:
        return f'<math displaystyle="true">{whole}</math>'
    best, parts = min(depths), [[]]  # type: tuple[int, list[list[Token]]]
    for token in tokens:
        if isinstance(token, Break) and token.depth == best:
            parts.append([])
        else:
            parts[-1].append(token)
    return f'<span class="formula">{"<wbr>".join(map(_pieces, parts))}</span>'
