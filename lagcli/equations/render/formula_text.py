"""Formulas in Unicode text."""

from __future__ import annotations

from fractions import Fraction

from lagcli.equations.presentation import typeset as t
from lagcli.equations.presentation.typeset import Node
from lagcli.equations.render.breaking import Break, Token, flat
from lagcli.equations.render.formula import PREFIX, FormulaWriter, factor_depth
from lagcli.equations.render.names import SUBSCRIPTS, SUPERSCRIPTS
from lagcli.equations.render.numbers import decimal, is_rounded, rounded

_VULGAR = {
    Fraction(p, q): sign
    for sign, p, q in (
        *(("½", 1, 2), ("⅓", 1, 3), ("⅔", 2, 3), ("¼", 1, 4), ("¾", 3, 4), ("⅕", 1, 5)),
        *(("⅖", 2, 5), ("⅗", 3, 5), ("⅘", 4, 5), ("⅙", 1, 6), ("⅚", 5, 6), ("⅛", 1, 8)),
        *(("⅜", 3, 8), ("⅝", 5, 8), ("⅞", 7, 8)),
    )
}
_RELATIONS = {"<=": "≤", ">=": "≥", "!=": "≠", "==": "="}
_BRACKETS = (("(", ")"), ("[", "]"), ("{", "}"))


class TextFormula(FormulaWriter):
    """Writer for formulas in Unicode text."""

    plus, minus, negative = "+ ", "− ", "−"

    def text(self, node: Node) -> str:
        """Return a formula on one line."""
        return flat(self.tokens(node))

    def _write_virtualdisplacement(self, node: t.VirtualDisplacement, depth: int) -> list[Token]:
        name = self._symbol(node.of)
        return [f"δ({name})" if name.startswith("δ") else f"δ{name}"]

    def _write_partial(self, node: t.Partial, depth: int) -> list[Token]:
        return [f"∂{self.text(node.of)}/∂{self.text(node.by)}"]

    def _write_rate(self, node: t.Rate, depth: int) -> list[Token]:
        return ["d/dt ", *self._tight(node.of, depth)]

    def _write_sign(self, node: t.Sign, depth: int) -> list[Token]:
        return [node.text]

    def _write_entry(self, node: t.Entry, depth: int) -> list[Token]:
        return [f"{node.matrix.text}[{', '.join(map(self._symbol, node.indices))}]"]

    def _write_indexedsum(self, node: t.IndexedSum, depth: int) -> list[Token]:
        span = f"{node.index}={self.text(node.first)}..{self.text(node.last)}".replace(" ", "")
        return [f"Σ({span}) ", *self._summand(node.term, depth)]

    def _write_quotient(self, node: t.Quotient, depth: int) -> list[Token]:
        below = node.denominator
        top = self._tight(_closed(node.numerator), depth + 1, product=True)
        if isinstance(below, t.Power) and not isinstance(below.base, t.Call | t.Number):
            bottom = self.tokens(below, depth + 1)
        else:
            bottom = self._tight(below, depth + 1)
        apart = [Break(depth + 1, "")] if any(isinstance(x, Break) for x in bottom) else []
        return [*top, *apart, "/", *bottom]

    def _write_root(self, node: t.Root, depth: int) -> list[Token]:
        sign, inner = {2: "√", 3: "∛"}[node.degree], node.radicand
        if isinstance(inner, t.Symbol) and not inner.dots:
            return [sign, *self.tokens(inner)]
        return [sign, *self._bracketed(inner, depth, round_=True)]

    def _write_vector(self, node: t.Vector, depth: int) -> list[Token]:
        return ["[", *self._listed(node.items, depth), "]"]

    def _write_component(self, node: t.Component, depth: int) -> list[Token]:
        part = f"_{node.subscript}" if node.subscript.isalpha() else f"[{node.subscript}]"
        return [*self._tight(node.of, depth), part]

    def _write_cases(self, node: t.Cases, depth: int) -> list[Token]:
        parts = (node.condition, node.then, node.otherwise)
        return ["if(", *self._listed(parts, depth), ")"]

    def _write_relation(self, node: t.Relation, depth: int) -> list[Token]:
        relation = _RELATIONS.get(node.operator, node.operator)
        left, right = self.tokens(node.left, depth + 1), self.tokens(node.right, depth + 1)
        return [*left, Break(depth), f"{relation} ", *right]

    def number(self, value: Fraction) -> str:
        """Return a number: ½, 0.1, 3/7."""
        if value < 0:
            return f"−{self.number(-value)}"
        plain = decimal(value, self.decimals)
        if is_rounded(value, plain, self.numeric):
            mantissa, power = rounded(value)
            raised = str(power).translate(SUPERSCRIPTS)
            return mantissa if power is None else f"{mantissa}×10{raised}"
        if plain is not None:
            return plain
        return _VULGAR.get(value) or f"{value.numerator}/{value.denominator}"

    def _factor_number(self, value: Fraction) -> str:
        text = self.number(value)
        if "/" not in text:
            return text
        top = str(value.numerator).translate(SUPERSCRIPTS)
        return f"{top}⁄{str(value.denominator).translate(SUBSCRIPTS)}"

    def _symbol(self, node: t.Symbol) -> str:
        if node.kind == "constraint":
            return node.name
        if node.kind == "multiplier":
            return self.names.multiplier(node.name)
        if node.kind == "force":
            return f"Q_{self.names.text(node.name)}"
        return "π" if node.kind == "constant" else self.names.text(node.name, node.dots)

    def _write_product(self, node: t.Product, depth: int) -> list[Token]:
        found: list[Token] = []
        for i, factor in enumerate(node.factors):
            if i:
                found.append(Break(factor_depth(node.factors, i, depth)))
            if isinstance(factor, t.Number):
                found.append(self._factor_number(factor.value))
            elif isinstance(factor, t.Quotient) and i < len(node.factors) - 1:
                found += self._bracketed(factor, depth)
            else:
                found += self._factor(node, i, depth)
        return found

    def _write_power(self, node: t.Power, depth: int) -> list[Token]:
        top = node.exponent
        raised = f"^({self.text(top)})"
        if isinstance(top, t.Number) and top.value.denominator == 1:
            raised = str(top.value).translate(SUPERSCRIPTS)
        elif isinstance(top, t.Symbol):
            raised = f"^{self.text(top)}"
        base = node.base
        if isinstance(base, t.Call) and base.function in PREFIX and "^" not in raised:
            return [base.function, raised, *self._arguments(base, depth)]
        return [*self._tight(base, depth), raised]

    def _write_call(self, node: t.Call, depth: int) -> list[Token]:
        if node.function == "abs":
            return ["|", *self.tokens(node.arguments[0], depth + 1), "|"]
        if node.function == "dot":
            left, right = (self._tight(a, depth) for a in node.arguments)
            return [*left, " · ", *right]
        if node.function == "cross":
            left, right = (self._tight(a, depth) for a in node.arguments)
            return [*left, " × ", *right]
        return [node.function, *self._arguments(node, depth)]

    def _arguments(self, node: t.Call, depth: int) -> list[Token]:
        """Return arguments in parentheses, or after a space: sin φ."""
        first = node.arguments[0]
        if node.function in PREFIX and len(node.arguments) == 1 and isinstance(first, t.Symbol):
            text = self._symbol(first)
            if not first.dots and not text[1:].strip("₀₁₂₃₄₅₆₇₈₉")[:1].isalpha():
                return [f" {text}"]
        return ["(", *self._listed(node.arguments, depth), ")"]

    def _write_logical(self, node: t.Logical, depth: int) -> list[Token]:
        if node.operator == "not":
            return ["not ", *self._bracketed(node.operands[0], depth)]
        found: list[Token] = []
        for i, operand in enumerate(node.operands):
            if i:
                found += [Break(depth), f"{node.operator} "]
            if isinstance(operand, t.Logical):
                found += self._bracketed(operand, depth)
            else:
                found += self.tokens(operand, depth + 1)
        return found

    def _tight(self, node: Node, depth: int, product: bool = False) -> list[Token]:
        """Return a node as a factor, base or denominator, in parentheses if necessary."""
        compound: tuple[type, ...] = (t.Sum, t.IndexedSum, t.Relation, t.Logical)
        if not product:
            compound += (t.Product, t.Quotient, t.Power, t.Rate)
        dotted = isinstance(node, t.Call) and node.function in ("dot", "cross")
        fraction = isinstance(node, t.Number) and "/" in self.number(node.value)
        prefix = not product and isinstance(node, t.Call) and node.function in PREFIX
        if isinstance(node, compound) or dotted or fraction or prefix:
            return self._bracketed(node, depth)
        return self.tokens(node, depth)

    def _bracketed(self, node: Node, depth: int, round_: bool = False) -> list[Token]:
        inner = self.tokens(node, depth + 1)
        text = "".join(x for x in inner if isinstance(x, str))
        opening, closing = _BRACKETS[0 if round_ else _level(text)]
        return [opening, *inner, closing]


def _level(text: str) -> int:
    """Return which brackets stand around a text: ( ), around these [ ], { }, and again ( )."""
    depth = 0
    for char in text:
        if char == "{" and not depth:
            return 0
        depth += (char in "([{") - (char in ")]}")
    return 0 if "(" not in text else 1 if "[" not in text else 2


def _closed(node: Node) -> Node:
    """Return a numerator whose last function has parentheses: sin(φ)/l, not sin φ/l."""
    match node:
        case t.Product():
            *before, last = node.factors
            return t.Product((*before, _closed(last)))
        case t.Power():
            return t.Power(_closed(node.base), node.exponent)
        case t.Call(arguments=(t.Symbol() as argument,)) if node.function in PREFIX:
            return t.Call(node.function, (t.Sum(((1, argument),)),))
    return node
