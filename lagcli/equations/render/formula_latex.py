"""Formulas in LaTeX, for amsmath and for MathJax."""

from __future__ import annotations

import re
from fractions import Fraction

from lagcli.equations.presentation import typeset as t
from lagcli.equations.presentation.typeset import Node
from lagcli.equations.render.breaking import Break, Token, flat
from lagcli.equations.render.formula import (
    PREFIX,
    DisplayWriter,
    cases_of,
    factor_depth,
    rows_of,
    spelling_of,
)
from lagcli.equations.render.names import latex_ascii, latex_word, letter
from lagcli.equations.render.numbers import decimal, is_rounded, rounded

_RELATIONS = {"<=": r"\le", ">=": r"\ge", "!=": r"\ne", "==": "=", "⊥": r"\perp"}
#: Largest numerator, denominator or radicand that is not broken, in characters: half a page wide.
_WIDE = 45
_TALL = (r"\frac", r"\begin")


class LatexFormula(DisplayWriter):
    """Writer for formulas in LaTeX."""

    space = " "

    def latex(self, node: Node) -> str:
        """Return a formula on one line."""
        return flat(self.tokens(node))

    def _write_virtualdisplacement(self, node: t.VirtualDisplacement, depth: int) -> list[Token]:
        return [rf"\delta {self._symbol(node.of)}"]

    def _write_partial(self, node: t.Partial, depth: int) -> list[Token]:
        top, bottom = self.latex(node.of), self.latex(node.by)
        return [rf"\frac{{\partial {top}}}{{\partial {bottom}}}"]

    def _write_rate(self, node: t.Rate, depth: int) -> list[Token]:
        return [rf"\frac{{d}}{{dt}} {self._group(self.latex(node.of))}"]

    def _write_sign(self, node: t.Sign, depth: int) -> list[Token]:
        return [node.latex]

    def _write_entry(self, node: t.Entry, depth: int) -> list[Token]:
        return [f"{node.matrix.latex}_{{{', '.join(map(self._symbol, node.indices))}}}"]

    def _write_indexedsum(self, node: t.IndexedSum, depth: int) -> list[Token]:
        first, last = self.latex(node.first), self.latex(node.last)
        sign = rf"\textstyle\sum_{{{node.index}={first}}}^{{{last}}} "
        return [sign, *self._summand(node.term, depth)]

    def _write_quotient(self, node: t.Quotient, depth: int) -> list[Token]:
        """Return a fraction; a wide one as 1/b […], or […]/[…], which can be broken."""
        above, below = node.numerator, node.denominator
        if t.weight(below) > _WIDE:
            top, bottom = self._tight(above, depth + 1), self._tight(below, depth + 1)
            return [*top, Break(depth + 1, ""), "/", *bottom]
        if t.weight(above) > _WIDE:
            inverse = rf"\frac{{1}}{{{self.latex(below)}}}"
            top = self._fenced(self.tokens(above, depth + 1))
            return [inverse, Break(depth, r" \, "), *top]
        return [rf"\frac{{{self.latex(node.numerator)}}}{{{self.latex(node.denominator)}}}"]

    def _write_root(self, node: t.Root, depth: int) -> list[Token]:
        if t.weight(node.radicand) > _WIDE:
            power = rf"^{{1/{node.degree}}}"
            return [*self._fenced(self.tokens(node.radicand, depth + 1)), power]
        degree = "" if node.degree == 2 else f"[{node.degree}]"
        return [rf"\sqrt{degree}{{{self.latex(node.radicand)}}}"]

    def _write_relation(self, node: t.Relation, depth: int) -> list[Token]:
        sign = _RELATIONS.get(node.operator, node.operator)
        return [f"{self.latex(node.left)} {sign} {self.latex(node.right)}"]

    def number(self, value: Fraction) -> str:
        """Return a number: \\tfrac{1}{2}, 0.1."""
        if value < 0:
            return f"-{self.number(-value)}"
        plain = decimal(value, self.decimals)
        if is_rounded(value, plain, self.numeric):
            mantissa, power = rounded(value)
            return mantissa if power is None else rf"{mantissa}\cdot 10^{{{power}}}"
        return plain or rf"\tfrac{{{value.numerator}}}{{{value.denominator}}}"

    def _symbol(self, node: t.Symbol) -> str:
        match node.kind:
            case "multiplier":
                return self.names.latex_multiplier(node.name)
            case "force":
                return f"Q_{{{self.names.latex(node.name)}}}"
            case "constant":
                return r"\pi"
            case "constraint":
                return latex_word(node.name)
        return self.names.latex(node.name, node.dots)

    def _write_product(self, node: t.Product, depth: int) -> list[Token]:
        found: list[Token] = []
        for i, factor in enumerate(node.factors):
            part = self._factor(node, i, depth)
            if i:
                before = node.factors[i - 1]
                apart = needs_space(before, factor)
                space = r" \, " if apart else " "
                found.append(Break(factor_depth(node.factors, i, depth), space))
            found += part
        return found

    def _write_power(self, node: t.Power, depth: int) -> list[Token]:
        raised = f"^{{{self.latex(node.exponent)}}}"
        base = node.base
        if (
            isinstance(base, t.Call)
            and base.function in PREFIX
            and isinstance(node.exponent, t.Number)
        ):
            return [spelling_of(base.function).latex, raised, *self._arguments(base, depth)]
        if isinstance(base, t.Symbol) and base.name in self.names.with_own_latex:
            return [f"{{{self._symbol(base)}}}", raised]
        return [*self._tight(base, depth), raised]

    def _write_call(self, node: t.Call, depth: int) -> list[Token]:
        name, arguments = node.function, node.arguments
        spelling = spelling_of(name)
        if spelling.latex_fences is not None:
            opening, closing = spelling.latex_fences
            return [opening, self.latex(arguments[0]), closing]
        if name in ("dot", "cross"):
            sign = r" \cdot " if name == "dot" else r" \times "
            left, right = ("".join(map(_text, self._tight(a, depth))) for a in arguments)
            return [left + sign + right]
        if name == "exp":
            return [rf"\mathrm{{e}}^{{{self.latex(arguments[0])}}}"]
        if name == "transpose":
            return [*self._tight(arguments[0], depth), r"^{\mathsf{T}}"]
        macro = spelling.latex
        if not macro:
            stem, _, index = name.partition("_")
            macro = rf"\operatorname{{{latex_ascii(stem)}}}" + (f"_{{{index}}}" if index else "")
        return [macro, *self._arguments(node, depth)]

    def _write_vector(self, node: t.Vector, depth: int) -> list[Token]:
        rows = [" & ".join(map(self.latex, items)) for items in rows_of(node)]
        return [r"\begin{pmatrix} " + r" \\ ".join(rows) + r" \end{pmatrix}"]

    def _write_component(self, node: t.Component, depth: int) -> list[Token]:
        return [f"{{{''.join(map(_text, self._tight(node.of, depth)))}}}_{{{node.subscript}}}"]

    def _write_cases(self, node: t.Cases, depth: int) -> list[Token]:
        cases, rest = cases_of(node)
        rows = [rf"{self.latex(x)} & \text{{if }} {self.latex(when)}" for when, x in cases]
        rows.append(rf"{self.latex(rest)} & \text{{else}}")
        return [r"\begin{cases} " + r" \\ ".join(rows) + r" \end{cases}"]

    def _write_logical(self, node: t.Logical, depth: int) -> list[Token]:
        parts = [
            self._group(self.latex(o)) if isinstance(o, t.Logical) else self.latex(o)
            for o in node.operands
        ]
        if node.operator == "not":
            return [rf"\text{{not }} {self._group(parts[0])}"]
        return [rf" \text{{ {node.operator} }} ".join(parts)]

    def _fenced(self, inner: list[Token]) -> list[Token]:
        """Return tokens in brackets of matching size that may be broken across lines."""
        text = "".join(map(_text, inner))
        if any(tall in text for tall in _TALL):
            size = (r"\biggl", r"\biggr")
        elif "(" in text or "[" in text or r"\sqrt" in text:
            size = (r"\bigl", r"\bigr")
        else:
            size = ("", "")
        square = "(" in re.sub(r"\\sqrt\[.\]", "", text) and r"\bigl[" not in text
        opening, closing = ("[", "]") if square else ("(", ")")
        return [f"{size[0]}{opening}", *inner, f"{size[1]}{closing}"]

    def _group(self, text: str) -> str:
        return "".join(map(_text, self._fenced([text])))


def _text(token: Token) -> str:
    return token.space if isinstance(token, Break) else token


def needs_space(before: Node, after: Node) -> bool:
    """Whether two factors need a thin space between them."""
    functions = isinstance(before, t.Call | t.Root | t.Quotient | t.Cases) or (
        isinstance(before, t.Power) and isinstance(before.base, t.Call)
    )
    bracket = isinstance(after, t.Sum) or (
        isinstance(after, t.Power) and isinstance(after.base, t.Sum)
    )
    words = [x.base if isinstance(x, t.Power) else x for x in (before, after)]
    long = any(isinstance(x, t.Symbol) and len(letter(x.name)) > 1 for x in words)
    if isinstance(after, t.VirtualDisplacement):
        return True
    symbol = isinstance(after, t.Symbol)
    closing = isinstance(before, t.Sum)
    return (functions and (bracket or symbol)) or long or bracket or (closing and symbol)
