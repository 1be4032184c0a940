"""Syntax trees of expressions, with source offsets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

#: What stands for indices in the text of a name, by their number.
BRACKETS = {1: "[]", 2: "[,]"}


@dataclass(eq=False, slots=True)
class Tree:
    """Node of a syntax tree, from offset ``start`` to ``end`` of the text."""

    start: int
    end: int

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The child nodes."""
        return ()


@dataclass(eq=False, slots=True)
class NumberExpr(Tree):
    """A number, with its exact value."""

    value: Fraction


@dataclass(eq=False, slots=True)
class Name(Tree):
    """A name with its primes; ``text`` may be dotted (``lambda.guide``).

    In ``text``, each index of a family member is replaced by ``[]``: ``x[i - 1]`` is ``x[]``, and
    a pair of indices by ``[,]``: ``x[i, j]`` is ``x[,]``.
    """

    text: str
    primes: int
    indices: tuple[Tree, ...] = ()


@dataclass(eq=False, slots=True)
class CallExpr(Tree):
    """A function applied to arguments."""

    function: str
    arguments: tuple[Tree, ...]

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The arguments."""
        return self.arguments


@dataclass(eq=False, slots=True)
class SumExpr(Tree):
    """Terms with their signs, +1 or -1."""

    terms: tuple[tuple[int, Tree], ...]

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The terms."""
        return tuple(term for _, term in self.terms)


@dataclass(eq=False, slots=True)
class Range(Tree):
    """``first..last``, both included."""

    first: Tree
    last: Tree


@dataclass(eq=False, slots=True)
class IndexedSumExpr(Tree):
    """``sum(term, index = first..last)``."""

    term: Tree
    index: str
    range: Range

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The term; the bounds of the range are integers, not values."""
        return (self.term,)


@dataclass(eq=False, slots=True)
class ProductExpr(Tree):
    """Factors with their exponents, +1 or -1, from left to right."""

    factors: tuple[tuple[int, Tree], ...]

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The factors."""
        return tuple(factor for _, factor in self.factors)


@dataclass(eq=False, slots=True)
class PowerExpr(Tree):
    """Base and exponent."""

    base: Tree
    exponent: Tree

    @property
    def parts(self) -> tuple[Tree, ...]:
        """Base and exponent."""
        return (self.base, self.exponent)


@dataclass(eq=False, slots=True)
class Comparison(Tree):
    """A chain of comparisons: a < b <= c."""

    operands: tuple[Tree, ...]
    operators: tuple[str, ...]

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The operands."""
        return self.operands


@dataclass(eq=False, slots=True)
class LogicalExpr(Tree):
    """A logical operator, ``and``, ``or`` or ``not``, with its operands."""

    operator: str
    operands: tuple[Tree, ...]

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The operands."""
        return self.operands


@dataclass(eq=False, slots=True)
class VectorExpr(Tree):
    """A vector of scalars, or a matrix of rows."""

    items: tuple[Tree, ...]

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The entries."""
        return self.items


@dataclass(eq=False, slots=True)
class ComponentExpr(Tree):
    """A component of a vector, matrix or rotation: ``(A*b).x``, ``w[2]``, ``R[1, 3]``.

    ``key`` is x, y or z, or 0 to 3 for the quaternion of a rotation; it is empty where ``indices``
    select the component.
    """

    base: Tree
    key: str
    indices: tuple[Tree, ...] = ()

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The vector or matrix; its indices are integers, not values."""
        return (self.base,)


@dataclass(eq=False, slots=True)
class RateExpr(Tree):
    """The total time derivative of an expression, of the given order."""

    operand: Tree
    order: int

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The expression."""
        return (self.operand,)


def walk(tree: Tree) -> Iterator[Tree]:
    """Yield all nodes of a tree in pre-order."""
    stack = [tree]
    while stack:
        top = stack.pop()
        yield top
        stack.extend(reversed(top.parts))


def as_written(name: Name) -> str:
    """Return a name as written in the text, with long indices shortened."""
    text = name.text
    for index in name.indices:
        short = str(index.value) if isinstance(index, NumberExpr) else "…"
        short = index.text if isinstance(index, Name) else short
        text = text.replace("[]", f"[{short}]", 1)
    return text
