"""Operations on series, and the names and kinds of their operands."""

from __future__ import annotations

from lagcli.engine.taylor.series_nodes import (
    WORK,
    ZERO,
    Delayed,
    NextCoefficient,
    RegisterValue,
    SeriesOp,
    UnnamedSeries,
)


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


def test_operands_of_different_kinds_have_places_of_their_own() -> None:
    operands = [
        *(3, RegisterValue(3), Delayed(3), NextCoefficient(3), UnnamedSeries(3), WORK, ZERO),
        *(Delayed(WORK), NextCoefficient(WORK), Delayed(UnnamedSeries(3))),
    ]
    assert len(dict.fromkeys(operands)) == len(operands)
    assert RegisterValue(3) in dict.fromkeys(operands)
