"""Operations on power series with names of operands."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from lagcli.arrays import Int32
from lagcli.engine.core.program import nodes_of
from lagcli.engine.tape.series_operations import SeriesOp


class UnnamedSeries(NamedTuple):
    """A series without a register, by its number."""

    number: int


#: The work, and the series that are zero beyond the first coefficient.
WORK, ZERO = UnnamedSeries(0), UnnamedSeries(1)

#: A series: the register of its first coefficient, or a series without one.
Name = int | UnnamedSeries


# Operands other than series. A number distinguishes them, because tuples are equal by their fields.


class Delayed(NamedTuple):
    """A series whose orders up to k − 1 are needed, so that order k need not be ready."""

    series: Name
    kind: int = 0


class NextCoefficient(NamedTuple):
    """The next coefficient of a series of the state."""

    series: Name
    kind: int = 1


class RegisterValue(NamedTuple):
    """A register's value as a factor of series, in contrast to the series that begins with it.

    If an operation has numbers among its operands, `SeriesOp.numbers` states which.
    """

    register: int
    kind: int = 2


Operand = Name | Delayed | NextCoefficient | RegisterValue
#: Operation, results, operands.
SeriesNode = tuple[SeriesOp, tuple[Any, ...], tuple[Any, ...]]


def numbered(
    nodes: Iterable[SeriesNode], number: dict[Any, int] | None = None
) -> tuple[Int32, int]:
    """Return operations with numbers of results and operands, and how many numbers there are.

    Parameters
    ----------
    nodes : iterable of SeriesNode
    number : dict of operand to int, optional
        Known numbers, which are completed.
    """
    of: dict[Any, int] = {} if number is None else number
    lines = [
        (op, *[of.setdefault(x, len(of)) for x in (*results, *operands)])
        for op, results, operands in nodes
    ]
    return nodes_of(lines), len(of)
