"""Operations: each row of the table gives the same in Python, on arrays and in the core."""

from __future__ import annotations

import random

import numpy as np
import pytest
import symengine as se
from core_parts import run_tape

from lagcli.engine.lowering.compiler import compile_tape
from lagcli.engine.tape.interpreter import ScalarTape, run_arrays
from lagcli.engine.tape.operations import ARITY, INDEXED, LONGEST, PLACES, VECTOR, Kind, Op
from lagcli.engine.tape.series_operations import SeriesOp
from lagcli.engine.tape.tape import Tape

ON_NUMBERS = [op for op in Op if op.scalar]
SPECIAL = [0.0, 1.0, -1.0, 0.5, 2.5, float("inf"), -float("inf"), float("nan")]
SPECIAL += [1 + 2**-52, -1 - 1e-14, 1 - 2**-53, 1 + 1e-10, -1e-14]  # at the ends of domains


@pytest.mark.parametrize("op", ON_NUMBERS, ids=lambda op: op.name)
def test_all_evaluators_agree(op: Op) -> None:
    chosen = random.Random(int(op))
    truth = op in (Op.AND, Op.OR, Op.NOT)
    rows = [
        [chosen.choice((0.0, 1.0)) if truth else chosen.choice(SPECIAL) for _ in range(op.arity)]
        for _ in range(60)
    ]
    operands = (*range(op.arity), 0, 0)[:3]
    tape = Tape(op.arity, (), ((int(op), op.arity, *operands),), (op.arity,))
    expected = [ScalarTape(tape)(row)[0] for row in rows]
    many = run_arrays(tape, np.array(rows).T, len(rows))[0]
    np.testing.assert_allclose(many, expected, rtol=1e-15)
    core = [run_tape(tape, row)[0] for row in rows]
    np.testing.assert_allclose(core, expected, rtol=1e-15)


@pytest.mark.parametrize("op", [op for op in Op if op.symbol], ids=lambda op: op.name)
def test_classes_of_symengine_become_operations(op: Op) -> None:
    x, y = se.symbols("x y")
    if op is Op.NOT:
        pytest.skip("SymEngine turns the conditions around instead")
    pair = (x < 0, y < 0) if op in (Op.AND, Op.OR) else (x, y)
    tape = compile_tape([getattr(se, op.symbol)(*pair[: op.arity])], (x, y))
    assert tape.code[-1][0] == op


def test_table() -> None:
    assert list(Op) == list(range(len(Op)))
    assert (ARITY[Op.SELECT], PLACES[Op.SELECT]) == (3, 4)
    assert (ARITY[Op.SINCOS], PLACES[Op.SINCOS]) == (1, 3)
    assert all(bool(op.c) == (op.kind is not Kind.SPECIAL) for op in Op)


# numbers in streams that must not be taken for others


def test_operations_on_vectors_are_no_other_operations() -> None:
    for operations in (Op, SeriesOp):
        assert not {VECTOR + op for op in operations} & set(operations)


def test_no_step_is_taken_for_a_list() -> None:
    # streams are int32; a step between places, which are not negative, is larger
    assert np.iinfo(np.int32).min == INDEXED < -np.iinfo(np.int32).max


def test_vectors_are_whole_batches_of_eight() -> None:
    assert LONGEST % 8 == 0
