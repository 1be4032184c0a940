"""Order of symbols in products, taken from the model's own expressions."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

from lagcli.model.expression.trees import (
    CallExpr,
    IndexedSumExpr,
    Name,
    PowerExpr,
    ProductExpr,
    SumExpr,
    Tree,
)
from lagcli.model.model import Model
from lagcli.model.names.members import family_of


def writing_order(model: Model) -> tuple[str, ...]:
    """Return the parameters in the order in which the model writes them in products.

    m*g*r is displayed as m g r regardless of the order of declaration, which is used only for
    parameters that no product orders.
    """
    families: dict[str, list[str]] = {}
    for name in model.parameters:
        families.setdefault(family_of(name), []).append(name)
    before: dict[str, list[str]] = {family: [] for family in families}
    seen: set[tuple[str, str]] = set()
    trees: dict[str, dict[int, Tree]] = {}
    for name, definition in model.definitions.items():
        trees.setdefault(family_of(name), {})[id(definition.tree)] = definition.tree
    known = Known(families.keys(), {name: [*found.values()] for name, found in trees.items()})
    for tree in model.trees.values():
        for left, right in _pairs(tree, known):
            if (left, right) not in seen and (right, left) not in seen:
                seen.add((left, right))
                before[right].append(left)
    rank = {family: i for i, family in enumerate(families)}
    order: list[str] = []
    done: set[str] = set()
    for start in families:
        stack = [(start, False)]
        while stack:  # depth first: predecessors of a name come first
            name, ready = stack.pop()
            if ready:
                order += families[name]
            elif name not in done:
                done.add(name)
                stack.append((name, True))
                needed = sorted(before[name], key=rank.__getitem__, reverse=True)
                stack.extend((b, False) for b in needed)
    return tuple(order)


class Known(NamedTuple):
    """The parameters and definitions of a model; families as ``m[]``."""

    parameters: Collection[str]
    definitions: Mapping[str, list[Tree]]


def _pairs(tree: Tree, known: Known) -> Iterator[tuple[str, str]]:
    """Yield (a, b) if a factor a is written to the left of a factor b."""
    stack = [tree]
    while stack:
        item = stack.pop()
        match item:
            case SumExpr():
                stack.extend(term for _, term in reversed(item.terms))
            case PowerExpr():
                stack.append(item.base)
            case IndexedSumExpr():
                stack.append(item.term)
            case CallExpr():
                stack.extend(reversed(item.arguments))
            case ProductExpr():
                factors = [factor for exponent, factor in item.factors if exponent > 0]
                stack.extend(reversed(factors))
                passed: list[str] = []
                for factor in factors:
                    inside = _names(factor, known)
                    yield from ((a, b) for a in passed for b in inside if a != b)
                    if isinstance(factor, Name | PowerExpr):
                        passed.extend(name for name in inside if name not in passed)


def _names(tree: Tree, known: Known) -> list[str]:
    """Return the parameters that are factors in a tree, with definitions expanded."""
    found: dict[str, None] = {}
    opened: set[str] = set()
    stack = [tree]
    while stack:
        item = stack.pop()
        match item:
            case Name() if item.text in known.parameters:
                found[item.text] = None
            case Name() if item.text in known.definitions and item.text not in opened:
                opened.add(item.text)
                stack.extend(known.definitions[item.text])
            case IndexedSumExpr():
                stack.append(item.term)
            case SumExpr():
                stack.extend(term for _, term in reversed(item.terms))
            case PowerExpr():
                stack.append(item.base)
            case ProductExpr():
                above = [factor for exponent, factor in item.factors if exponent > 0]
                stack.extend(reversed(above))
    return list(found)
