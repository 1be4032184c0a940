"""Formulas in the grammar of model files."""

from __future__ import annotations

from fractions import Fraction

from lagcli.equations.presentation import typeset as t
from lagcli.equations.presentation.typeset import Node
from lagcli.model import model as symbols


def grammar_text(node: Node) -> str:
    """Return a formula as text of the model grammar.

    Parameters
    ----------
    node : Node
        Arranged expression; symbols of general laws are not supported.

    Returns
    -------
    str
        Text that `lagcli.model.expression.grammar.parse` reads, with the same value.
    """
    match node:
        case t.Number():
            return _number(node.value)
        case t.Symbol():
            return _symbol(node)
        case t.Sum():
            return _sum(node)
        case t.Product():
            return "*".join(_factor(f) for f in node.factors)
        case t.Quotient():
            return f"{_factor(node.numerator)}/{_base(node.denominator)}"
        case t.Power():
            return f"{_base(node.base)}^{_base(node.exponent)}"
        case t.Root():
            return f"{'sqrt' if node.degree == 2 else 'cbrt'}({grammar_text(node.radicand)})"
        case t.Call():
            return f"{node.function}({', '.join(map(grammar_text, node.arguments))})"
        case t.Component():
            part = f".{node.subscript}" if node.subscript.isalpha() else f"[{node.subscript}]"
            return f"{_base(node.of)}{part}"
        case t.Cases():
            branches = (node.condition, node.then, node.otherwise)
            return f"if({', '.join(map(grammar_text, branches))})"
        case t.Relation():
            return f"{grammar_text(node.left)} {node.operator} {grammar_text(node.right)}"
        case t.Logical():
            parts = tuple(f"({grammar_text(o)})" for o in node.operands)
            return f"not {parts[0]}" if node.operator == "not" else f" {node.operator} ".join(parts)
    raise AssertionError(f"no text in the grammar: {node!r}")


def _number(value: Fraction) -> str:
    if value.denominator == 1:
        return str(value.numerator)
    if Fraction(repr(float(value))) == value:  # a decimal with the digits of a double
        return repr(float(value))
    if value.numerator.bit_length() > 53 or value.denominator.bit_length() > 53:
        return repr(float(value))  # products of decimals have more digits than significant
    return f"{value.numerator}/{value.denominator}"


def _symbol(node: t.Symbol) -> str:
    match node.kind:
        case "multiplier":
            return str(symbols.multiplier(node.name).name)
        case "constant":
            return node.name
    return node.name + "'" * node.dots


def _sum(node: t.Sum) -> str:
    parts = []
    for i, (sign, term) in enumerate(node.terms):
        text = grammar_text(term)
        text = f"({text})" if isinstance(term, t.Sum) else text
        parts.append((" + " if sign > 0 else " - ") + text if i else "-" * (sign < 0) + text)
    return "".join(parts)


def _factor(node: Node) -> str:
    text = grammar_text(node)
    return f"({text})" if isinstance(node, t.Sum | t.Relation | t.Logical) else text


def _base(node: Node) -> str:
    """Return a base, exponent or denominator."""
    text = grammar_text(node)
    bare = isinstance(node, t.Symbol | t.Call | t.Root | t.Cases) or text.isdigit()
    return text if bare else f"({text})"
