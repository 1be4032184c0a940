"""Names of operands of operations on series."""

from __future__ import annotations

from lagcli.engine.tape.series_operations import SeriesOp
from lagcli.engine.taylor.series_nodes import (
    WORK,
    ZERO,
    Delayed,
    NextCoefficient,
    RegisterValue,
    UnnamedSeries,
    numbered,
)


def test_operands_of_different_kinds_have_places_of_their_own() -> None:
    operands = [
        *(3, RegisterValue(3), Delayed(3), NextCoefficient(3), UnnamedSeries(3), WORK, ZERO),
        *(Delayed(WORK), NextCoefficient(WORK), Delayed(UnnamedSeries(3))),
    ]
    assert len(dict.fromkeys(operands)) == len(operands)
    assert RegisterValue(3) in dict.fromkeys(operands)


def test_operations_get_numbers_of_their_operands() -> None:
    nodes = [
        (SeriesOp.SCALE, (5,), (RegisterValue(3), 3)),
        (SeriesOp.CHAIN, (6,), (RegisterValue(3), 5, Delayed(3))),
    ]
    number = {3: 0}
    lines, count = numbered(nodes, number)
    assert number == {3: 0, 5: 1, RegisterValue(3): 2, 6: 3, Delayed(3): 4}
    assert count == 5
    assert lines.tolist() == [
        [SeriesOp.SCALE, 1, 2, 0, -1, -1, -1, -1],
        [SeriesOp.CHAIN, 3, 2, 1, 4, -1, -1, -1],
    ]
