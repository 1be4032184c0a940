"""Random streams of the evaluator, valid ones."""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array, Int32
from lagcli.engine.core.program import Program
from lagcli.engine.tape.operations import INDEXED, PLACES, VECTOR, Kind, Op

#: Numbers at which operations have something special about them.
SPECIAL = (
    *(0.0, -0.0, 1.0, -1.0, 0.5, 3.0, np.inf, -np.inf, np.nan),
    *(5e-324, -5e-324, 2.2e-308, 1e-160, -1e-160, 1e308, -1e308, 2.0**-45, -(2.0**-45)),
)
NOTHING = np.array([Op.END, 0], dtype=np.int32)
_ANY = [op for op in Op if op is not Op.END]
_FREQUENT = (Op.ADD, Op.SUB, Op.MUL, Op.DIV, Op.NEG, Op.MULADD, Op.MULSUB, Op.SUBMUL)
_VECTORS = [op for op in Op if op.kind is Kind.VECTOR]


def _vector(rng: np.random.Generator, count: int, first: int) -> list[int]:
    """Return an operation on a vector none of whose operands lies where the results do."""
    op = _VECTORS[rng.integers(len(_VECTORS))]
    n = int(rng.integers(1, min(80, (count - first) // 2)))
    to = int(rng.integers(first, count - n + 1))
    free = [x for x in range(count) if not to <= x < to + n]
    words = [VECTOR + op, n, to]
    for _ in range(PLACES[op] - 1):
        step = int(rng.choice([0, 1, 1, 2, 3, -1, INDEXED]))
        begins = [x for x in free if {x + step * k for k in range(n)} <= set(free)]
        if step == INDEXED:
            words += [0, INDEXED, *map(int, rng.choice(free, n))]
        elif begins:
            words += [int(rng.choice(begins)), step]
        else:
            words += [int(rng.choice(free)), 0]
    return words


def _single(rng: np.random.Generator, count: int, first: int) -> list[int]:
    """Return a run of operations on single registers."""
    frequent = rng.random() < 0.7
    op = _FREQUENT[rng.integers(len(_FREQUENT))] if frequent else _ANY[rng.integers(len(_ANY))]
    words, results = [int(op), int(rng.integers(1, 4))], 2 if op is Op.SINCOS else 1
    for _ in range(words[1]):
        words += map(int, first + rng.permutation(count - first)[:results])
        words += map(int, rng.integers(0, count, PLACES[op] - results))
    return words


def random_program(rng: np.random.Generator, vectors: float, length: int, count: int) -> Program:
    """Return a program of random streams: main, and up to two that are deferred.

    Parameters
    ----------
    rng : Generator
    vectors : float
        The part of the operations that are on vectors.
    length, count : int
        The numbers of runs of operations in a stream, and of registers.
    """
    first = int(rng.integers(0, count // 3))  # those before are only read

    def stream() -> Int32:
        words: list[int] = []
        for _ in range(length):
            words += (_vector if rng.random() < vectors else _single)(rng, count, first)
        return np.array([*words, Op.END, 0], dtype=np.int32)

    streams = [stream() for _ in range(rng.integers(1, 4))]
    outputs = rng.permutation(count)[: rng.integers(1, count)].astype(np.int32)
    return Program(
        NOTHING, streams[0], tuple(streams[1:]), (), random_numbers(rng, count), outputs, length, 1
    )


def random_numbers(rng: np.random.Generator, count: int) -> Array:
    """Return numbers: some of them special, or all, or none."""
    plain = rng.normal(size=count)
    return np.where(
        rng.random(count) < rng.choice([0.0, 0.2, 1.0]), rng.choice(SPECIAL, count), plain
    )
