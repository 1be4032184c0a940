"""Series as multiples of others, and their sums and products.

Numbers that are constant along a run are not multiplied immediately: a series is represented as a
number times another one, its base, and sums apply the numbers. Adding a number to a series changes
only its first coefficient.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from lagcli.engine.tape.series_operations import SeriesOp
from lagcli.engine.tape.tape import Arithmetic
from lagcli.engine.taylor.series_nodes import ZERO, Delayed, Name, SeriesNode, UnnamedSeries

Form = tuple[int, Name]  # the register of a number, and a series


class SeriesForms:
    """Creates sums and products of series represented as multiples.

    A series is named by the register of its first coefficient, if it has one.

    Parameters
    ----------
    builder : Arithmetic
        Receives the operations on numbers and on first coefficients.
    """

    def __init__(self, builder: Arithmetic):
        self.builder = builder
        self.zero, self.one = builder.zero, builder.one
        self.minus_one = builder.negative(builder.one)
        self.nodes: dict[Name, SeriesNode] = {}
        self.whole: dict[Name, Form] = {}
        self.tails: dict[Name, Form] = {}  # valid beyond the first coefficient
        self.begins: dict[Name, int] = {ZERO: self.zero}  # of series without a register
        self.brackets: dict[tuple[Form, ...], Name] = {}
        self.products: dict[tuple[Name, Name], Name] = {}  # products without a register
        self.tail_products: dict[tuple[Name, Name], Name] = {}  # without the first coefficient of x

    def new(self, begin: int) -> UnnamedSeries:
        """Return a name for a series without a register."""
        name = UnnamedSeries(ZERO.number + len(self.begins))
        self.begins[name] = begin
        return name

    def begin(self, x: Name) -> int:
        """Return the register of a series' first coefficient."""
        return self.begins[x] if isinstance(x, UnnamedSeries) else x

    def form(self, x: Name) -> Form:
        """Return a series as a number times another."""
        return self.whole.get(x, (self.one, x))

    def tail(self, x: Name) -> Form:
        """Return a series as a multiple of another, except for the first coefficients."""
        return self.tails.get(x) or self.form(x)

    def scaled(self, to: Name, scale: Callable[[int], int], x: Name) -> None:
        """Register a series as a multiple of another; ``scale`` computes its number."""
        number, base = self.form(x)
        self.whole[to] = scale(number), base
        if x in self.tails:
            number, base = self.tails[x]
            self.tails[to] = scale(number), base

    def add(self, terms: Iterable[Form], to: Name | None = None) -> Form:
        """Add multiples of series, except for the first coefficients; ``to`` names the sum."""
        numbers: dict[Name, int] = {}
        for s, x in terms:
            if x != ZERO and s != self.zero:
                numbers[x] = self.builder.plus(numbers[x], s) if x in numbers else s
        left = [(s, x) for x, s in numbers.items()] or [(self.one, ZERO)]
        total, *others = left
        for n, (s, x) in enumerate(others, 1):
            name = to if to is not None and n == len(others) else self.new(self.zero)
            self.nodes[name] = SeriesOp.SUM, (name,), (*total, s, x)
            total = self.one, name
        if to is not None and not others:
            self.nodes[to] = SeriesOp.SCALE, (to,), total
            total = self.one, to
        return total

    def normal(self, terms: Sequence[Form]) -> tuple[int, list[Form]]:
        """Return a number with the common sign of all terms, or the sign of the first one; and the
        terms divided by it.
        """
        number, negative = terms[0][0], self.builder.negative
        if {s for s, _ in terms} <= {number, negative(number)}:
            return number, [(self.one if s == number else self.minus_one, x) for s, x in terms]
        if number in self.builder.opposite:
            return self.minus_one, [(negative(s), x) for s, x in terms]
        return self.one, [*terms]

    def bracket(self, terms: Sequence[Form], rewrite: Callable[[list[Form]], list[Form]]) -> Form:
        """Create a sum that is multiplied as a whole, from terms converted by ``rewrite``."""
        number, left = self.normal(terms)
        key = tuple(left)
        if key not in self.brackets:
            begin = self.zero
            for s, x in left:
                begin = self.builder.plus(begin, self.builder.times(s, self.begin(x)))
            self.brackets[key] = name = self.new(begin)
            self.add(rewrite(left), name)
        return number, self.brackets[key]

    def multiply(self, x: Name, y: Name, tail: bool = False) -> Name:
        """Return the name of a product; ``tail``: without x's first coefficient times y."""
        products = self.tail_products if tail else self.products
        if (x, y) not in products:
            begin = self.zero if tail else self.builder.times(self.begin(x), self.begin(y))
            products[x, y] = name = self.new(begin)
            factors = (x, Delayed(y) if tail else y)
            self.nodes[name] = SeriesOp.MUL_TAIL if tail else SeriesOp.MUL, (name,), factors
        return products[x, y]
