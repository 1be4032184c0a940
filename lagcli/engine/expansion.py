"""Operations on numbers → operations on power series.

Where y(t) is a power series, so is every result of an operation on it, and its coefficient of order
k follows from those of its operands up to k. Sums are linear; a product is a convolution; any
function f with f′ = s g is c′ = s g a′, a convolution with the derivative. So a handful of
operations serve for all. The coefficients of order 0 are the values that the tape itself gives.

Numbers that stay the same along a run are not multiplied by: a series is a number times another
one, its base, as long as possible, and sums take the numbers in. What is added to a series changes
its first coefficient alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import IntEnum
from itertools import islice
from operator import itemgetter

from lagcli.engine.program import Node
from lagcli.engine.tape import Builder, Op


class SeriesOp(IntEnum):
    """Operations on coefficients of order k > 0: a, b, … are series, s and t numbers."""

    SUM = 0  # s a + t b
    SCALE = 1  # s a
    RATE = 2  # k a_k: the coefficients of t a′
    MUL = 3
    MULSUM = 4  # s a b + t c
    INVERSE = 5  # 1 / a, from itself up to k − 1
    CHAIN = 6  # c′ = s g a′, of the rate of a and of g up to k − 1
    PAST = 7  # (a − a_0) b, of b up to k − 1
    NEXT = 8  # a_k / (k + 1): coefficient k + 1 of what a is the rate of
    ENTER = 9  # a, from the layer to its row
    COPY = 10  # a, side by side
    SUM3 = 11  # s a + t b + u c
    SUM4 = 12
    PASTSUM = 13  # s times a PAST, + t c
    END = 14


#: Which operands are numbers, and which are series that are convolved.
NUMBERS: dict[int, tuple[int, ...]] = {
    SeriesOp.SUM: (0, 2),
    SeriesOp.SCALE: (0,),
    SeriesOp.MULSUM: (0, 3),
    SeriesOp.CHAIN: (0,),
    SeriesOp.PASTSUM: (0, 3),
    SeriesOp.SUM3: (0, 2, 4),
    SeriesOp.SUM4: (0, 2, 4, 6),
}
CONVOLVED: dict[int, tuple[int, ...]] = {
    SeriesOp.MUL: (0, 1),
    SeriesOp.MULSUM: (1, 2),
    SeriesOp.INVERSE: (0,),
    SeriesOp.CHAIN: (1,),
    SeriesOp.PAST: (0,),
    SeriesOp.PASTSUM: (1,),
}
#: Names of series that no register has: the work; what is zero beyond its first coefficient; and
#: from the next on, rates and parts.
WORK, NOUGHT, _NAMELESS = 1 << 40, (1 << 40) + 1, (1 << 40) + 2
#: Added to the name of a series of which orders up to k − 1 are needed: no need to wait for it.
BEFORE = 1 << 50
#: Added to the name of a series of the state, it is its next coefficient.
AHEAD = 1 << 52
#: Added to a register, it is a number that operations use, and not the series that begins with it.
NUMBER = -(1 << 50)

Form = tuple[int, int]  # the registers of a number and of a series' first coefficient


class NotAnalytic(ArithmeticError):
    """An operation has no power series at its kinks or jumps."""


class Expansion:
    """Turns operations on numbers into operations on series.

    A series is named by the register of its first coefficient; rates and parts have none.

    Parameters
    ----------
    builder : Builder
    moving : iterable of int
        Registers that are series to begin with; what does not depend on them is a number.
    """

    def __init__(self, builder: Builder, moving: Iterable[int]):
        self.builder, self.moving = builder, set(moving)
        self.taken = set(self.moving)  # no operation makes them, or it is there
        self.zero, self.one = builder.constant(0.0), builder.constant(1.0)
        self.minus_one = builder.constant(-1.0)
        self.nodes: dict[int, Node] = {}
        self.slopes: dict[int, int] = {}  # CHAIN → g
        self.whole: dict[int, Form] = {}
        self.beyond: dict[int, Form] = {}  # what counts beyond the first coefficient
        self.rates: dict[int, int] = {}
        self.begins: dict[int, int] = {}  # what a nameless series begins with
        self.keys: list[tuple[int, ...]] = []  # of the builder's operations
        self.sums: dict[tuple[int, ...], int] = {}
        self.brackets: dict[tuple[Form, ...], int] = {}
        self.products: dict[tuple[int, int], int] = {}  # that no register has

    # numbers

    def steady(self, x: int) -> bool:
        """Return whether a register is a number, not a series."""
        return x not in self.moving

    def times(self, a: int, b: int) -> int:
        """Return the register of a product of numbers."""
        if a == self.one:
            return b
        return a if b == self.one else self.builder.emit(Op.MUL, a, b)

    def over(self, a: int, b: int) -> int:
        """Return the register of a quotient of numbers."""
        return a if b == self.one else self.builder.emit(Op.DIV, a, b)

    def negative(self, a: int) -> int:
        """Return the register of a number's negative."""
        if a in (self.one, self.minus_one):
            return self.minus_one if a == self.one else self.one
        key = self.key(a)
        return key[1] if key[0] == Op.NEG else self.builder.emit(Op.NEG, a)

    def key(self, x: int) -> tuple[int, ...]:
        """Return the operation that makes a register, and its operands; (−1,) for none."""
        n = x - self.builder.inputs
        operations = self.builder.operations
        if n >= len(self.keys):  # they grow: slopes, say, need operations of their own
            new = islice(reversed(operations), len(operations) - len(self.keys))
            self.keys += [*new][::-1]
        return self.keys[n] if n >= 0 else (-1,)

    # series as numbers times others

    def form(self, x: int) -> Form:
        """Return a series as a number times another."""
        return self.whole.get(x, (self.one, x))

    def tail(self, x: int) -> Form:
        """Return a series as a number times another, their first coefficients apart."""
        return self.beyond.get(x) or self.form(x)

    def scaled(self, to: int, scale: Callable[[int], int], x: int) -> None:
        """Make a series another's multiple, by what ``scale`` makes of its number."""
        number, base = self.form(x)
        self.whole[to] = scale(number), base
        if x in self.beyond:
            number, base = self.beyond[x]
            self.beyond[to] = scale(number), base

    # one operation

    def operation(self, op: Op, to: int, a: int, b: int = 0) -> None:
        """Make the series of an operation's result."""
        if op in (Op.ADD, Op.SUB):
            self.sum(op, to, a, b)
        elif op == Op.NEG:
            self.scaled(to, self.negative, a)
        elif op == Op.MUL:
            self.product(to, a, b)
        elif op == Op.DIV:
            self.quotient(to, a, b)
        elif op == Op.POW:
            self.power_of(to, a, b)
        elif op == Op.ATAN2:
            square = self.builder.emit(Op.ADD, self.mul(a, a), self.mul(b, b))
            opposite = self.builder.emit(Op.NEG, self.div(a, square))
            self.two_parts(to, (a, self.div(b, square)), (b, opposite))
        elif op in _SLOPES:
            scale, slope = _SLOPES[op](self, a, to)
            self.chain(to, self.builder.constant(scale), a, slope)
        else:
            raise NotAnalytic(op.name.lower())

    def sum(self, op: Op, to: int, a: int, b: int) -> None:
        """a ± b."""
        sign = self.negative if op == Op.SUB else _same
        if self.steady(a):
            number, base = self.tail(b)
            self.beyond[to] = sign(number), base
        elif self.steady(b):
            self.beyond[to] = self.tail(a)
        else:
            (s, x), (t, y) = self.tail(a), self.tail(b)
            t = sign(t)
            opposite = self.sums.get((self.negative(s), x, self.negative(t), y))
            if opposite is not None:
                self.beyond[to] = self.minus_one, opposite
                return
            self.sums[s, x, t, y] = to
            self.nodes[to] = SeriesOp.SUM, (to,), (s, x, t, y)

    def product(self, to: int, a: int, b: int) -> None:
        """a b: numbers are multiplied, bases convolved."""
        if self.steady(a) or self.steady(b):
            number, x = (a, b) if self.steady(a) else (b, a)
            self.scaled(to, lambda s: self.times(number, s), x)
            return
        (s, x), (t, y) = self.form(a), self.form(b)
        base = self.mul(x, y)
        self.nodes[base] = SeriesOp.MUL, (base,), (x, y)
        if base != to:
            self.whole[to] = self.times(s, t), base

    def quotient(self, to: int, a: int, b: int) -> None:
        """a / b: the inverse of b's base is shared."""
        if self.steady(b):
            number = self.inverse(b)
            self.scaled(to, lambda s: self.times(number, s), a)
            return
        t, y = self.form(b)
        inverse = self.inverse(y)
        self.nodes[inverse] = SeriesOp.INVERSE, (inverse,), (y,)
        if self.steady(a):
            if inverse != to:
                self.whole[to] = self.over(a, t), inverse
            return
        s, x = self.form(a)
        base = self.mul(x, inverse)
        self.nodes[base] = SeriesOp.MUL, (base,), (x, inverse)
        self.whole[to] = self.over(s, t), base

    def power_of(self, to: int, a: int, b: int) -> None:
        """a^b."""
        if self.steady(b):
            self.chain(to, b, a, self.div(to, a))
        elif self.steady(a):
            self.chain(to, self.builder.emit(Op.LOG, a), b, to)
        else:
            logarithm = self.builder.emit(Op.LOG, a)
            self.two_parts(to, (a, self.div(self.mul(to, b), a)), (b, self.mul(to, logarithm)))

    def chain(self, to: int, scale: int, a: int, slope: int) -> None:
        """c′ = s g a′, where ``slope`` is g."""
        number, base = self.tail(a)
        if base not in self.rates:
            self.rates[base] = self.new(self.zero)
            self.nodes[self.rates[base]] = SeriesOp.RATE, (self.rates[base],), (base,)
        self.nodes[to] = SeriesOp.CHAIN, (to,), (self.times(scale, number), self.rates[base])
        self.slopes[to] = slope

    def two_parts(self, to: int, *parts: tuple[int, int]) -> None:
        """c′ = g a′ + h b′."""
        names = []
        for x, slope in parts:
            if not self.steady(x):
                names.append(self.new(self.zero))
                self.chain(names[-1], self.one, x, slope)
        if len(names) == 1:
            self.beyond[to] = self.one, names[0]
        else:
            self.nodes[to] = SeriesOp.SUM, (to,), (self.one, names[0], self.one, names[1])

    def new(self, begin: int) -> int:
        """Return a name for a series without a register."""
        name = _NAMELESS + len(self.begins)
        self.begins[name] = begin
        return name

    # values of slopes

    def mul(self, a: int, b: int) -> int:
        """Return the register of a product of values."""
        return self.builder.emit(Op.MUL, a, b)

    def div(self, a: int, b: int) -> int:
        """Return the register of a quotient of values."""
        return self.builder.emit(Op.DIV, a, b)

    def inverse(self, a: int) -> int:
        """Return the register of an inverse."""
        return self.div(self.one, a)

    def squared(self, first: float, sign: int, a: int) -> int:
        """Emit first ± a²."""
        op = Op.ADD if sign > 0 else Op.SUB
        return self.builder.emit(op, self.builder.constant(first), self.mul(a, a))

    # sums and products of series

    def add(self, terms: Iterable[Form], to: int | None = None) -> Form:
        """Make the sum of multiples of series, their first coefficients apart; ``to``: its name."""
        numbers: dict[int, int] = {}
        for s, x in terms:
            if x != NOUGHT and s != self.zero:
                numbers[x] = self.builder.emit(Op.ADD, numbers[x], s) if x in numbers else s
        left = [(s, x) for x, s in numbers.items()] or [(self.one, NOUGHT)]
        whole, left = self.normal(left) if to is None else (self.one, left)
        total, *others = left
        for n, (s, x) in enumerate(others, 1):
            name = to if to is not None and n == len(others) else self.new(self.zero)
            self.nodes[name] = SeriesOp.SUM, (name,), (*total, s, x)
            total = self.one, name
        if to is not None and not others:
            self.nodes[to] = SeriesOp.SCALE, (to,), total
            total = self.one, to
        return self.times(whole, total[0]), total[1]

    def normal(self, terms: list[Form]) -> tuple[int, list[Form]]:
        """Return a number that all terms have, but for the sign, and the terms without it."""
        number, _ = terms[0]
        if not {s for s, _ in terms} <= {number, self.negative(number)}:
            return self.one, terms
        return number, [(self.one if s == number else self.minus_one, x) for s, x in terms]

    def bracket(self, terms: Sequence[Form], rewrite: Callable[[list[Form]], list[Form]]) -> Form:
        """Make a sum that is multiplied as a whole, of what ``rewrite`` makes of its terms."""
        number, left = self.normal(sorted(terms, key=itemgetter(1)))
        key = tuple(left)
        if key not in self.brackets:
            begin = self.zero
            for s, x in left:
                begin = self.builder.emit(Op.ADD, begin, self.times(s, self.begins.get(x, x)))
            self.brackets[key] = name = self.new(begin)
            self.add(rewrite(left), name)
        return number, self.brackets[key]

    def multiply(self, x: int, y: int, rest: bool = False) -> int:
        """Return the name of a product; ``rest``: of what is known before y's coefficient is."""
        op, y = (SeriesOp.PAST, y + BEFORE) if rest else (SeriesOp.MUL, y)
        if (x, y) not in self.products:
            begin = self.zero
            if not rest:
                begin = self.mul(self.begins.get(x, x), self.begins.get(y, y))
            self.products[x, y] = name = self.new(begin)
            self.nodes[name] = op, (name,), (x, y)
        return self.products[x, y]

    # what is wanted

    def expand(self, results: Iterable[int], names: Mapping[int, int] | None = None) -> None:
        """Take the operations that results need; ``names`` are other names of what they make."""
        while needed := self.needed([*results, *self.slopes.values()]):
            for x, (op, *operands) in needed:
                self.taken.add(x)
                if not all(map(self.steady, operands)):
                    self.moving.add(x)
                    self.operation(Op(op), x, *operands)
                if names and x in names:
                    self.rename(x, names[x])

    def needed(self, results: Iterable[int]) -> list[tuple[int, tuple[int, ...]]]:
        """Return what is to be taken for results, operands first: registers and operations."""
        first, operations = self.builder.inputs, list(self.builder.operations)
        found: set[int] = set()
        waiting = list(results)
        while waiting:
            x = waiting.pop()
            if x >= first and x not in found and x not in self.taken:
                found.add(x)
                waiting += operations[x - first][1:]
        return [(x, operations[x - first]) for x in sorted(found)]

    def rename(self, x: int, name: int) -> None:
        """Give a series another name, that of a register with its first coefficient."""
        form = (self.one, NOUGHT) if self.steady(x) else self.tail(x)
        self.beyond.pop(x, None)
        self.whole[x] = self.one, name
        if form == (self.one, x) and x in self.nodes:
            op, _, operands = self.nodes.pop(x)
            self.nodes[name] = op, (name,), operands
        else:
            self.nodes[name] = SeriesOp.SCALE, (name,), form

    def result(self, x: int) -> int:
        """Return the series that is an output, made from its base where it must be."""
        if self.steady(x):
            return NOUGHT
        number, base = self.tail(x)
        if number == self.one:
            return base
        self.nodes[x] = SeriesOp.SCALE, (x,), (number, base)
        return x

    def node(self, x: int) -> Node | None:
        """Return the operation that makes a series; None for those of the state."""
        if x not in self.nodes and x in self.beyond:  # convolved: its first coefficient counts
            return SeriesOp.SCALE, (x,), self.beyond[x]
        node = self.nodes.get(x)
        if node and node[0] == SeriesOp.CHAIN and len(node[2]) == 2:
            number, slope = self.form(self.slopes[x])
            scale, rate = node[2]
            node = SeriesOp.CHAIN, (x,), (self.times(scale, number), rate, slope + BEFORE)
        return node

    def wanted(self, results: Sequence[int]) -> list[Node]:
        """Return the operations that results need, operands first; slopes count as earlier."""
        found: dict[int, Node] = {}
        waiting = [(x, False) for x in reversed(results)]
        later: list[int] = []
        while waiting or later:
            x, ready = waiting.pop() if waiting else (later.pop(), False)
            node = None if x in found else self.node(x)
            if node is None:
                continue
            op, _, operands = node
            numbers = NUMBERS.get(op, ())
            if ready:
                tagged = [y + NUMBER if i in numbers else y for i, y in enumerate(operands)]
                if op == SeriesOp.INVERSE:
                    tagged.append(x + BEFORE)
                found[x] = op, (x,), tuple(tagged)
                continue
            waiting.append((x, True))
            for i, y in enumerate(operands):
                if y >= BEFORE:
                    later.append(y - BEFORE)
                elif i not in numbers:
                    waiting.append((y, False))
        return list(found.values())


def _same(x: int) -> int:
    return x


def _error_slope(e: Expansion, a: int) -> int:
    return e.builder.emit(Op.EXP, e.builder.emit(Op.NEG, e.mul(a, a)))


def _over_root(e: Expansion, x: int) -> int:
    return e.inverse(e.builder.emit(Op.SQRT, x))


#: c = f(a) → s and g with c′ = s g a′, from a and c.
_SLOPES: dict[Op, Callable[[Expansion, int, int], tuple[float, int]]] = {
    Op.SQRT: lambda e, a, c: (0.5, e.inverse(c)),
    Op.SIN: lambda e, a, c: (1.0, e.builder.emit(Op.COS, a)),
    Op.COS: lambda e, a, c: (-1.0, e.builder.emit(Op.SIN, a)),
    Op.TAN: lambda e, a, c: (1.0, e.squared(1.0, 1, c)),
    Op.ASIN: lambda e, a, c: (1.0, _over_root(e, e.squared(1.0, -1, a))),
    Op.ACOS: lambda e, a, c: (-1.0, _over_root(e, e.squared(1.0, -1, a))),
    Op.ATAN: lambda e, a, c: (1.0, e.inverse(e.squared(1.0, 1, a))),
    Op.SINH: lambda e, a, c: (1.0, e.builder.emit(Op.COSH, a)),
    Op.COSH: lambda e, a, c: (1.0, e.builder.emit(Op.SINH, a)),
    Op.TANH: lambda e, a, c: (1.0, e.squared(1.0, -1, c)),
    Op.ASINH: lambda e, a, c: (1.0, _over_root(e, e.squared(1.0, 1, a))),
    Op.ACOSH: lambda e, a, c: (1.0, _over_root(e, e.squared(-1.0, 1, a))),
    Op.ATANH: lambda e, a, c: (1.0, e.inverse(e.squared(1.0, -1, a))),
    Op.EXP: lambda e, a, c: (1.0, c),
    Op.LOG: lambda e, a, c: (1.0, e.inverse(a)),
    Op.ERF: lambda e, a, c: (2.0 / math.sqrt(math.pi), _error_slope(e, a)),
    Op.ERFC: lambda e, a, c: (-2.0 / math.sqrt(math.pi), _error_slope(e, a)),
}
