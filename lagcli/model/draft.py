"""Draft of a model during loading: YAML nodes, symbol table, diagnostics, and entry parsing."""

from __future__ import annotations

from collections.abc import Mapping as MappingOf
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

from symengine import Basic

from lagcli.model.diagnostics import Broken, Diagnostics
from lagcli.model.expression.building import build, name_errors
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tensors import Tensor
from lagcli.model.expression.tokens import ExpressionError, error_at
from lagcli.model.expression.trees import Tree
from lagcli.model.model import NO_INDICES
from lagcli.model.names.expansion import expand
from lagcli.model.names.renaming import ExpressionTemplate
from lagcli.model.names.scope import ModelScope
from lagcli.model.names.scoping import Sized
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.symbols import Context, Symbols
from lagcli.model.yaml.source import Mapping, Scalar, Sequence, Source, YamlNode

Entry = tuple[str, Scalar, YamlNode]
Indices = MappingOf[str, int]


@dataclass(eq=False, repr=False)
class Draft:
    """State of loading a model file.

    Parameters
    ----------
    source : Source
    root : Mapping
    report : Diagnostics
    names : Symbols
    trees : dict of str to Tree
        Syntax trees of the expressions, by key: ``T``, ``Q.phi``, ``outputs.rod_force``.
    misspelled_keys : set of str
        Keys that the file misspells, whose error has been reported.
    members : int
        Number of family members so far.
    parameter_needs : mapping of str to lists of str
        Parameters that each parameter depends on.
    left_out : list of str
        Components of vector constraints that hold for all values of the coordinates.
    """

    source: Source
    root: Mapping
    report: Diagnostics
    names: Symbols = field(default_factory=Symbols)
    trees: dict[str, Tree] = field(default_factory=dict)
    misspelled_keys: set[str] = field(default_factory=set)
    members: int = 0
    parameter_needs: MappingOf[str, list[str]] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)

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

    def entries(self, key: str) -> list[Entry] | None:
        """Return the entries of the mapping under a key: empty if the key is missing, None if its
        value is not a mapping.
        """
        node = self.get(key)
        if node is None or (isinstance(node, Scalar) and node.missing):
            return []
        if isinstance(node, Mapping):
            return list(node)
        self.report.add(
            "wrong-type",
            f"`{key}` must be a mapping of names, not {node.what}",
            node.location,
            "write each entry on a line of its own, with a name, as in\n"
            f"{key}:\n  {_EXAMPLES[key]}",
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

    def build(self, parsed: Parsed, context: Context, names: Symbols | None = None) -> Sized | None:
        """Build the value of an expression; report errors."""
        return Formula(self, parsed, context, names).value()

    def scalar(
        self, parsed: Parsed, context: Context, names: Symbols | None = None
    ) -> Basic | None:
        """Build a scalar expression; report errors."""
        return Formula(self, parsed, context, names).scalar()


class Parsed(NamedTuple):
    """A scalar node and the syntax tree of its text."""

    node: Scalar
    tree: Tree


class Formula:
    """Expression of a model file, built for each value of its index.

    An error is reported once, for the first index value that causes it.

    Parameters
    ----------
    draft : Draft
    parsed : Parsed
    context : Context
    names : Symbols, optional
        Symbol table; the draft's by default.
    indices : tuple of str
        Names of the entry's indices.
    """

    def __init__(
        self,
        draft: Draft,
        parsed: Parsed,
        context: Context,
        names: Symbols | None = None,
        indices: tuple[str, ...] = (),
    ):
        self.draft, self.parsed, self.context = draft, parsed, context
        self.scope = ModelScope(names or draft.names, context, indices)
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
                f"{self.context.where} must be a scalar, not {sized.value.kind}",
                self.parsed.tree,
                "a scalar product is `dot(a, b)`",
            )
            self.draft.report.add_expression_error(error, self.parsed.node)
            return None
        return sized.value


_EXAMPLES = {
    "parameters": "m: 1 kg",
    "functions": "spring(u): k/2*u^2",
    "definitions": "x_A: r*cos(phi)",
    "inputs": "u: {file: road.csv, column: height}",
    "Q": "phi: tau",
    "constraints": "rod: x^2 + y^2 = l^2",
    "initial": "phi: 0.5",
    "outputs": "height: l*sin(phi)",
    "events": "flat: {when: theta <= 0, stop: true}",
    "simulation": "t_end: 10",
}
