"""In which order a model's names are written side by side."""

from __future__ import annotations

from collections.abc import Iterator

from lagcli.model.grammar import Call, Name, Power, Product, Sum, Tree
from lagcli.model.model import Model


def writing_order(model: Model) -> tuple[str, ...]:
    """Return the parameters in the order in which the model's author writes them in products.

    Who writes m*g*r wants to read m g r, whatever the order of declaration, which decides where
    no product does.
    """
    before: dict[str, list[str]] = {name: [] for name in model.parameters}
    seen: set[tuple[str, str]] = set()
    for tree in model.trees.values():
        for left, right in _pairs(tree, model):
            if (left, right) not in seen and (right, left) not in seen:
                seen.add((left, right))
                before[right].append(left)
    rank = {name: i for i, name in enumerate(model.parameters)}
    order: list[str] = []
    done: set[str] = set()
    for start in model.parameters:
        stack = [(start, False)]
        while stack:  # depth first: what is written before a name comes before it
            name, ready = stack.pop()
            if ready:
                order.append(name)
            elif name not in done:
                done.add(name)
                stack.append((name, True))
                needed = sorted(before[name], key=rank.__getitem__, reverse=True)
                stack.extend((b, False) for b in needed)
    return tuple(order)


def _pairs(tree: Tree, model: Model) -> Iterator[tuple[str, str]]:
    """Yield (a, b) where a factor a stands left of a factor b."""
    stack = [tree]
    while stack:
        item = stack.pop()
        match item:
            case Sum():
                stack.extend(term for _, term in reversed(item.terms))
            case Power():
                stack.append(item.base)
            case Call():
                stack.extend(reversed(item.arguments))
            case Product():
                factors = [factor for exponent, factor in item.factors if exponent > 0]
                stack.extend(reversed(factors))
                passed: list[str] = []
                for factor in factors:
                    inside = _names(factor, model)
                    yield from ((a, b) for a in passed for b in inside if a != b)
                    if isinstance(factor, Name | Power):
                        passed.extend(name for name in inside if name not in passed)


def _names(tree: Tree, model: Model) -> list[str]:
    """Return the parameters that occur as factors in a tree, definitions written out."""
    found: dict[str, None] = {}
    opened: set[str] = set()
    stack = [tree]
    while stack:
        item = stack.pop()
        match item:
            case Name() if item.text in model.parameters:
                found[item.text] = None
            case Name() if item.text in model.definitions and item.text not in opened:
                opened.add(item.text)
                stack.append(model.definitions[item.text].tree)
            case Sum():
                stack.extend(term for _, term in reversed(item.terms))
            case Power():
                stack.append(item.base)
            case Product():
                above = [factor for exponent, factor in item.factors if exponent > 0]
                stack.extend(reversed(above))
    return list(found)
