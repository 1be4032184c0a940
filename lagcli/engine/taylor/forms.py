"""Series as numbers times others; sums and products of these.

Numbers that stay the same along a run are not multiplied by: a series is a number times another
one, its base, as long as possible, and sums take the numbers in. What is added to a series changes
its first coefficient alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from lagcli.engine.program.nodes import Node
from lagcli.engine.tape.arithmetic import Arithmetic
from lagcli.engine.taylor.series_nodes import BEFORE, NAMELESS, ZERO, SeriesOp

Form = tuple[int, int]  # the registers of a number and of a series' first coefficient


class SeriesForms:
    """Knows series as multiples, and makes sums and products of them.

    A series is named by the register of its first coefficient; what has none is nameless.

    Parameters
    ----------
    builder : Arithmetic
        Takes the operations on numbers and on first coefficients.
    """

    def __init__(self, builder: Arithmetic):
        self.builder = builder
        self.zero, self.one = builder.zero, builder.one
        self.minus_one = builder.negative(builder.one)
        self.nodes: dict[int, Node] = {}
        self.whole: dict[int, Form] = {}
        self.tails: dict[int, Form] = {}  # what counts beyond the first coefficient
        self.begins: dict[int, int] = {}  # what a nameless series begins with
        self.brackets: dict[tuple[Form, ...], int] = {}
        self.products: dict[tuple[int, int], int] = {}  # that no register has

    def new(self, begin: int) -> int:
        """Return a name for a series without a register."""
        name = NAMELESS + len(self.begins)
        self.begins[name] = begin
        return name

    def begin(self, x: int) -> int:
        """Return the register of a series' first coefficient."""
        return self.begins.get(x, x)

    def form(self, x: int) -> Form:
        """Return a series as a number times another."""
        return self.whole.get(x, (self.one, x))

    def tail(self, x: int) -> Form:
        """Return a series as a number times another, their first coefficients apart."""
        return self.tails.get(x) or self.form(x)

    def scaled(self, to: int, scale: Callable[[int], int], x: int) -> None:
        """Make a series another's multiple, by what ``scale`` makes of its number."""
        number, base = self.form(x)
        self.whole[to] = scale(number), base
        if x in self.tails:
            number, base = self.tails[x]
            self.tails[to] = scale(number), base

    def add(self, terms: Iterable[Form], to: int | None = None) -> Form:
        """Make the sum of multiples of series, their first coefficients apart; ``to``: its name."""
        numbers: dict[int, int] = {}
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
        """Return a number, but for the sign that of all terms, or else the first one's sign alone;
        and the terms without it.
        """
        number, negative = terms[0][0], self.builder.negative
        if {s for s, _ in terms} <= {number, negative(number)}:
            return number, [(self.one if s == number else self.minus_one, x) for s, x in terms]
        if number in self.builder.opposite:
            return self.minus_one, [(negative(s), x) for s, x in terms]
        return self.one, [*terms]

    def bracket(self, terms: Sequence[Form], rewrite: Callable[[list[Form]], list[Form]]) -> Form:
        """Make a sum that is multiplied as a whole, of what ``rewrite`` makes of its terms."""
        number, left = self.normal(terms)
        key = tuple(left)
        if key not in self.brackets:
            begin = self.zero
            for s, x in left:
                begin = self.builder.plus(begin, self.builder.times(s, self.begin(x)))
            self.brackets[key] = name = self.new(begin)
            self.add(rewrite(left), name)
        return number, self.brackets[key]

    def multiply(self, x: int, y: int, tail: bool = False) -> int:
        """Return the name of a product; ``tail``: less x's first coefficient times y."""
        op, y = (SeriesOp.MUL_TAIL, y + BEFORE) if tail else (SeriesOp.MUL, y)
        if (x, y) not in self.products:
            begin = self.zero if tail else self.builder.times(self.begin(x), self.begin(y))
            self.products[x, y] = name = self.new(begin)
            self.nodes[name] = op, (name,), (x, y)
        return self.products[x, y]
