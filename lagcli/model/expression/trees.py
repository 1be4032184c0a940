"""Syntax trees of expressions, with source offsets."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

#: Placeholders for indices in the text of a name, by their number.
BRACKETS = {1: "[]", 2: "[,]"}


class Tree:
    """Node of a syntax tree, from offset ``start`` to ``end`` of the text."""

    __slots__ = ("end", "start")

    def __init__(self, start: int, end: int):
        self.start, self.end = start, end

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The child nodes."""
        return ()


class NumberExpr(Tree):
    """A number, with its exact value."""

    __slots__ = ("value",)

    def __init__(self, start: int, end: int, value: Fraction):
        self.start, self.end, self.value = start, end, value


class Name(Tree):
    """A name with its primes; ``text`` may be dotted (``lambda.guide``).

    In ``text``, each index of a family member is replaced by ``[]``: ``x[i - 1]`` is ``x[]``, and
    a pair of indices by ``[,]``: ``x[i, j]`` is ``x[,]``.
    """

    __slots__ = ("indices", "primes", "text")

    def __init__(
        self, start: int, end: int, text: str, primes: int, indices: tuple[Tree, ...] = ()
    ):
        self.start, self.end = start, end
        self.text, self.primes, self.indices = text, primes, indices


class CallExpr(Tree):
    """A function applied to arguments."""

    __slots__ = ("arguments", "function")

    def __init__(self, start: int, end: int, function: str, arguments: tuple[Tree, ...]):
        self.start, self.end, self.function, self.arguments = start, end, function, arguments

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The arguments."""
        return self.arguments


class SumExpr(Tree):
    """Terms with their signs, +1 or -1."""

    __slots__ = ("terms",)

    def __init__(self, start: int, end: int, terms: tuple[tuple[int, Tree], ...]):
        self.start, self.end, self.terms = start, end, terms

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The terms."""
        return tuple(term for _, term in self.terms)


class Range(Tree):
    """``first..last``, both included."""

    __slots__ = ("first", "last")

    def __init__(self, start: int, end: int, first: Tree, last: Tree):
        self.start, self.end, self.first, self.last = start, end, first, last


class IndexedSumExpr(Tree):
    """``sum(term, index = first..last)``."""

    __slots__ = ("index", "range", "term")

    def __init__(self, start: int, end: int, term: Tree, index: str, range: Range):
        self.start, self.end, self.term, self.index, self.range = start, end, term, index, range

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The term; the bounds of the range are integers, not values."""
        return (self.term,)


class ProductExpr(Tree):
    """Factors with their exponents, +1 or -1, from left to right."""

    __slots__ = ("factors",)

    def __init__(self, start: int, end: int, factors: tuple[tuple[int, Tree], ...]):
        self.start, self.end, self.factors = start, end, factors

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The factors."""
        return tuple(factor for _, factor in self.factors)


class PowerExpr(Tree):
    """Base and exponent."""

    __slots__ = ("base", "exponent")

    def __init__(self, start: int, end: int, base: Tree, exponent: Tree):
        self.start, self.end, self.base, self.exponent = start, end, base, exponent

    @property
    def parts(self) -> tuple[Tree, ...]:
        """Base and exponent."""
        return (self.base, self.exponent)


class Comparison(Tree):
    """A chain of comparisons: a < b <= c."""

    __slots__ = ("operands", "operators")

    def __init__(
        self, start: int, end: int, operands: tuple[Tree, ...], operators: tuple[str, ...]
    ):
        self.start, self.end, self.operands, self.operators = start, end, operands, operators

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The operands."""
        return self.operands


class LogicalExpr(Tree):
    """A logical operator, ``and``, ``or`` or ``not``, with its operands."""

    __slots__ = ("operands", "operator")

    def __init__(self, start: int, end: int, operator: str, operands: tuple[Tree, ...]):
        self.start, self.end, self.operator, self.operands = start, end, operator, operands

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The operands."""
        return self.operands


class VectorExpr(Tree):
    """A vector of scalars, or a matrix of rows."""

    __slots__ = ("items",)

    def __init__(self, start: int, end: int, items: tuple[Tree, ...]):
        self.start, self.end, self.items = start, end, items

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The entries."""
        return self.items


class ComponentExpr(Tree):
    """A component of a vector, matrix or rotation: ``(A*b).x``, ``w[2]``, ``R[1, 3]``.

    ``key`` is x, y or z, or 0 to 3 for the quaternion of a rotation; it is empty where ``indices``
    select the component.
    """

    __slots__ = ("base", "indices", "key")

    def __init__(self, start: int, end: int, base: Tree, key: str, indices: tuple[Tree, ...] = ()):
        self.start, self.end, self.base, self.key, self.indices = start, end, base, key, indices

    @property
    def parts(self) -> tuple[Tree, ...]:
        """The vector or matrix; its indices are integers, not values."""
        return (self.base,)


class RateExpr(Tree):
    """The total time derivative of an expression, of the given order."""

    __slots__ = ("operand", "order")

    def __init__(self, start: int, end: int, operand: Tree, order: int):
        self.start, self.end, self.operand, self.order = start, end, operand, order

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
