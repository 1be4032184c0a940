"""Dimensions of syntax trees, and the subtrees that disagree."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple, Protocol

from lagcli.errors import SourceLocation
from lagcli.functions import FUNCTIONS, DimensionRule
from lagcli.model.expression.dimension import (
    ANGLE,
    NUMBER,
    ONE,
    ROTATION,
    SECOND,
    UNKNOWN,
    ZERO,
    Dimension,
    Exponent,
    Scalar,
    Special,
    TensorDimension,
    Value,
    differing,
    power,
    product,
    rate_of,
    same,
    scalar_rate,
    whole,
)
from lagcli.model.expression.trees import (
    CallExpr,
    Comparison,
    ComponentExpr,
    IndexedSumExpr,
    LogicalExpr,
    Name,
    NumberExpr,
    PowerExpr,
    ProductExpr,
    RateExpr,
    SumExpr,
    Tree,
    VectorExpr,
    walk,
)


class Disagreement(NamedTuple):
    """Two parts of an expression with different dimensions, or one part with a wrong dimension.

    Parameters
    ----------
    reason : str
        ``sum``, ``comparison``, ``arguments``, ``cases`` or ``sides`` of an equation, whose
        dimensions must agree; ``number``: the part must be a number or an angle; ``exponent``: the
        base has a dimension and the exponent varies; ``entries`` of a scalar or matrix product;
        ``required``: the model gives the dimension.
    part : Tree
    dimension : Dimension or NUMBER
        The dimension of ``part``.
    expected : Dimension or NUMBER
        Dimension of ``other``, or the required one.
    other : Tree, optional
        The part compared with ``part``.
    role : str
        Description of ``part`` for messages: the argument of `sin`.
    """

    reason: str
    part: Tree
    dimension: Scalar
    expected: Scalar
    other: Tree | None = None
    role: str = ""


class Lookup(Protocol):
    """Resolution of the names of an expression."""

    def value(self, name: Name) -> Value:
        """Return the dimension of a name with its primes."""
        ...

    def number(self, name: Name) -> Fraction | None:
        """Return the value of a name in an exponent; None if it varies or is not rational."""
        ...

    def each(self, tree: IndexedSumExpr) -> Iterator[None]:
        """Iterate over the terms of a sum whose dimensions may differ."""
        ...


class DimensionEvaluator:
    """Evaluates the dimensions of syntax trees.

    Parameters
    ----------
    names : Lookup
    strict : bool
        Whether numbers take the unit with which their places are right (`FreeNumbers`), if they
        are terms, or factors other than small integers and their fractions. Otherwise a number may
        stand for a quantity: 0.3 for one of any dimension, 2 and 1/2 next to a quantity for one in
        the same unit.

    Attributes
    ----------
    disagreements : list of Disagreement
        Disagreements; a part in error has the dimension UNKNOWN, so that it is reported once.
    """

    def __init__(self, names: Lookup, strict: bool):
        self.names, self.strict = names, strict
        self.disagreements: list[Disagreement] = []
        self.numbers = FreeNumbers()

    def value(self, tree: Tree) -> Value:
        """Return the dimension of a tree, where it stands as a factor or an argument."""
        if self.strict and is_constant(tree) and not is_zero(tree):
            return NUMBER if is_small(tree) else self.numbers.unknown(tree)
        return _RULES[type(tree)](self, tree)

    def term(self, tree: Tree) -> Value:
        """Return the dimension of a tree, where it is a term, a side or a whole expression."""
        if self.strict:
            if is_constant(tree) and not is_zero(tree):
                return self.numbers.unknown(tree)
            if isinstance(tree, VectorExpr):
                return self._entries([self.term(item) for item in tree.items])
            if isinstance(tree, CallExpr) and tree.function == "diag":
                return self._diagonal([self.term(x) for x in tree.arguments])
        return self.value(tree)

    def beside(self, parts: Sequence[Tree]) -> list[Value]:
        """Return the dimensions of terms, sides or arguments that must agree.

        A number beside ``t`` itself is a time in s, which is no assumption: time has no other unit.
        """
        timed = self.strict and any(isinstance(x, Name) and x.text == "t" for x in parts)
        return [
            SECOND if timed and is_constant(x) and not is_zero(x) else self.term(x) for x in parts
        ]

    def scalar(self, tree: Tree) -> Scalar:
        """Return the dimension of a tree that is a scalar."""
        value = self.value(tree)
        return UNKNOWN if isinstance(value, TensorDimension) else value

    def common(self, parts: Iterable[Tree], reason: str) -> Value:
        """Return the common dimension of parts; report the first that differs."""
        first, *others = parts = tuple(parts)
        total, *values = self.beside(parts)
        shown = first
        for part, value in zip(others, values, strict=True):
            joined = self.join(total, value)
            if joined is None:
                a, b = differing(total, value)
                self.disagreements.append(Disagreement(reason, part, b, a, shown))
                return UNKNOWN
            if isinstance(total, Special) and joined is not total:
                shown = part
            total = joined
        return total

    def join(self, a: Value, b: Value) -> Value | None:
        """Return the common dimension of two values; None if they differ."""
        if a is b:
            return a
        if isinstance(a, TensorDimension) or isinstance(b, TensorDimension):
            return self._join_entries(a, b)
        if a is ZERO:
            return b
        if b is ZERO:
            return a
        if a is UNKNOWN or b is UNKNOWN:
            other = b if a is UNKNOWN else a
            return other if isinstance(other, Dimension) else UNKNOWN
        if a is NUMBER or b is NUMBER:
            other = b if a is NUMBER else a
            assert isinstance(other, Dimension)
            return other if not self.strict or self.numbers.agree(other, ONE) else None
        assert isinstance(a, Dimension)
        assert isinstance(b, Dimension)
        if not self.numbers.agree(a, b):
            return None
        return a if a.rad or b.numbers else b

    def _join_entries(self, a: Value, b: Value) -> Value | None:
        if not (isinstance(a, TensorDimension) and isinstance(b, TensorDimension)):
            if a is ZERO or b is ZERO:
                return b if a is ZERO else a
            return UNKNOWN  # of an expression that is inconsistent, or of a mixed family
        if a.shape != b.shape:
            return UNKNOWN
        joined = [self.join(x, y) for x, y in zip(a.flat, b.flat, strict=True)]
        entries = [x for x in joined if isinstance(x, Dimension | Special)]
        if len(entries) < len(joined):
            return None
        width = len(a.rows[0])
        rows = (tuple(entries[i : i + width]) for i in range(0, len(entries), width))
        return TensorDimension(tuple(rows))

    def number(self, tree: Tree) -> Fraction | None:
        """Return the value of an exponent; None if it is not a rational constant."""
        match tree:
            case NumberExpr():
                return tree.value
            case Name():
                return self.names.number(tree)
            case SumExpr():
                terms = [self.number(term) for _, term in tree.terms]
                known = [x for x in terms if x is not None]
                signs = [sign for sign, _ in tree.terms]
                if len(known) < len(terms):
                    return None
                return sum((s * x for s, x in zip(signs, known, strict=True)), Fraction(0))
            case ProductExpr():
                total = Fraction(1)
                for exponent, factor in tree.factors:
                    x = self.number(factor)
                    if x is None or (x == 0 and exponent < 0):
                        return None
                    total *= x if exponent > 0 else 1 / x
                return total
        return None

    # rules

    def _number(self, tree: NumberExpr) -> Value:
        if not tree.value:
            return ZERO
        return NUMBER if self.strict or not is_measured(tree) else UNKNOWN

    def _name(self, tree: Name) -> Value:
        return self.names.value(tree)

    def _sum(self, tree: SumExpr) -> Value:
        return self.common([term for _, term in tree.terms], "sum")

    def _series(self, tree: IndexedSumExpr) -> Value:
        total: Value = ZERO
        for _ in self.names.each(tree):
            value = self.value(tree.term)
            joined = self.join(total, value)
            if joined is None:
                a, b = differing(total, value)
                self.disagreements.append(Disagreement("sum", tree.term, b, a))
                return UNKNOWN
            total = joined
        return total

    def _product(self, tree: ProductExpr) -> Value:
        total: Value = NUMBER
        for exponent, factor in tree.factors:
            value = self.value(factor)
            if not isinstance(value, TensorDimension):
                if not isinstance(total, TensorDimension):
                    total = product(total, value, exponent)
                else:
                    total = total.map(partial(_multiplied, by=value, exponent=exponent))
            elif isinstance(total, TensorDimension):
                total = self._matrix_product(total, value, tree)
            else:
                total = value.map(partial(product, total))
        return total

    def _matrix_product(self, a: TensorDimension, b: TensorDimension, tree: Tree) -> Value:
        columns = list(zip(*b.rows, strict=False))
        return TensorDimension(
            tuple(tuple(self._scalar_product(row, x, tree) for x in columns) for row in a.rows)
        )

    def _scalar_product(
        self, row: Iterable[Scalar], column: Iterable[Scalar], tree: Tree
    ) -> Scalar:
        total: Scalar = ZERO
        for x, y in zip(row, column, strict=False):
            term = product(x, y)
            joined = self.join(total, term)
            if joined is None:
                self.disagreements.append(Disagreement("entries", tree, term, total))
                return UNKNOWN
            assert not isinstance(joined, TensorDimension)
            total = joined
        return total

    def _power(self, tree: PowerExpr) -> Value:
        return self.raised(tree.base, tree.exponent)

    def raised(self, base_tree: Tree, exponent_tree: Tree) -> Value:
        """Return the dimension of a power."""
        base = self.scalar(base_tree)
        if isinstance(exponent_tree, NumberExpr):
            return power(base, whole(exponent_tree.value))
        exponent = self.dimensionless(exponent_tree, "an exponent")
        if not isinstance(base, Dimension):
            return base
        number = self.number(exponent_tree)
        if number is not None:
            return power(base, whole(number))
        if self.numbers.agree(base, ONE):
            return ONE
        if isinstance(exponent, Dimension):  # not an index, and without errors
            self.disagreements.append(Disagreement("exponent", base_tree, base, ONE, exponent_tree))
        return UNKNOWN

    def _call(self, tree: CallExpr) -> Value:
        name, arguments = tree.function, tree.arguments
        if name in FUNCTIONS:
            return self._function(name, FUNCTIONS[name].dimension, arguments)
        if name == "if":
            self.value(arguments[0])
            return self.common(arguments[1:], "cases")
        return self._tensor_call(tree)

    def _function(
        self, name: str, rule: DimensionRule | Fraction, arguments: tuple[Tree, ...]
    ) -> Value:
        if isinstance(rule, Fraction):
            return power(self.scalar(arguments[0]), rule)
        match rule:
            case DimensionRule.NUMBER | DimensionRule.ANGLE:
                plain = [self.dimensionless(a, f"the argument of `{name}`") for a in arguments]
                if all(x is NUMBER or x is ZERO for x in plain):
                    return NUMBER
                return ONE if rule is DimensionRule.NUMBER else ANGLE
            case DimensionRule.SAME:
                return self.common(arguments, "arguments")
            case DimensionRule.DIRECTION:
                self.common(arguments, "arguments")
                return ANGLE
            case DimensionRule.SIGN:
                self.value(arguments[0])
                return ONE
            case DimensionRule.POWER:
                return self.raised(*arguments)

    def _tensor_call(self, tree: CallExpr) -> Value:
        name, arguments = tree.function, tree.arguments
        if name in ("rot_x", "rot_y", "rot_z", "rot", "quat"):
            for part in arguments[1:] if name == "rot" else arguments:
                self.dimensionless(part, f"the argument of `{name}`")
            return ROTATION
        if name == "diag":
            return self._diagonal([self.value(x) for x in arguments])
        if name == "omega":
            self.dimensionless(arguments[0], "a rotation")
            return TensorDimension(((scalar_rate(ANGLE, 1),),) * 3)
        each = self.term if name == "norm" else self.value
        values = [each(a) for a in arguments]
        first = values[0]
        if not all(isinstance(v, TensorDimension) for v in values):
            return TensorDimension(((UNKNOWN,),) * 3) if name == "cross" else UNKNOWN
        assert isinstance(first, TensorDimension)
        if name == "axial":
            return TensorDimension(tuple((product(x, ANGLE),) for x in first.rows[0]))
        if name == "transpose":
            return TensorDimension(tuple(zip(*first.rows, strict=False)))
        if name == "norm":
            return power(self._scalar_product(first.flat, first.flat, tree), Fraction(1, 2))
        second = values[1]
        assert isinstance(second, TensorDimension)
        if name == "dot":
            return self._scalar_product(first.flat, second.flat, tree)
        a, b = first.flat, second.flat
        # an axial vector: r × F is a torque, J/rad
        crossed = [
            product(self._scalar_product((a[i], a[j]), (b[j], b[i]), tree), ANGLE, -1)
            for i, j in ((1, 2), (2, 0), (0, 1))
        ]
        return TensorDimension(tuple((x,) for x in crossed))

    def dimensionless(self, tree: Tree, role: str) -> Value:
        """Return the dimension of a part that must be a number or an angle; report any other."""
        value = self.value(tree)
        for x in value.flat if isinstance(value, TensorDimension) else (value,):
            if isinstance(x, Dimension) and not self.numbers.agree(x, ONE):
                self.disagreements.append(Disagreement("number", tree, x, ONE, role=role))
                return UNKNOWN
        return value

    def _comparison(self, tree: Comparison) -> Value:
        self.common(tree.operands, "comparison")
        return ONE

    def _logical(self, tree: LogicalExpr) -> Value:
        for part in tree.operands:
            self.value(part)
        return ONE

    def _component(self, tree: ComponentExpr) -> Value:
        value = self.value(tree.base)
        if tree.key.isdigit():
            return ONE  # of a quaternion
        if not isinstance(value, TensorDimension):
            return value
        places = [self.number(index) for index in tree.indices]
        if tree.key:
            places = [Fraction("xyz".index(tree.key) + 1)]
        known = [int(x) - 1 for x in places if x is not None]
        if len(known) < len(places):
            return UNKNOWN
        row = value.rows[known[0]]
        return row[known[1] if len(known) > 1 else 0]

    def _rate(self, tree: RateExpr) -> Value:
        return rate_of(self.value(tree.operand), tree.order)

    def _vector(self, tree: VectorExpr) -> Value:
        # an entry beside others that are not numbers counts as a term
        each = self.value if all(map(is_constant, tree.items)) else self.term
        return self._entries([each(item) for item in tree.items])

    def _diagonal(self, values: list[Value]) -> TensorDimension:
        x, y, z = (UNKNOWN if isinstance(v, TensorDimension) else v for v in values)
        return TensorDimension(((x, ZERO, ZERO), (ZERO, y, ZERO), (ZERO, ZERO, z)))

    def _entries(self, values: list[Value]) -> TensorDimension:
        rows = tuple(v.flat if isinstance(v, TensorDimension) else (v,) for v in values)
        made = TensorDimension(rows)
        if self.strict or {NUMBER, ZERO}.issuperset(made.flat):
            return made
        return made.map(lambda x: UNKNOWN if x is NUMBER else x)


_RULES: dict[type[Tree], Callable[[DimensionEvaluator, Any], Value]] = {
    NumberExpr: DimensionEvaluator._number,
    Name: DimensionEvaluator._name,
    SumExpr: DimensionEvaluator._sum,
    IndexedSumExpr: DimensionEvaluator._series,
    ProductExpr: DimensionEvaluator._product,
    PowerExpr: DimensionEvaluator._power,
    CallExpr: DimensionEvaluator._call,
    Comparison: DimensionEvaluator._comparison,
    ComponentExpr: DimensionEvaluator._component,
    RateExpr: DimensionEvaluator._rate,
    LogicalExpr: DimensionEvaluator._logical,
    VectorExpr: DimensionEvaluator._vector,
}


def is_measured(number: NumberExpr) -> bool:
    """Whether a number may be a measured value, unlike 2, 1/2 or 0.25."""
    return number.value.denominator not in (1, 2, 4, 8)


def _multiplied(x: Scalar, by: Scalar, exponent: Exponent) -> Scalar:
    return product(x, by, exponent)


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
        self._trees: list[tuple[Tree, EntryPlace]] = []
        self._solved: dict[int, Dimension] = {}

    def unknown(self, tree: Tree) -> Dimension:
        """Return the unknown dimension of a number."""
        key = (id(tree), *self.member)
        number = self._keys.get(key)
        if number is None:
            number = self._keys[key] = len(self._trees)
            self._trees.append((tree, self.place))  # keeps the tree, whose id is the key
        return Dimension(numbers=((number, 1),))

    def resolved(self, value: Dimension) -> Dimension:
        """Return a dimension in which the known dimensions of its numbers are inserted."""
        while known := next((x for x in value.numbers if x[0] in self._solved), None):
            number, exponent = known
            rest = value._replace(numbers=tuple(x for x in value.numbers if x[0] != number))
            value = _as_dimension(product(rest, self._solved[number], exponent))
        return value

    def agree(self, a: Dimension, b: Dimension) -> bool:
        """Whether two dimensions can be equal; the last of their numbers takes the unit."""
        if not a.numbers and not b.numbers:
            return same(a, b)
        ratio = self.resolved(_as_dimension(product(a, b, -1)))
        if not ratio.numbers:
            return same(ratio, ONE)
        last, exponent = max(ratio.numbers)
        rest = ratio._replace(numbers=tuple(x for x in ratio.numbers if x[0] != last))
        self._solved[last] = _as_dimension(product(ONE, rest, Fraction(-1) / exponent))
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
        for number, (tree, place) in enumerate(self._trees):
            dimension = self._settled(Dimension(numbers=((number, 1),)))
            if isinstance(dimension, Dimension) and not same(dimension, ONE):
                yield FreeNumber(tree, place, dimension)


def is_constant(tree: Tree) -> bool:
    """Whether an expression consists of numbers, and possibly pi."""
    has_number = False
    for part in walk(tree):
        if isinstance(part, NumberExpr):
            has_number = True
        elif not (isinstance(part, _NUMERIC) or (isinstance(part, Name) and part.text == "pi")):
            return False
    return has_number


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


def _as_dimension(value: Scalar) -> Dimension:
    assert isinstance(value, Dimension)
    return value
