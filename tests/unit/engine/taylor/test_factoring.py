"""Sums of products of series: how many of these are left."""

from __future__ import annotations

from collections import Counter

from lagcli.engine.tape.arithmetic import Arithmetic
from lagcli.engine.tape.operations import Op
from lagcli.engine.taylor.expansion import SeriesExpansion
from lagcli.engine.taylor.factoring import factored
from lagcli.engine.taylor.series_nodes import SeriesOp

#: Registers: series, and a number.
F, G, A, B, C, S = range(6)


class Sums:
    """Emits sums of products, in this order."""

    def __init__(self) -> None:
        self.builder = Arithmetic(6, 1)

    def of(self, *products: tuple[int, ...]) -> int:
        """Return the register of a sum."""
        made = []
        for first, *others in products:
            made.append(first)
            for x in others:
                made[-1] = self.builder.emit(Op.MUL, made[-1], x)
        total = made[0]
        for x in made[1:]:
            total = self.builder.emit(Op.ADD, total, x)
        return total

    def operations(self, *results: int) -> Counter[SeriesOp]:
        """Return how many operations of each kind are left."""
        expansion = SeriesExpansion(self.builder, range(5))
        expansion.expand(results)
        return Counter(SeriesOp(op) for op, _, _ in factored(expansion, results))


def test_common_factors_are_taken_out() -> None:
    sums = Sums()
    found = sums.operations(sums.of((F, A), (S, F, B), (G, C)))
    assert found == {SeriesOp.SUM: 2, SeriesOp.MUL: 2}


def test_the_most_common_factor_is_taken_out_first() -> None:
    sums = Sums()
    # f (a + b + c) + g (a + b), not a (f + g) + b (f + g) + f c
    found = sums.operations(sums.of((F, A), (F, B), (F, C), (G, A), (G, B)))
    assert found == {SeriesOp.SUM: 4, SeriesOp.MUL: 2}


def test_common_factors_are_taken_out_inside_brackets() -> None:
    sums = Sums()
    # f (g a) + f (g b) = f (g (a + b))
    found = sums.operations(sums.of((F, sums.of((G, A))), (F, sums.of((G, B)))))
    assert (found[SeriesOp.SUM], found[SeriesOp.MUL]) == (1, 2)


def test_brackets_are_the_same_in_whatever_order() -> None:
    sums = Sums()
    found = sums.operations(sums.of((F, A), (F, B)), sums.of((G, B), (G, A)))
    assert found == {SeriesOp.SUM: 1, SeriesOp.MUL: 2, SeriesOp.SCALE: 2}


def test_products_that_are_used_elsewhere_stay() -> None:
    sums = Sums()
    product = sums.of((F, A))
    found = sums.operations(sums.of((F, A), (F, B)), sums.of((product, C)))
    assert found == {SeriesOp.SUM: 1, SeriesOp.MUL: 3}
