"""Quantities: numbers with units and expressions of parameters, converted to SI."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.model.draft import NO_INDICES, Draft, Formula, Indices, Parsed
from lagcli.model.expression.constants import number
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.trees import NumberExpr, SumExpr
from lagcli.model.expression.units import UNIT_HELP, Factor, UnknownUnit, is_unit, to_si
from lagcli.model.names.expansion import expand
from lagcli.model.spelling import shorten
from lagcli.model.symbols import Context, Symbols
from lagcli.model.yaml.source import Scalar, YamlNode

_WITH_UNIT = re.compile(
    r"\s*([+-]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:[eE][+-]?[0-9]++)?)"
    r"\s*+(?![eE][+-]?[0-9])((?:[^\W\d_]|[°˚℃℉]|1\s*/).*)",
    re.DOTALL,
)


_LARGEST = 2**1023  # larger numbers may be beyond a double, which building an expression reports


class Quantity(NamedTuple):
    """A number with a unit, or an expression, parsed but not evaluated."""

    parsed: Parsed
    factor: Factor
    unit: str | None

    @property
    def number(self) -> Fraction | None:
        """The exact number; None for any other expression."""
        sign, tree = 1, self.parsed.tree
        if isinstance(tree, SumExpr) and len(tree.terms) == 1:
            sign, tree = tree.terms[0]
        if not isinstance(tree, NumberExpr) or tree.value >= _LARGEST:
            return None
        return sign * tree.value


def read_quantity(
    draft: Draft, node: YamlNode, what: str, names: Symbols, unit: str | None = None
) -> Quantity | None:
    """Parse a number with a unit, or an expression with a separate unit.

    Parameters
    ----------
    draft : Draft
    node : Node
    what : str
        Name of the quantity, for messages.
    names : Symbols
        Names that the expression may use.
    unit : str, optional
        Valid unit given in a separate field.
    """
    report = draft.report
    if not isinstance(node, Scalar):
        report.add(
            "wrong-type",
            f"{what} must be a number or an expression, not {node.what}",
            node.location,
            "write a number, or an expression of parameters",
        )
        return None
    if node.missing:
        report.add(
            "missing-value",
            f"{what} has no value",
            node.location,
            "write a number, or an expression of parameters",
        )
        return None
    text = node.value
    if match := _WITH_UNIT.fullmatch(text.replace("−", "-")):
        own = match[2].strip()
        if match[1] == "0" and re.match("[xXoObB][0-9a-fA-F]", own):
            location = node.span(match.start(1), match.end(2))
            message = f"`{shorten(text.strip())}` is not a number"
            report.add("syntax", message, location, "write a decimal number")
            return None
        if names.declared(own.split("*")[0].strip()) and (own[-1].isdigit() or not is_unit(own)):
            location = node.span(match.start(1), match.end(2))
            help_ = f"write a product as `{match[1]}*{own}`"
            report.add("syntax", f"`{text.strip()}` is not a number with a unit", location, help_)
            return None
        try:
            factor = to_si(own)
        except UnknownUnit as error:
            start = match.start(2)
            location = node.span(start, start + len(own))
            help_ = UNIT_HELP
            if re.fullmatch(r"[^\W\d]+(?:-[^\W\d]+)+", own):
                help_ = f"write a product of units as `{own.replace('-', '*')}`"
            elif re.search("[-+]", own):
                help_ = "write an expression with a unit as `{value: 2 + 1/2, unit: m}`"
            report.add("unknown-unit", f"{what}: {error}", location, help_)
            return None
        if unit is not None:
            report.add(
                "contradiction",
                f"{what} has two units, `{own}` and `{unit}`",
                node.span(match.start(2), match.start(2) + len(own)),
                "keep one of them",
            )
            return None
        # leading blanks preserve the offsets of the number
        text, unit = " " * match.start(1) + match[1], own
    else:
        factor = to_si(unit) if unit else 1
    with report.expression(node):
        try:
            tree = expand(parse(text), names)
            return Quantity(Parsed(node, tree), factor, unit)
        except ExpressionError as error:
            if error.message.startswith("an operator is missing") and error.help:
                error.help += ";\nwrite an expression with a unit as `{value: 2*pi, unit: rad/s}`"
            raise
    return None


def unit_of(node: YamlNode | None) -> str | None:
    """Return the unit after a number, or None."""
    match = _WITH_UNIT.fullmatch(node.value) if isinstance(node, Scalar) else None
    return match[2].strip() if match and is_unit(match[2].strip()) else None


def formula_of(
    draft: Draft,
    quantity: Quantity,
    context: Context,
    names: Symbols,
    indices: tuple[str, ...] = (),
) -> Formula | None:
    """Return the formula of a quantity; None for a plain number."""
    if quantity.number is not None:
        return None
    return Formula(draft, quantity.parsed, context, names, indices)


def evaluate(
    draft: Draft,
    quantity: Quantity,
    formula: Formula | None,
    what: str,
    indices: Indices = NO_INDICES,
) -> float | None:
    """Return the SI value of a quantity; report errors.

    Parameters
    ----------
    draft : Draft
    quantity : Quantity
    formula : Formula or None
        Formula of the quantity's expression.
    what : str
        Name of the quantity, for messages.
    indices : mapping of str to int
    """
    if formula is None:
        written = quantity.number
        assert written is not None
        value: Basic = se.Rational(written.numerator, written.denominator)
    else:
        value = formula.scalar(indices)
        if value is None:
            return None
    factor = quantity.factor
    if isinstance(factor, float) or not isinstance(value, se.Rational):
        scaled = value if factor == 1 else value * float(factor)
    else:
        # exact until the last step: 7 mm is 0.007 m
        scaled = value * se.Rational(factor.numerator, factor.denominator)
    try:
        return number(scaled)
    except ValueError:
        if formula is not None:
            formula.good = False
        draft.report.add(
            "not-a-number",
            f"{what} is not a real, finite number",
            quantity.parsed.node.location,
            "the largest number is 1.8e308",
        )
    return None


def constant(value: float) -> Basic:
    """Return a number as an expression; integers are exact, so that x^n can be an integer power."""
    exact = value.is_integer() and abs(value) < 2**53
    return se.Integer(int(value)) if exact else se.RealDouble(value)
