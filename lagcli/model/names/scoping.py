"""What an expression may name, and what a name stands for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol, TypeAlias

from symengine import Basic

from lagcli.model.expression.tensors import Tensor
from lagcli.model.expression.trees import IndexedSumExpr, Name

Value: TypeAlias = "Basic | Tensor"


class Sized(NamedTuple):
    """A value, and what it costs.

    Parameters
    ----------
    value : expression, vector or matrix
    size : int
        Number of operations when it is written out.
    depth : int
        How deep functions, powers and products are nested in it.
    constant : bool
        Whether no symbol went into it.
    order : int
        The highest derivative of a coordinate that went into it; below 0 without coordinates.
    """

    value: Value
    size: int = 1
    depth: int = 0
    constant: bool = False
    order: int = -1


class Scope(Protocol):
    """What an expression may name."""

    def check(self, name: Name) -> None:
        """Raise ExpressionError for a name that may not stand here."""
        ...

    def lookup(self, name: Name) -> Sized:
        """Return what a name stands for, or raise ExpressionError."""
        ...

    def declared(self, text: str) -> bool:
        """Whether a name is declared."""
        ...

    def derivative(self, expression: Basic) -> Basic:
        """Return the total time derivative."""
        ...

    def note_kink(self) -> None:
        """Take notice of a function with kinks or jumps."""
        ...

    def check_series(self, tree: IndexedSumExpr) -> Scope:
        """Return the scope of a sum's term, or raise ExpressionError for its index and range."""
        ...

    def each(self, tree: IndexedSumExpr) -> Iterator[int]:
        """Give the index of a sum one value after the other."""
        ...

    def has_value(self, index: str) -> bool:
        """Whether a name is an index."""
        ...

    def symbol(self, name: Name) -> Basic | None:
        """Return the symbol of a member; None for anything else."""
        ...
