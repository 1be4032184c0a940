"""The operations of programs for power series: the kinds of their operands."""

from __future__ import annotations

from lagcli.engine.tape.operations import NODE_VALUES, PLACES
from lagcli.engine.tape.series_operations import SeriesOp


def test_operands_are_numbers_or_series() -> None:
    assert SeriesOp.SUM.numbers == (0, 2)  # s a + t b
    assert SeriesOp.SUM.convolved == ()
    assert SeriesOp.MULSUM.numbers == (0, 3)  # s a b + t c
    assert SeriesOp.MULSUM.convolved == (1, 2)
    assert SeriesOp.MUL.numbers == ()
    assert SeriesOp.MUL.convolved == (0, 1)
    for op in SeriesOp:
        assert not set(op.numbers) & set(op.convolved)
        assert set("nsce") >= set(op.operands)


def test_operations_fit_the_nodes_of_the_core() -> None:
    assert max(PLACES) <= NODE_VALUES
    assert max(1 + len(op.operands) for op in SeriesOp) <= NODE_VALUES
