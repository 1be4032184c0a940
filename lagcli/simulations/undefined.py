"""Location of an expression of a model that is not finite at a state."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.system import State
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.presentation.written import scope_of
from lagcli.errors import SourceLocation
from lagcli.model.expression import trees
from lagcli.model.expression.functions import derivative
from lagcli.model.expression.grammar import Tree
from lagcli.model.expression.tensors import Tensor, Value
from lagcli.model.locations import ExpressionLocations
from lagcli.model.model import NO_INDICES, TIME
from lagcli.model.names.building import build

_NAMED = 8  # largest number of coordinates whose values a message lists


class UndefinedExpression(NamedTuple):
    """An expression that is not finite: a clause, and its location in the model file."""

    clause: str
    location: SourceLocation | None

    @property
    def with_line(self) -> str:
        """The clause with the line of the model file."""
        line = self.location.line if self.location else 0
        return f"{self.clause} (line {line} of the model)" if line else self.clause


class _Written(NamedTuple):
    """A part of the model's text: the tree, its entry, and the index values."""

    tree: Tree
    block: str
    name: str | None = None
    indices: Mapping[str, int] = NO_INDICES


def undefined_expression(equations: Equations, state: State) -> UndefinedExpression:
    """Return the expression of the model that is not finite at a state.

    Parameters
    ----------
    equations : Equations
    state : State

    Returns
    -------
    Undefined
        A clause such as "`log(x)` in `V` has no finite value at x = -0.2", and its location. If all
        expressions are finite, it names the smallest one whose first or second derivatives are not.
    """
    return _ExpressionSearch(equations, state).first()


class _ExpressionSearch:
    def __init__(self, equations: Equations, state: State):
        self.equations, self.model = equations, equations.model
        self.state: dict[Basic, float] = {TIME: state.t}
        self.state.update(zip(equations.q, state.q.tolist(), strict=True))
        self.state.update(zip(equations.v, state.v.tolist(), strict=True))
        parameters = map(se.Symbol, self.model.parameters)
        self.values = {**self.state, **dict(zip(parameters, state.p, strict=True))}
        self.scope, self.functions = scope_of(self.model), input_functions(self.model)

    @cached_property
    def places(self) -> ExpressionLocations:
        return ExpressionLocations(self.model)

    def first(self) -> UndefinedExpression:
        statements = list(self.statements())
        for bad, what in ((self.unbounded, ""), (self.steep, "the derivative of ")):
            for part in statements:
                if bad(self.value(part)):
                    return self.described(part, bad, what)
        at = ", ".join(f"{s.name} = {x:.6g}" for s, x in self.listed(self.equations.q))
        node = self.places.entry("T") or self.places.entry("L")
        clause = (
            "the mass matrix does not determine the accelerations, with the constraints as they are"
        )
        for part in statements:
            if not all(map(self.is_known, _entries(self.value(part)))):
                node = self.places.entry(part.block, part.name)
                text = self.places.text(node, part.tree)
                clause = f"`{text}` in {_title(part)}, by its multipliers, has none, or {clause}"
                break
        return UndefinedExpression(f"{clause}, at {at}", self.places.location(node))

    def statements(self) -> Iterator[_Written]:
        """Yield the expressions of the model that determine the motion."""
        trees = self.model.trees
        for key in ("L", "T", "V", "D"):
            if key in trees:
                yield _Written(trees[key], key)
        for key, tree in trees.items():
            block, _, name = key.partition(".")
            if block == "Q" and "[" not in name:
                yield _Written(tree, block, name)
        for c in self.model.constraints:
            for side in (c.left, c.right):
                if side is not None:
                    yield _Written(side, "constraints", c.name, c.indices)
        for key, tree in trees.items():
            block, _, name = key.partition(".")
            if block == "constraints" and "[" not in name:
                yield _Written(tree, block, name)

    # parts

    def value(self, part: _Written) -> Value | None:
        """Return the value of a part as expressions; None for a condition."""
        if isinstance(part.tree, trees.Comparison | trees.LogicalExpr):
            return None
        self.scope.values.clear()
        self.scope.values.update(part.indices)
        return build(part.tree, self.scope).value

    def inside(self, part: _Written) -> Iterator[_Written]:
        """Yield the subexpressions of a part; for cases, the selected one; for a name, its
        definition."""
        tree = part.tree
        self.scope.values.clear()
        self.scope.values.update(part.indices)
        match tree:
            case trees.Name():
                name, _ = self.scope.named(tree)
                definition = self.model.definitions.get(name)
                if definition is not None:
                    yield _Written(definition.tree, "definitions", name, definition.indices)
            case trees.IndexedSumExpr():
                for k in self.scope.indices.range(tree.range):
                    yield part._replace(tree=tree.term, indices={**part.indices, tree.index: k})
            case trees.CallExpr(function="if"):
                condition, then, otherwise = tree.arguments
                one, zero = (trees.NumberExpr(0, 0, Fraction(x)) for x in (1, 0))
                truth = trees.CallExpr(0, 0, "if", (condition, one, zero))
                holds = self.value(part._replace(tree=truth))
                assert isinstance(holds, Basic)
                yield part._replace(tree=then if self.numbers([holds])[0] else otherwise)
            case _:
                for inner in tree.parts:
                    yield part._replace(tree=inner)

    # values

    def numbers(self, expressions: list[Basic]) -> list[float]:
        tape = compile_tape(expressions, list(self.values), (), self.functions)
        return ScalarTape(tape)(self.values.values())

    def unbounded(self, value: Value | None) -> bool:
        """Whether an expression is not finite."""
        return self.unbounded_any(_entries(value))

    def steep(self, value: Value | None) -> bool:
        """Whether an expression's first or second derivatives are not finite."""
        slopes = [derivative(e, s) for e in _entries(value) for s in self.symbols(e)]
        curvatures = [derivative(e, s) for e in slopes for s in self.symbols(e)]
        return self.unbounded_any(slopes) or self.unbounded_any(curvatures)

    def unbounded_any(self, expressions: list[Basic]) -> bool:
        known = [e for e in expressions if self.is_known(e)]
        return bool(known) and not all(map(math.isfinite, self.numbers(known)))

    def is_known(self, expression: Basic) -> bool:
        """Return whether an expression has a value: a state has no multipliers."""
        return expression.free_symbols <= self.values.keys()

    def symbols(self, expression: Basic) -> list[Basic]:
        """Return the coordinates, velocities and time in an expression."""
        return sorted((s for s in expression.free_symbols if s in self.state), key=str)

    # search

    def described(
        self, part: _Written, bad: Callable[[Value | None], bool], what: str
    ) -> UndefinedExpression:
        """Describe the smallest part that is not finite."""
        used_by = part
        while True:
            inner = next((x for x in self.inside(part) if bad(self.value(x))), None)
            if inner is None and isinstance(part.tree, trees.Name) and bad == self.unbounded:
                # the rate of a definition
                inner = next((x for x in self.inside(part) if self.steep(self.value(x))), None)
                bad, what = (self.steep, "the derivative of ") if inner else (bad, what)
            if inner is None:
                break
            part = inner
        node = self.places.entry(part.block, part.name)
        text = self.places.text(node, part.tree)
        where = _title(part)
        if part.block != used_by.block:
            where += f", which {_title(used_by)} uses,"
        symbols = {s for e in _entries(self.value(part)) for s in self.symbols(e)}
        at = ", ".join(f"{s.name} = {x:.6g}" for s, x in self.listed(sorted(symbols, key=str)))
        at = at or f"t = {self.state[TIME]:.6g}"
        clause = f"{what}`{text}` in {where} has no finite value at {at}"
        return UndefinedExpression(clause, self.places.location(node, part.tree))

    def listed(self, symbols: tuple[Basic, ...] | list[Basic]) -> list[tuple[Basic, float]]:
        return [(s, self.state[s]) for s in symbols[:_NAMED]]


def _entries(value: Value | None) -> list[Basic]:
    if value is None:
        return []
    return list(value.entries) if isinstance(value, Tensor) else [value]


def _title(part: _Written) -> str:
    """Return the description of an entry."""
    if part.name is None:
        return f"`{part.block}`"
    kind = {"definitions": "the definition", "constraints": "constraint", "Q": "the force on"}
    return f"{kind[part.block]} `{part.name}`"
