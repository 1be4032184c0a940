"""Names of series: what operations read, and names that no register has."""

from __future__ import annotations

import itertools

from lagcli.engine.taylor.series_nodes import (
    AHEAD,
    BEFORE,
    CONVOLVED,
    MAX_ORDER,
    NAMELESS,
    NUMBER,
    NUMBERS,
    WORK,
    ZERO,
    SeriesOp,
)


def test_operands_are_numbers_or_series() -> None:
    assert NUMBERS[SeriesOp.SUM] == (0, 2)  # s a + t b
    assert SeriesOp.SUM not in CONVOLVED
    assert NUMBERS[SeriesOp.MULSUM] == (0, 3)  # s a b + t c
    assert CONVOLVED[SeriesOp.MULSUM] == (1, 2)
    assert SeriesOp.MUL not in NUMBERS
    assert CONVOLVED[SeriesOp.MUL] == (0, 1)
    for op in SeriesOp:
        both = NUMBERS.get(op, ()), CONVOLVED.get(op, ())
        assert not set(both[0]) & set(both[1])
        assert set("nsce") >= set(op.operands)


def test_names_are_none_of_a_register_nor_of_each_other() -> None:
    registers = 1 << 31  # places in streams are int32
    most = 1 << 30  # more series than a program can have
    plain = [range(registers), range(WORK, ZERO + 1), range(NAMELESS, NAMELESS + most)]
    shifted = [
        range(r.start + shift, r.stop + shift) for r in plain for shift in (0, BEFORE, AHEAD)
    ]
    numbers = range(NUMBER, NUMBER + registers)
    ends = sorted((r.start, r.stop) for r in (*shifted, numbers))
    assert all(one[1] <= other[0] for one, other in itertools.pairwise(ends))


def test_a_program_is_short_enough_for_its_highest_order() -> None:
    # a tolerance of 1e-13 asks for order 21; see `order_for`
    assert MAX_ORDER >= 21
