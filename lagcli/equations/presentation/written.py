"""Formulas from the syntax trees of a model, as the author wrote them."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from functools import lru_cache, partial

import symengine as se
from symengine import Basic

from lagcli.columns import read_dotted_name
from lagcli.equations.simplification.monomials import Exact
from lagcli.equations.typesetting import nodes as typeset
from lagcli.equations.typesetting.nodes import Node, product_of, quotient_of, sum_of
from lagcli.model.expression import trees
from lagcli.model.expression.constants import constant
from lagcli.model.expression.grammar import Tree
from lagcli.model.expression.tensors import Sized
from lagcli.model.model import Constraint, Model
from lagcli.model.names.building import build
from lagcli.model.names.members import family_of
from lagcli.model.names.namespace import Allowed, Namespace
from lagcli.model.names.scope import Scope

_HALF = typeset.Number(Fraction(1, 2))


Indices = Mapping[str, int]
_NONE: Indices = {}


def written(
    tree: Tree,
    model: Model,
    values: Mapping[str, Exact] | None = None,
    indices: Indices = _NONE,
) -> Node:
    """Return a syntax tree as a formula; indexed sums are written term by term.

    Parameters
    ----------
    tree : Tree
        Syntax tree of an expression in the model.
    model : Model
    values : mapping of str to exact numbers, optional
        Parameters to replace by their values.
    indices : mapping of str to int
        Index values of a family member.
    """
    return _SourceFormulas(model, dict(values or {}), indices).node(tree)


def named_in(tree: Tree, model: Model, indices: Indices = _NONE) -> tuple[str, ...]:
    """Return the definitions that a tree uses, in topological order."""
    scope = scope_of(model)
    names: dict[str, None] = {}
    stack: list[tuple[Tree | str, Indices, bool]] = [(tree, indices, False)]
    while stack:
        item, here, done = stack.pop()
        if isinstance(item, str):
            definition = model.definitions[item]
            if done:
                names[item] = None
            elif item not in names:
                stack += [(item, here, True), (definition.tree, definition.indices, False)]
            continue
        scope.values.clear()
        scope.values.update(here)
        if isinstance(item, trees.Name):
            name, _ = scope.named(item)
            if name in model.definitions:
                stack.append((name, {}, False))
        elif isinstance(item, trees.IndexedSumExpr):
            values = reversed(scope.indices.range(item.range))
            stack.extend((item.term, {**here, item.index: k}, False) for k in values)
        else:
            stack.extend((part, here, False) for part in reversed(item.parts))
    return tuple(names)


def differentiated_in(tree: Tree, model: Model) -> set[str]:
    """Return the scalar definitions whose time derivatives a tree uses."""
    scope = scope_of(model)
    names: set[str] = set()
    stack: list[tuple[Tree, Indices]] = [(tree, _NONE)]
    while stack:
        item, here = stack.pop()
        scope.values.clear()
        scope.values.update(here)
        if isinstance(item, trees.Name):
            name, dots = scope.named(item)
            definition = model.definitions.get(name)
            if definition is not None:
                if dots and isinstance(definition.value, Basic):
                    names.add(name)
                stack.append((definition.tree, definition.indices))
        elif isinstance(item, trees.IndexedSumExpr):
            values = scope.indices.range(item.range)
            stack.extend((item.term, {**here, item.index: k}) for k in values)
        else:
            stack.extend((part, here) for part in item.parts)
    return names


def sides_built(constraint: Constraint, model: Model) -> tuple[Basic, ...]:
    """Return the sides of a constraint as expressions, with definitions expanded."""
    scope = scope_of(model)
    scope.values.update(constraint.indices)
    sides = (constraint.left, constraint.right)
    if constraint.of_coordinate:
        return (constraint.expression,)
    return tuple(build(side, scope).value for side in sides if side is not None)


def scope_of(model: Model) -> Scope:
    """Return the scope of a model, with definitions expanded."""
    return Scope(_names(model), "the formula", Allowed.ACCELERATIONS)


@lru_cache(maxsize=2)  # cached: a formula is written for each of many members
def _names(model: Model) -> Namespace:
    families: dict[str, set[str]] = {}
    for kind, known in (
        ("coordinate", model.coordinate_names),
        ("definition", model.definitions),
        ("parameter", model.parameters),
    ):
        for name in known:
            if "[" in name:
                families.setdefault(family_of(name), set()).add(kind)
    return Namespace(
        coordinates=dict.fromkeys(model.coordinate_names),
        constraints=dict.fromkeys(model.constraint_names),
        parameters={name: partial(se.Symbol, name) for name in model.parameters},
        definitions={name: partial(Sized, d.value, 1) for name, d in model.definitions.items()},
        inputs={name: x.smoothness for name, x in model.inputs.items()},
        constants={n: partial(constant, p.value) for n, p in model.parameters.items()},
        families=families,
    )


class _SourceFormulas:
    def __init__(self, model: Model, values: dict[str, Exact], indices: Indices):
        self.model, self.values = model, values
        self.scope = scope_of(model)
        self.scope.values.update(indices)

    def node(self, tree: Tree) -> Node:
        match tree:
            case trees.NumberExpr():
                return typeset.Number(tree.value)
            case trees.Name():
                return self._name(tree)
            case trees.SumExpr():
                return self._sum(tree)
            case trees.IndexedSumExpr():
                return sum_of((1, self.node(tree.term)) for _ in self.scope.each(tree))
            case trees.ProductExpr():
                return self._product(tree)
            case trees.PowerExpr():
                return self._power(self.node(tree.base), self.node(tree.exponent))
            case trees.CallExpr():
                return self._call(tree)
            case trees.VectorExpr():
                return typeset.Vector(tuple(map(self.node, tree.items)))
            case trees.ComponentExpr():
                return self._component(tree)
            case trees.RateExpr():
                node = self.node(tree.operand)
                for _ in range(tree.order):
                    node = typeset.Rate(node)
                return node
            case trees.Comparison():
                sides = [self.node(operand) for operand in tree.operands]
                pairs = zip(sides, tree.operators, sides[1:], strict=False)
                links = tuple(typeset.Relation(*pair) for pair in pairs)
                return links[0] if len(links) == 1 else typeset.Logical("and", links)
            case trees.LogicalExpr():
                return typeset.Logical(tree.operator, tuple(map(self.node, tree.operands)))
        raise AssertionError(f"no such tree: {tree!r}")

    def _name(self, tree: trees.Name) -> Node:
        if tree.text in self.scope.values:
            return typeset.Number(Fraction(self.scope.values[tree.text]))
        name, dots = self.scope.named(tree)
        if name in self.values:
            return typeset.Number(Fraction(self.values[name]))
        if name == "pi" and name not in self.model.parameters:
            return typeset.Symbol("pi", kind="constant")
        column = read_dotted_name(name)
        if column is not None and column.quantity == "multipliers":
            return typeset.Symbol(column.constraint, kind="multiplier")
        return typeset.Symbol(name, dots)

    def _component(self, tree: trees.ComponentExpr) -> Node:
        base = self.node(tree.base)
        part = tree.key or ",".join(str(self.scope.index(index)) for index in tree.indices)
        return typeset.Component(base, part)

    def _sum(self, tree: trees.SumExpr) -> Node:
        terms = [(sign, self.node(term)) for sign, term in tree.terms]
        if self.scope.values:  # what vanishes for these indices, as (i − 1) d does for i = 1
            numbers = [s * x.value for s, x in terms if isinstance(x, typeset.Number)]
            if len(numbers) == len(terms) and not sum(numbers):
                return typeset.ZERO
            terms = [(s, x) for s, x in terms if x != typeset.ZERO]
        return sum_of(terms) if terms else typeset.ZERO

    def _product(self, tree: trees.ProductExpr) -> Node:
        above: list[Node] = []
        below: list[Node] = []
        number = Fraction(1)
        for exponent, factor in tree.factors:
            node = self.node(factor)
            if node == typeset.ZERO and exponent > 0 and self.scope.values:
                return typeset.ZERO
            if exponent > 0:
                above.append(node)
            elif isinstance(node, typeset.Number) and node.value:
                number /= node.value
            else:
                below.append(node)
        above.insert(0, typeset.Number(number))
        return quotient_of(product_of(above), product_of(below)) if below else product_of(above)

    def _power(self, base: Node, exponent: Node) -> Node:
        if exponent == _HALF:
            return typeset.Root(base)
        if (
            isinstance(base, typeset.Number)
            and isinstance(exponent, typeset.Number)
            and exponent.value.denominator == 1
            and abs(exponent.value) <= 20
            and (base.value or exponent.value > 0)
        ):
            return typeset.Number(base.value ** int(exponent.value))
        return typeset.Power(base, exponent)

    def _call(self, tree: trees.CallExpr) -> Node:
        arguments = tuple(map(self.node, tree.arguments))
        match tree.function:
            case "sqrt":
                return typeset.Root(arguments[0])
            case "cbrt":
                return typeset.Root(arguments[0], 3)
            case "if":
                return typeset.Cases(*arguments)
            case "pow":
                return self._power(*arguments)
        return typeset.Call("abs" if tree.function == "fabs" else tree.function, arguments)
