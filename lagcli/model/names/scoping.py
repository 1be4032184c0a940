"""Scope protocol, and values with their cost."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import NamedTuple, Protocol, TypeAlias

from symengine import Basic

from lagcli.model.expression.tensors import Tensor
from lagcli.model.expression.trees import IndexedSumExpr, Name, Tree

Value: TypeAlias = "Basic | Tensor"


class Sized(NamedTuple):
    """A value with its size, nesting depth and order of derivative.

    Parameters
    ----------
    value : expression, vector or matrix
    size : int
        Number of operations when fully expanded.
    depth : int
        Nesting depth of functions, powers and products.
    constant : bool
        Whether it contains no symbols.
    order : int
        Highest derivative of a coordinate in it; negative without coordinates.
    """

    value: Value
    size: int = 1
    depth: int = 0
    constant: bool = False
    order: int = -1


class Scope(Protocol):
    """Interface to the names of an expression."""

    def check(self, name: Name) -> None:
        """Raise ExpressionError for a name that is not allowed here."""

    def lookup(self, name: Name) -> Sized:
        """Return the value of a name, or raise ExpressionError."""

    def declared(self, text: str) -> bool:
        """Whether a name is declared."""

    def derivative(self, expression: Basic) -> Basic:
        """Return the total time derivative."""

    def mark_nonsmooth(self) -> None:
        """Record that a function with kinks or jumps is used."""

    def check_series(self, tree: IndexedSumExpr) -> Scope:
        """Return the scope of a sum's term, or raise ExpressionError for its index or range."""

    def each(self, tree: IndexedSumExpr) -> Iterator[int]:
        """Iterate over the index of a sum."""

    @property
    def functions(self) -> Collection[str]:
        """The names of the model's functions."""

    def check_index(self, tree: Tree) -> None:
        """Raise ExpressionError for a name that is not allowed in an index."""

    def index(self, tree: Tree) -> int:
        """Return the value of an index, or raise ExpressionError."""

    def check_order(self, tree: Tree, order: int) -> None:
        """Raise ExpressionError for a derivative of an expression that is too high."""

    def has_value(self, index: str) -> bool:
        """Whether a name is an index with a value."""

    def symbol(self, name: Name) -> Basic | None:
        """Return the symbol of a member; None for other names."""
