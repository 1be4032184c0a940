"""Reading of a model file: its entries, expressions and quantities, and the diagnostics."""

from __future__ import annotations

import re
from collections.abc import Mapping as MappingOf
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.model.diagnostics import Broken, Diagnostics
from lagcli.model.expression.constants import number
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tensors import Sized, Tensor
from lagcli.model.expression.tokens import ExpressionError, error_at
from lagcli.model.expression.trees import NumberExpr, SumExpr, Tree
from lagcli.model.expression.units import (
    UNIT_HELP,
    WITH_UNIT,
    Factor,
    UnknownUnit,
    is_unit,
    to_si,
)
from lagcli.model.model import NO_INDICES, Constraint, Definition, Parameter, Tolerance
from lagcli.model.names.building import ExpressionTemplate, build, name_errors
from lagcli.model.names.expansion import expand
from lagcli.model.names.namespace import Allowed, Namespace
from lagcli.model.names.scope import Scope
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.source import Mapping, Scalar, Sequence, Source, YamlNode

Entry = tuple[str, Scalar, YamlNode]
Indices = MappingOf[str, int]


@dataclass(eq=False)
class Draft:
    """A model file that is being read.

    Parameters
    ----------
    source : Source
    root : Mapping
    report : Diagnostics
    names : Namespace
    trees : dict of str to Tree
        Syntax trees of the expressions, by key: ``T``, ``definitions.x_A``, ``Q.phi``.
    misspelled_keys : set of str
        Keys that the file misspells, whose error has been reported.
    left_out : list of str
        Components of vector constraints that hold for all values of the coordinates.
    parameters, definitions, constraints, outputs : mappings of str, and tuple of Constraint
        What has been read without errors, in the order of the model.
    """

    source: Source
    root: Mapping
    report: Diagnostics
    names: Namespace = field(default_factory=Namespace)
    trees: dict[str, Tree] = field(default_factory=dict)
    tolerances: dict[str, Tolerance] = field(default_factory=dict)
    misspelled_keys: set[str] = field(default_factory=set)
    left_out: list[str] = field(default_factory=list)
    parameters: MappingOf[str, Parameter] = field(default_factory=dict)
    definitions: MappingOf[str, Definition] = field(default_factory=dict)
    constraints: tuple[Constraint, ...] = ()
    outputs: MappingOf[str, Basic] = field(default_factory=dict)

    # entries

    def get(self, key: str) -> YamlNode | None:
        """Return the value of a key of the model."""
        return self.root.entries[key][1] if key in self.root.entries else None

    def text(self, node: YamlNode | None, what: str) -> str | None:
        """Return the text of a node; report a node that is not text."""
        if node is None or isinstance(node, Scalar):
            return None if node is None or node.missing else node.value
        self.report.add(
            "wrong-type",
            f"{what} must be text, not {node.what}",
            node.location,
            "put quotes around it",
        )
        return None

    def mapping(self, node: YamlNode, what: str, help_: str) -> Mapping | None:
        """Return a node that must be a mapping; report any other."""
        if isinstance(node, Mapping):
            return node
        message = f"{what} must be a mapping, not {node.what}"
        self.report.add("wrong-type", message, node.location, help_)
        return None

    def flag(self, node: YamlNode, what: str, help_: str) -> bool | None:
        """Return a truth value, ``true`` or ``false``; report any other node."""
        if isinstance(node, Scalar) and node.value.strip() in ("true", "false"):
            return node.value.strip() == "true"
        message = f"{what} must be true or false, not {node.what}"
        self.report.add("wrong-type", message, node.location, help_)
        return None

    def entries(self, key: str) -> list[Entry] | None:
        """Return the entries of the mapping under a key: empty if the key is missing, None if its
        value is not a mapping.
        """
        node = self.get(key)
        if node is None or (isinstance(node, Scalar) and node.missing):
            return []
        if isinstance(node, Mapping):
            return list(node)
        help_ = "write each entry on a line of its own, with a name, as in"
        if isinstance(node, Scalar) and (named := re.match(r"[^\s:]+:(?=\S)", node.value)):
            help_ = f"write a space after `{named[0]}`, as in"
        self.report.add(
            "wrong-type",
            f"`{key}` must be a mapping of names, not {node.what}",
            node.location,
            f"{help_}\n{key}:\n  {_EXAMPLES[key]}",
        )
        return None

    def fields(self, node: Mapping, what: str, known: tuple[str, ...]) -> dict[str, YamlNode]:
        """Return the fields of an entry that is a mapping; report unknown fields."""
        fields = {}
        for name, key, value in node:
            if name in known:
                fields[name] = value
            else:
                self.report.add(
                    "unknown-key",
                    f"{what} has no field `{shorten(name)}`",
                    key.location,
                    did_you_mean(nearest(name, known, 1))
                    or ("its fields are " if len(known) > 1 else "its only field is ")
                    + ", ".join(f"`{k}`" for k in known),
                )
        return fields

    def expression_node(
        self,
        key: Scalar,
        node: YamlNode,
        what: str,
        known: tuple[str, ...],
        example: str = "expression",
    ) -> tuple[YamlNode | None, dict[str, YamlNode]]:
        """Return the node of an expression, which may be the field ``expr`` of a mapping."""
        if not isinstance(node, Mapping):
            return node, {}
        fields = self.fields(node, what, known)
        if "expr" not in fields:
            self.report.add(
                "missing-value",
                f"{what} has no `expr`",
                key.location,
                f"write `{shorten(key.value)}: {example}`, or"
                f" `{shorten(key.value)}: {{expr: {example}}}`",
            )
            return None, fields
        return fields["expr"], fields

    # expressions

    def parse(self, node: YamlNode, what: str, example: str = "expression") -> Parsed | None:
        """Parse an expression and expand the functions in it; report errors."""
        parsed = self.parse_alone(node, what, example)
        if parsed is not None:
            with self.report.expression(parsed.node):
                return Parsed(parsed.node, expand(parsed.tree, self.names))
        return None

    def parse_alone(self, node: YamlNode, what: str, example: str = "expression") -> Parsed | None:
        """Parse an expression without expanding functions; report errors."""
        if isinstance(node, Sequence):
            node = self.vector_text(node)
        if not isinstance(node, Scalar):
            help_ = "write the expression alone, without a name before it"
            if isinstance(node, Sequence):
                help_ = "write a vector as `[a, b]`, a matrix as `[[a, b], [c, d]]`"
            self.report.add(
                "wrong-type",
                f"{what} must be an expression, not {node.what}",
                node.location,
                help_,
            )
            return None
        if node.missing:
            self.report.add(
                "missing-value", f"{what} is empty", node.location, f"give an {example}"
            )
            return None
        with self.report.expression(node):
            return Parsed(node, parse(node.value))
        return None

    def vector_text(self, node: Sequence) -> YamlNode:
        """Return a YAML list ``[a, b]`` as the text of a vector expression."""
        line, column = node.start
        if node.source.lines[line][column : column + 1] != "[":
            return node
        text = node.source.between(node.start, node.end)
        return Scalar(node.source, node.start, node.end, text)

    def scalar(self, parsed: Parsed, where: str, allowed: Allowed = Allowed.MOTION) -> Basic | None:
        """Build a scalar expression; report errors."""
        return Formula(self, parsed, where, allowed).scalar()


class Parsed(NamedTuple):
    """A scalar node and the syntax tree of its text."""

    node: Scalar
    tree: Tree


class Formula:
    """Expression of a model file, built for each value of its indices.

    An error is reported once, for the first index values that cause it.

    Parameters
    ----------
    draft : Draft
    parsed : Parsed
    where : str
        Description of the expression, for messages.
    allowed : Allowed
    indices : tuple of str
        Names of the entry's indices.
    """

    def __init__(
        self,
        draft: Draft,
        parsed: Parsed,
        where: str,
        allowed: Allowed = Allowed.MOTION,
        indices: tuple[str, ...] = (),
    ):
        self.draft, self.parsed = draft, parsed
        self.scope = Scope(draft.names, where, allowed, indices)
        errors, broken = name_errors(parsed.tree, self.scope)
        for error in errors:
            draft.report.add_expression_error(error, parsed.node)
        self.good = not (errors or broken)
        self.repeated: ExpressionTemplate | None = None

    def value(self, indices: Indices = NO_INDICES) -> Sized | None:
        """Return the value for given index values; None if the expression has an error.

        Raises
        ------
        Unbuilt
            A name that it uses has no value yet.
        """
        if not self.good:
            return None
        scope, report = self.scope, self.draft.report
        scope.missing.clear()
        scope.values.clear()
        scope.values.update(indices)
        try:
            if self.repeated is None:
                self.repeated = ExpressionTemplate(
                    self.parsed.tree, scope, partial(build, scope=scope)
                )
            sized = self.repeated.value()
        except Broken:
            self.good = False
            return None
        except ExpressionError as error:
            self.good = False
            if (at := scope.at()) not in error.message:
                error.message += f",{at}"
            report.add_expression_error(error, self.parsed.node)
            return None
        for missing in scope.missing.values():
            self.good = False
            report.add_expression_error(missing, self.parsed.node)
        return sized if self.good else None

    def scalar(self, indices: Indices = NO_INDICES) -> Basic | None:
        """Return the value as `value` does; report a value that is not a scalar."""
        sized = self.value(indices)
        if sized is None:
            return None
        if isinstance(sized.value, Tensor):
            self.good = False
            error = error_at(
                "shape",
                f"{self.scope.where} must be a scalar, not {sized.value.kind}",
                self.parsed.tree,
                "a scalar product is `dot(a, b)`",
            )
            self.draft.report.add_expression_error(error, self.parsed.node)
            return None
        return sized.value


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
    draft: Draft, node: YamlNode, what: str, unit: str | None = None
) -> Quantity | None:
    """Parse a number with a unit, or an expression with a separate unit.

    What follows a number and can be a unit is one, also where a quantity of the model has its name.

    Parameters
    ----------
    draft : Draft
    node : Node
    what : str
        Name of the quantity, for messages.
    unit : str, optional
        Valid unit given in a separate field.
    """
    report, names = draft.report, draft.names
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
    if match := WITH_UNIT.fullmatch(text.replace("−", "-")):
        own = match[2].strip()
        if match[1] == "0" and re.match("[xXoObB][0-9a-fA-F]", own):
            location = node.span(match.start(1), match.end(2))
            message = f"`{shorten(text.strip())}` is not a number"
            report.add("syntax", message, location, "write a decimal number")
            return None
        if names.declared(own.split("*")[0].strip()) and not is_unit(own):
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
            elif re.search("[-+]", re.sub(r"(?<=[^\W\d]|\^|\*)[-+](?=[0-9])", "", own)):  # no power
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
    match = WITH_UNIT.fullmatch(node.value) if isinstance(node, Scalar) else None
    return match[2].strip() if match and is_unit(match[2].strip()) else None


class QuantityValue:
    """Value of a quantity in SI, for each value of its entry's indices.

    Parameters
    ----------
    draft : Draft
    quantity : Quantity
    what : str
        Name of the quantity, for messages.
    allowed : Allowed
    indices : tuple of str
        Names of the entry's indices.
    """

    def __init__(
        self,
        draft: Draft,
        quantity: Quantity,
        what: str,
        allowed: Allowed = Allowed.NUMBERS,
        indices: tuple[str, ...] = (),
    ):
        self.draft, self.quantity, self.what = draft, quantity, what
        self.formula: Formula | None = None
        if quantity.number is None:
            self.formula = Formula(draft, quantity.parsed, what, allowed, indices)

    @property
    def good(self) -> bool:
        """Whether no error has been found in it."""
        return self.formula is None or self.formula.good

    def expression(self, indices: Indices = NO_INDICES) -> Basic | None:
        """Return the value as an expression; report errors."""
        written, factor = self.quantity.number, self.quantity.factor
        value: Basic | None
        if self.formula is not None:
            value = self.formula.scalar(indices)
        else:
            assert written is not None
            value = se.Rational(written.numerator, written.denominator)
        if value is None or factor == 1:
            return value
        if isinstance(factor, float) or not isinstance(value, se.Rational):
            return value * float(factor)
        # exact until the last step: 7 mm is 0.007 m
        return value * se.Rational(factor.numerator, factor.denominator)

    def number(self, indices: Indices = NO_INDICES) -> float | None:
        """Return the value as a number; report errors."""
        value = self.expression(indices)
        if value is None:
            return None
        try:
            return number(value)
        except ValueError:
            if self.formula is not None:
                self.formula.good = False
            self.draft.report.add(
                "not-a-number",
                f"{self.what} is not a real, finite number",
                self.quantity.parsed.node.location,
                "the largest number is 1.8e308",
            )
        return None


_EXAMPLES = {
    "parameters": "m: 1 kg",
    "functions": "spring(u): k/2*u^2",
    "definitions": "x_A: r*cos(phi)",
    "inputs": "u: {file: road.csv, column: height}",
    "Q": "phi: tau",
    "constraints": "rod: x^2 + y^2 = l^2",
    "initial": "phi: 0.5",
    "outputs": "height: l*sin(phi)",
    "presets": "heavy: {parameters: {m: 2 kg}}",
    "events": "flat: {when: theta <= 0, stop: true}",
    "simulation": "t_end: 10",
}
