"""Expression templates: fast construction for successive values of an index.

Terms of a sum and members of a family usually differ only in the names of members: the second one
is the first one with x[0], x[1] renamed to x[1], x[2]. Renaming symbols takes a tenth of the time
of building an expression from its tree.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from symengine import Basic

from lagcli.model.expression.tensors import Tensor
from lagcli.model.expression.trees import ComponentExpr, IndexedSumExpr, Name, Tree, walk
from lagcli.model.names.scoping import Scope, Sized


class ExpressionTemplate:
    """Expression tree whose values are obtained by renaming symbols where possible.

    Parameters
    ----------
    tree : Tree
    scope : Scope
        Provides the current values of the indices.
    build : callable
        Builds the tree with these values.
    """

    def __init__(self, tree: Tree, scope: Scope, build: Callable[[Tree], Sized]):
        self.tree, self.scope, self.build = tree, scope, build
        parts = list(walk(tree))
        self.members = [p for p in parts if isinstance(p, Name) and p.indices]
        # if an index is used as a number, each value gives a different expression
        self.renamable = not any(
            isinstance(p, IndexedSumExpr)
            or (isinstance(p, ComponentExpr) and p.indices)
            or (isinstance(p, Name) and scope.has_value(p.text))
            for p in parts
        )
        self.first: tuple[list[Basic], Sized] | None = None

    def value(self) -> Sized:
        """Return the value for the current index values."""
        symbols = self._symbols() if self.renamable else None
        if symbols is None:
            return self.build(self.tree)
        if self.first is not None:
            names = _renaming(self.first[0], symbols)
            if names is not None:
                return _renamed(self.first[1], names)
        built = self.build(self.tree)
        if not (isinstance(built.value, Tensor) and built.value.factors):  # of a rotation
            self.first = symbols, built
        return built

    def _symbols(self) -> list[Basic] | None:
        found: list[Basic] = []
        for name in self.members:
            symbol = self.scope.symbol(name)
            if symbol is None:
                return None
            found.append(symbol)
        return found


def _renaming(old: Sequence[Basic], new: Sequence[Basic]) -> dict[Basic, Basic] | None:
    """Return the mapping from old to new symbols; None if it is not one-to-one."""
    names: dict[Basic, Basic] = {}
    for a, b in zip(old, new, strict=True):
        if names.setdefault(a, b) != b:
            return None
    return names if len(set(names.values())) == len(names) else None


def _renamed(sized: Sized, names: dict[Basic, Basic]) -> Sized:
    value = sized.value
    if isinstance(value, Tensor):
        return sized._replace(value=value.map(lambda x: x.xreplace(names)))
    return sized._replace(value=value.xreplace(names))
