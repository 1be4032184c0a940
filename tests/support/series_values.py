"""Expansions run in Python, each operation on series by its definition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.series_operations import SeriesOp
from lagcli.engine.taylor.expansion import SeriesExpansion
from lagcli.engine.taylor.series_nodes import ZERO, Delayed

Series = Mapping[int, Sequence[float]]


def coefficients(
    expansion: SeriesExpansion,
    registers: Sequence[int],
    given: Series,
    inputs: Sequence[float],
) -> list[np.ndarray]:
    """Return the coefficients of results, from those of the series that are given.

    Parameters
    ----------
    expansion : SeriesExpansion
        Made up to the results.
    registers : sequence of int
        Results; nameless series, too.
    given : mapping of int to sequence of float
        The series to begin with.
    inputs : sequence of float
        Of the tape, at order 0.
    """
    results = [expansion.result(register) for register in registers]
    nodes = expansion.wanted(results)
    numbers = {operands[i] for op, _, operands in nodes for i in op.numbers}
    names = [to for _, (to,), _ in nodes]
    asked = [*numbers, *map(expansion.begin, [*names, *registers])]
    values = dict(zip(asked, ScalarTape(expansion.builder.finish(asked))(inputs), strict=True))
    orders = len(next(iter(given.values())))
    found: dict[int, list[float]] = {x: [*series] for x, series in given.items()}
    found[ZERO] = [0.0] * orders
    found |= {x: [values[expansion.begin(x)]] for x in names}
    for k in range(1, orders):
        for op, (to,), operands in nodes:
            parts = [
                values[x] if i in op.numbers else found[x.series if isinstance(x, Delayed) else x]
                for i, x in enumerate(operands)
            ]
            found[to].append(_coefficient(SeriesOp(op), k, parts))
    # what is added to a series changes its first coefficient alone
    return [
        np.array([values[expansion.begin(register)], *found[result][1:]])
        for register, result in zip(registers, results, strict=True)
    ]


def _coefficient(op: SeriesOp, k: int, o: Sequence) -> float:
    """Return coefficient k of a result."""
    if op is SeriesOp.SUM:
        return o[0] * o[1][k] + o[2] * o[3][k]
    if op is SeriesOp.SCALE:
        return o[0] * o[1][k]
    if op is SeriesOp.RATE:
        return k * o[0][k]
    if op is SeriesOp.MUL:
        return sum(o[0][i] * o[1][k - i] for i in range(k + 1))
    if op is SeriesOp.MUL_TAIL:  # (a − a_0) b
        return sum(o[0][i] * o[1][k - i] for i in range(1, k + 1))
    if op is SeriesOp.INVERSE:  # a c = 1
        return -sum(o[0][i] * o[1][k - i] for i in range(1, k + 1)) / o[0][0]
    assert op is SeriesOp.CHAIN, op  # t c′ = s g (t a′)
    return o[0] * sum(o[1][i] * o[2][k - i] for i in range(1, k + 1)) / k
