"""Streams read again: parts of one, and vectors taken apart."""

from __future__ import annotations

import numpy as np

from lagcli.engine.program.nodes import INDEXED, VECTOR
from lagcli.engine.program.subprograms import excerpt, unpacked
from lagcli.engine.tape.operations import Op


def stream(*numbers: int) -> np.ndarray:
    return np.array([*numbers, Op.END, 0], dtype=np.int32)


#: Registers 0 to 3 are inputs: r4 = r0 + r1, r5 = r2 + r3; r6, r7 = sin, cos of r4; r8 = r7 r5.
SINGLES = stream(
    *(Op.ADD, 2, 4, 0, 1, 5, 2, 3),
    *(Op.SINCOS, 1, 6, 7, 4),
    *(Op.MUL, 1, 8, 7, 5),
)


def test_an_excerpt_holds_what_results_depend_on() -> None:
    for results, expected in (
        ([5], stream(Op.ADD, 1, 5, 2, 3)),
        ([6], stream(Op.ADD, 1, 4, 0, 1, Op.SINCOS, 1, 6, 7, 4)),
        ([8], SINGLES),
        ([5, 4], stream(Op.ADD, 2, 4, 0, 1, 5, 2, 3)),
        ([0], stream()),
        ([], stream()),
    ):
        np.testing.assert_array_equal(excerpt(SINGLES, 9, results), expected)


def test_a_value_that_is_overwritten_is_not_needed_before() -> None:
    # r2 = −r0, used by nothing; r2 = −r1; r3 = r2 + r2
    again = stream(Op.NEG, 2, 2, 0, 2, 1, Op.ADD, 1, 3, 2, 2)
    expected = stream(Op.NEG, 1, 2, 1, Op.ADD, 1, 3, 2, 2)
    np.testing.assert_array_equal(excerpt(again, 4, [3]), expected)


#: r20 … r22 = r0, r2, r4 times r5, r9, r7.
VECTORS = (VECTOR + Op.MUL, 3, 20, 0, 2, 0, INDEXED, 5, 9, 7)


def test_vectors_stay_whole_in_excerpts() -> None:
    given = stream(Op.NEG, 2, 9, 1, 10, 1, *VECTORS)
    found = excerpt(given, 23, [21])
    np.testing.assert_array_equal(found, stream(Op.NEG, 1, 9, 1, *VECTORS))
    np.testing.assert_array_equal(excerpt(given, 23, [10]), stream(Op.NEG, 1, 10, 1))


def test_vectors_are_taken_apart_element_by_element() -> None:
    given = stream(*VECTORS, Op.MUL, 1, 30, 20, 22)
    expected = stream(Op.MUL, 4, 20, 0, 5, 21, 2, 9, 22, 4, 7, 30, 20, 22)
    np.testing.assert_array_equal(unpacked(given), expected)
    np.testing.assert_array_equal(unpacked(SINGLES), SINGLES)
