"""Partial programs: the operations needed for some results, and scalar forms of vectors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Int32
from lagcli.engine.program.nodes import INDEXED, VECTOR
from lagcli.engine.tape.operations import PLACES, Op

Registers = slice | list[int]


class _Step(NamedTuple):
    """An operation, or one on vectors, as it stands in a stream, and the registers it is on."""

    op: int
    size: int
    numbers: list[int]
    results: Registers
    operands: list[Registers]


def excerpt(stream: Int32, registers: int, results: Iterable[int]) -> Int32:
    """Return the operations of a stream on which some final registers depend.

    Parameters
    ----------
    stream : int32 array
    registers : int
        Size of the register file.
    results : iterable of int
        The registers.
    """
    live = np.zeros(registers, dtype=bool)
    live[list(results)] = True
    kept = []
    for step in reversed(list(_steps(stream.tolist()))):
        if live[step.results].any():
            live[step.results] = False
            for operand in step.operands:
                live[operand] = True
            kept.append(step)
    return _joined((step.op, step.size, step.numbers) for step in reversed(kept))


def unpacked(stream: Int32) -> Int32:
    """Return a stream with the same operations as scalar ones."""
    return _joined(_one_by_one(step) for step in _steps(stream.tolist()))


def _one_by_one(step: _Step) -> tuple[int, int, list[int]]:
    """Return an operation, how often it is done, and the numbers of all."""
    if step.op < VECTOR:
        return step.op, step.size, step.numbers
    first = step.numbers[0]
    columns = [range(first, first + step.size), *step.operands]
    return step.op - VECTOR, step.size, [x for one in zip(*columns, strict=True) for x in one]


def _joined(parts: Iterable[tuple[int, int, list[int]]]) -> Int32:
    """Return a stream of operations, with adjacent operations of a kind as one run."""
    numbers: list[int] = []
    at = kind = -1
    for op, size, own in parts:
        if op != kind or op >= VECTOR:
            at, kind = len(numbers) + 1, op
            numbers += (op, 0)
        numbers[at] += size
        numbers += own
    return np.array([*numbers, Op.END, 0], dtype=np.int32)


def _steps(numbers: list[int]) -> Iterator[_Step]:
    """Yield the operations of a stream, vector operations as one."""
    at = 0
    while numbers[at] != Op.END:
        op, n = numbers[at : at + 2]
        at += 2
        if op < VECTOR:
            width, first = PLACES[op], 2 if op == Op.SINCOS else 1
            for _ in range(n):
                own = numbers[at : at + width]
                at += width
                yield _Step(op, 1, own, own[:first], [own[first:]])
            continue
        begin, at = at, at + 1
        operands: list[Registers] = []
        for _ in range(PLACES[op - VECTOR] - 1):
            first, step = numbers[at : at + 2]
            at += 2
            if step == INDEXED:
                operands.append(numbers[at : at + n])
                at += n
            else:
                operands.append([first + i * step for i in range(n)])
        to = numbers[begin]
        yield _Step(op, n, numbers[begin:at], slice(to, to + n), operands)
