"""Conversion of operations on numbers to operations on power series.

If y(t) is a power series, so is the result of every operation on it, and its coefficient of order k
follows from those of its operands up to k. Sums are linear; a product is a convolution; any
function f with f′ = s g satisfies c′ = s g a′, a convolution with the derivative. A small number of
operations is therefore sufficient. The tape itself computes the coefficients of order 0.

Series are represented as multiples of others: see `lagcli.engine.taylor.forms`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial

from lagcli.engine.tape.differentiation import SlopeRules
from lagcli.engine.tape.operations import OPERATIONS, Op
from lagcli.engine.tape.series_operations import SeriesOp
from lagcli.engine.tape.tape import Arithmetic
from lagcli.engine.taylor.forms import Form, SeriesForms
from lagcli.engine.taylor.series_nodes import ZERO, Delayed, Name, SeriesNode


class NotAnalytic(ArithmeticError):
    """An operation has no power series at its kinks or jumps."""


class SeriesExpansion(SeriesForms):
    """Converts operations on numbers to operations on series.

    Parameters
    ----------
    builder : Arithmetic
    moving : iterable of int
        Registers that are series initially; everything independent of them is a number.
    """

    def __init__(self, builder: Arithmetic, moving: Iterable[int]):
        super().__init__(builder)
        self.moving: set[Name] = set(moving)
        self.taken = set(self.moving)  # already computed, or not computed by an operation
        self.slopes: dict[Name, int] = {}  # CHAIN → g
        self.rates: dict[Name, Name] = {}
        self.sums: dict[tuple[Form, Form], Name] = {}
        self.rules = _SeriesSlopes(self)

    def is_invariant(self, x: Name) -> bool:
        """Return whether a register is a number, not a series."""
        return x not in self.moving

    # one operation

    def operation(self, op: Op, to: int, a: int, b: int = 0, c: int = 0) -> None:
        """Create the series of an operation's result."""
        if op in (Op.ADD, Op.SUB):
            self.sum(op, to, a, b)
        elif op == Op.NEG:
            self.scaled(to, self.builder.negative, a)
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
        elif op == Op.CLIP:
            self.tails[to] = self.tail(a)
        elif op == Op.SELECT and self.is_invariant(a):
            self.selected(to, a, b, c)
        elif op.function is not None and op.function.slope is not None:
            scale, slope, divisor = self.rules.of(op, a, to)
            if divisor is not None:
                slope = self.inverse(divisor)
            assert slope is not None
            self.chain(to, self.builder.constant(scale), a, slope)
        else:
            raise NotAnalytic(op.name.lower())

    def sum(self, op: Op, to: int, a: int, b: int) -> None:
        """a ± b."""
        negative = self.builder.negative
        t, y = self.tail(b)
        t = negative(t) if op == Op.SUB else t
        if self.is_invariant(a):
            self.tails[to] = t, y
        elif self.is_invariant(b):
            self.tails[to] = self.tail(a)
        else:
            s, x = self.tail(a)
            opposite = self.sums.get(((negative(s), x), (negative(t), y)))
            if opposite is not None:
                self.tails[to] = self.minus_one, opposite
                return
            self.sums[(s, x), (t, y)] = to
            self.nodes[to] = SeriesOp.SUM, (to,), (s, x, t, y)

    def selected(self, to: int, a: int, b: int, c: int) -> None:
        """Select b if a is true, else c; a is constant along a step."""
        emit, parts = self.builder.emit, list[Form]()
        for x, choice in ((b, (self.one, self.zero)), (c, (self.zero, self.one))):
            if not self.is_invariant(x):
                number, base = self.tail(x)
                parts.append((self.builder.times(emit(Op.SELECT, a, *choice), number), base))
        if len(parts) == 1:
            self.tails[to] = parts[0]
        else:
            self.nodes[to] = SeriesOp.SUM, (to,), (*parts[0], *parts[1])

    def product(self, to: int, a: int, b: int) -> None:
        """a b: numbers are multiplied, bases convolved."""
        if self.is_invariant(a) or self.is_invariant(b):
            number, x = (a, b) if self.is_invariant(a) else (b, a)
            self.scaled(to, partial(self.builder.times, number), x)
            return
        (s, y), (t, z) = self.form(a), self.form(b)
        base = self.mul(y, z)
        self.nodes[base] = SeriesOp.MUL, (base,), (y, z)
        if base != to:
            self.whole[to] = self.builder.times(s, t), base

    def quotient(self, to: int, a: int, b: int) -> None:
        """a / b: the inverse of b's base is shared."""
        if self.is_invariant(b):
            self.scaled(to, partial(self.builder.times, self.builder.inverse(b)), a)
            return
        t, y = self.form(b)
        inverse = self.inverse(y)
        self.nodes[inverse] = SeriesOp.INVERSE, (inverse,), (y,)
        if self.is_invariant(a):
            if inverse != to:
                self.whole[to] = self.builder.times(a, self.builder.inverse(t)), inverse
            return
        s, x = self.form(a)
        base = self.mul(x, inverse)
        self.nodes[base] = SeriesOp.MUL, (base,), (x, inverse)
        self.whole[to] = self.builder.times(s, self.builder.inverse(t)), base

    def power_of(self, to: int, a: int, b: int) -> None:
        """a^b."""
        if self.is_invariant(b):
            self.chain(to, b, a, self.div(to, a))
        elif self.is_invariant(a):
            self.chain(to, self.builder.emit(Op.LOG, a), b, to)
        else:
            logarithm = self.builder.emit(Op.LOG, a)
            self.two_parts(to, (a, self.div(self.mul(to, b), a)), (b, self.mul(to, logarithm)))

    def chain(self, to: Name, scale: int, a: int, slope: int) -> None:
        """c′ = s g a′, where ``slope`` is g."""
        number, base = self.tail(a)
        if base not in self.rates:
            self.rates[base] = self.new(self.zero)
            self.nodes[self.rates[base]] = SeriesOp.RATE, (self.rates[base],), (base,)
        self.nodes[to] = (
            SeriesOp.CHAIN,
            (to,),
            (self.builder.times(scale, number), self.rates[base]),
        )
        self.slopes[to] = slope

    def two_parts(self, to: int, *parts: tuple[int, int]) -> None:
        """c′ = g a′ + h b′."""
        names = []
        for x, slope in parts:
            if not self.is_invariant(x):
                names.append(self.new(self.zero))
                self.chain(names[-1], self.one, x, slope)
        if len(names) == 1:
            self.tails[to] = self.one, names[0]
        else:
            self.nodes[to] = SeriesOp.SUM, (to,), (self.one, names[0], self.one, names[1])

    # values of derivatives

    def mul(self, a: Name, b: Name) -> int:
        """Return the register of a product of values."""
        return self.builder.emit(Op.MUL, self.begin(a), self.begin(b))

    def div(self, a: Name, b: Name) -> int:
        """Return the register of a quotient of values."""
        return self.builder.emit(Op.DIV, self.begin(a), self.begin(b))

    def inverse(self, a: Name) -> int:
        """Return the register of an inverse."""
        return self.div(self.one, a)

    # dependencies

    def expand(self, results: Iterable[int], names: Mapping[int, Name] | None = None) -> None:
        """Convert the operations that results need; ``names`` are other names of their results."""
        while needed := self.needed([*results, *self.slopes.values()]):
            for x, (op, *operands) in needed:
                self.taken.add(x)
                if not all(map(self.is_invariant, operands)):
                    self.moving.add(x)
                    self.operation(OPERATIONS[op], x, *operands)
                if names and x in names:
                    self.rename(x, names[x])

    def needed(self, results: Iterable[int]) -> list[tuple[int, tuple[int, ...]]]:
        """Return the registers and operations needed for results, operands first."""
        first, operations = self.builder.inputs, list(self.builder.operations)
        needed: set[int] = set()
        waiting = list(results)
        while waiting:
            x = waiting.pop()
            if x >= first and x not in needed and x not in self.taken:
                needed.add(x)
                waiting += operations[x - first][1:]
        return [(x, operations[x - first]) for x in sorted(needed)]

    def rename(self, x: int, name: Name) -> None:
        """Rename a series to a register that contains its first coefficient."""
        form = (self.one, ZERO) if self.is_invariant(x) else self.tail(x)
        self.tails.pop(x, None)
        self.whole[x] = self.one, name
        if form == (self.one, x) and x in self.nodes:
            op, _, operands = self.nodes.pop(x)
            self.nodes[name] = op, (name,), operands
        else:
            self.nodes[name] = SeriesOp.SCALE, (name,), form

    def result(self, x: Name) -> Name:
        """Return the series of an output, computed from its base if necessary."""
        if self.is_invariant(x):
            return ZERO
        number, base = self.tail(x)
        if number == self.one:
            return base
        self.nodes[x] = SeriesOp.SCALE, (x,), (number, base)
        return x

    def node(self, x: Name) -> SeriesNode | None:
        """Return the operation that computes a series; None for those of the state."""
        if x not in self.nodes and x in self.tails:  # convolved: its first coefficient matters
            return SeriesOp.SCALE, (x,), self.tails[x]
        node = self.nodes.get(x)
        if node and node[0] == SeriesOp.CHAIN and len(node[2]) == 2:
            number, slope = self.form(self.slopes[x])
            scale, rate = node[2]
            node = SeriesOp.CHAIN, (x,), (self.builder.times(scale, number), rate, Delayed(slope))
        return node

    def wanted(self, results: Sequence[Name]) -> list[SeriesNode]:
        """Return the operations that results need, operands first."""
        wanted: dict[Name, SeriesNode] = {}
        waiting = [(x, False) for x in reversed(results)]
        later: list[Name] = []
        while waiting or later:
            x, ready = waiting.pop() if waiting else (later.pop(), False)
            node = None if x in wanted else self.node(x)
            if node is None:
                continue
            op, _, operands = node
            if ready:
                delayed = (Delayed(x),) if op == SeriesOp.INVERSE else ()
                wanted[x] = op, (x,), (*operands, *delayed)
                continue
            waiting.append((x, True))
            for i, y in enumerate(operands):
                if isinstance(y, Delayed):
                    later.append(y.series)
                elif i not in op.numbers:
                    waiting.append((y, False))
        return list(wanted.values())


class _SeriesSlopes(SlopeRules):
    """Rules whose products and quotients begin series."""

    def __init__(self, expansion: SeriesExpansion):
        super().__init__(expansion.builder)
        self.product, self.quotient = expansion.mul, expansion.div  # type: ignore[method-assign]
