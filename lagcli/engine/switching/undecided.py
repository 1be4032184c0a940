"""Redundant contacts whose multipliers decide when one of them lets go."""

from __future__ import annotations

from collections.abc import Sequence

from lagcli.arrays import Array
from lagcli.engine.contract import EventEntry
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear import dense
from lagcli.engine.switching.switching import RowMode, Switching

#: What ends because a multiplier reaches its bound.
_BY_FORCE = ("slips", "opens")


def undecided(
    evaluator: Evaluator,
    switching: Switching,
    modes: Sequence[int],
    log: Sequence[EventEntry],
) -> EventEntry | None:
    """Return the first row that lets go while it is redundant among the rows that hold.

    Its multiplier is not unique then. That of least norm may reach its bound while others would
    still hold the motion, so that the time at which the row lets go is not known from it.

    Parameters
    ----------
    evaluator : Evaluator
        Of the whole System.
    switching : Switching
    modes : sequence of int
        `RowMode` of the rows at the start.
    log : sequence of EventEntry
        In order of time.
    """
    rows = [row.row for row in switching.rows]
    impacts = {entry.time for entry in log if entry.occurrence == "impact"}
    before, last = tuple(modes), None
    for entry in log:
        if last is not None and entry.time > last.time:
            before = tuple(last.modes)
        last = entry
        if entry.occurrence not in _BY_FORCE or entry.time in impacts:
            continue
        held = [row for row, mode in zip(rows, before, strict=True) if mode == RowMode.HOLDS]
        if len(held) > 1 and entry.which in held and _redundant(evaluator, rows, held, entry):
            return entry
    return None


def _redundant(
    evaluator: Evaluator, rows: Sequence[int], held: Sequence[int], entry: EventEntry
) -> bool:
    q, v = entry.q, entry.before
    jacobian: Array = evaluator.constraints(entry.time, q, v).jacobian
    sizes = evaluator.sizes(entry.time, q, v)
    holding = [k for k in range(len(jacobian)) if k not in rows or k in held]
    others = [k for k in holding if k != entry.which]
    return dense.count_rank(jacobian[holding], sizes=sizes) == dense.count_rank(
        jacobian[others], sizes=sizes
    )
