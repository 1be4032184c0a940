"""Numbers without units in a model with units: which unit each of them takes."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import NamedTuple

from lagcli.errors import SourceLocation
from lagcli.model.expression.dimension import (
    ONE,
    Dimension,
    Scalar,
    TensorDimension,
    Value,
    product,
    same,
)
from lagcli.model.expression.trees import (
    CallExpr,
    Name,
    NumberExpr,
    PowerExpr,
    ProductExpr,
    SumExpr,
    Tree,
    walk,
)

#: Largest integer that is a pure number as a factor, such as 2 in m/2*x'^2, and denominators of
#: decimal fractions that are: 0.5, 0.25, 0.125.
_LARGEST, _DENOMINATORS = 12, (1, 2, 4, 8)
_NUMERIC = (NumberExpr, SumExpr, ProductExpr, PowerExpr, CallExpr)


class EntryPlace(NamedTuple):
    """The entry of a model in which an expression is evaluated.

    Parameters
    ----------
    block : str
    name : str or None
    location : SourceLocation or None
        Location of the value, if the entry is not enough to find it.
    """

    block: str
    name: str | None = None
    location: SourceLocation | None = None


class FreeNumber(NamedTuple):
    """A number without a unit, and the dimension that it takes."""

    tree: Tree
    place: EntryPlace
    dimension: Dimension


class FreeNumbers:
    """The numbers of a model that take the unit with which their places are right.

    Each has an unknown dimension, `Dimension.numbers`. Dimensions that must agree are equations,
    linear in the exponents, which are solved one by one: the number that comes last takes the unit.

    Attributes
    ----------
    place : EntryPlace
        The entry that is evaluated.
    member : tuple
        The member of a family that is evaluated, if members have different dimensions.
    """

    def __init__(self) -> None:
        self.place = EntryPlace("")
        self.member: tuple[object, ...] = ()
        self._keys: dict[tuple[object, ...], int] = {}
        self._found: list[tuple[Tree, EntryPlace]] = []
        self._solved: dict[int, Dimension] = {}

    def unknown(self, tree: Tree) -> Dimension:
        """Return the unknown dimension of a number."""
        key = (id(tree), *self.member)
        number = self._keys.get(key)
        if number is None:
            number = self._keys[key] = len(self._found)
            self._found.append((tree, self.place))  # keeps the tree, whose id is the key
        return Dimension(numbers=((number, 1),))

    def resolved(self, value: Dimension) -> Dimension:
        """Return a dimension with what is known of its numbers."""
        while known := next((x for x in value.numbers if x[0] in self._solved), None):
            number, exponent = known
            rest = value._replace(numbers=tuple(x for x in value.numbers if x[0] != number))
            value = _dimension(product(rest, self._solved[number], exponent))
        return value

    def agree(self, a: Dimension, b: Dimension) -> bool:
        """Whether two dimensions can be equal; the last of their numbers takes the unit."""
        if not a.numbers and not b.numbers:
            return same(a, b)
        ratio = self.resolved(_dimension(product(a, b, -1)))
        if not ratio.numbers:
            return same(ratio, ONE)
        last, exponent = max(ratio.numbers)
        rest = ratio._replace(numbers=tuple(x for x in ratio.numbers if x[0] != last))
        self._solved[last] = _dimension(product(ONE, rest, Fraction(-1) / exponent))
        return True

    def settled(self, value: Value) -> Value:
        """Return a value in which the numbers that have taken no unit are pure."""
        if isinstance(value, TensorDimension):
            return value.map(self._settled)
        return self._settled(value)

    def _settled(self, value: Scalar) -> Scalar:
        if not isinstance(value, Dimension) or not value.numbers:
            return value
        return self.resolved(value)._replace(numbers=())

    def taken(self) -> Iterator[FreeNumber]:
        """Yield the numbers that have taken a unit."""
        for number, (tree, place) in enumerate(self._found):
            found = self._settled(Dimension(numbers=((number, 1),)))
            if isinstance(found, Dimension) and not same(found, ONE):
                yield FreeNumber(tree, place, found)


def is_constant(tree: Tree) -> bool:
    """Whether an expression consists of numbers, and possibly pi."""
    found = False
    for part in walk(tree):
        if isinstance(part, NumberExpr):
            found = True
        elif not (isinstance(part, _NUMERIC) or (isinstance(part, Name) and part.text == "pi")):
            return False
    return found


def is_small(tree: Tree) -> bool:
    """Whether the numbers of an expression are integers up to 12, or fractions such as 0.5."""
    return all(
        abs(x.value.numerator) <= _LARGEST and x.value.denominator in _DENOMINATORS
        for x in walk(tree)
        if isinstance(x, NumberExpr)
    )


def is_zero(tree: Tree) -> bool:
    """Whether an expression is the number 0."""
    return isinstance(tree, NumberExpr) and not tree.value


def _dimension(value: Scalar) -> Dimension:
    assert isinstance(value, Dimension)
    return value
