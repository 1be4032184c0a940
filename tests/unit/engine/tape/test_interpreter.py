"""Both interpreters: operations by hand, values that are undefined, and many states at once."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from lagcli.engine.tape.interpreter import ScalarTape, run_arrays
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Tape

INF, NAN = math.inf, math.nan


def single(op: Op) -> Tape:
    """Return a tape of one operation on the inputs."""
    operands = (*range(op.arity), 0, 0)[:3]
    return Tape(op.arity, (), ((int(op), op.arity, *operands),), (op.arity,))


@pytest.mark.parametrize(
    ("op", "operands", "expected"),
    [
        (Op.SUB, (2.0, 5.0), -3.0),
        (Op.DIV, (1.0, 4.0), 0.25),
        (Op.POW, (2.0, -2.0), 0.25),
        (Op.ATAN2, (1.0, -1.0), 3 * math.pi / 4),
        (Op.FLOOR, (-1.5,), -2.0),
        (Op.CEIL, (-1.5,), -1.0),
        (Op.LT, (1.0, 2.0), 1.0),
        (Op.LT, (2.0, 2.0), 0.0),
        (Op.LE, (2.0, 2.0), 1.0),
        (Op.EQ, (2.0, 3.0), 0.0),
        (Op.NE, (2.0, 3.0), 1.0),
        (Op.AND, (1.0, 0.0), 0.0),
        (Op.OR, (1.0, 0.0), 1.0),
        (Op.NOT, (1.0,), 0.0),
        (Op.SELECT, (1.0, 5.0, 7.0), 5.0),
        (Op.SELECT, (0.0, 5.0, 7.0), 7.0),
        # undefined and infinite values, as IEEE 754 has them
        (Op.DIV, (1.0, 0.0), INF),
        (Op.DIV, (-1.0, 0.0), -INF),
        (Op.DIV, (0.0, 0.0), NAN),
        (Op.LOG, (0.0,), -INF),
        (Op.LOG, (-1.0,), NAN),
        (Op.SQRT, (-1.0,), NAN),
        (Op.EXP, (1e4,), INF),
        (Op.SINH, (-1e4,), -INF),
        (Op.POW, (-8.0, 1 / 3), NAN),
        (Op.POW, (0.0, -1.0), INF),
        (Op.POW, (-1e200, 3.0), -INF),
        (Op.ATANH, (1.0,), INF),
        (Op.ACOSH, (0.5,), NAN),
        (Op.SIN, (INF,), NAN),
        (Op.FLOOR, (INF,), INF),
        (Op.LT, (NAN, 1.0), 0.0),
        (Op.SELECT, (1.0, 5.0, NAN), 5.0),
    ],
)
def test_operations_by_hand(op: Op, operands: Sequence[float], expected: float) -> None:
    tape = single(op)
    close = pytest.approx(expected, rel=1e-15, nan_ok=True)
    assert ScalarTape(tape)(operands)[0] == close
    columns = [np.array([x, x]) for x in operands]
    np.testing.assert_allclose(run_arrays(tape, columns, 2), [[expected] * 2], rtol=1e-15)


def test_an_undefined_value_matters_only_where_it_is_used() -> None:
    # x, then log x and x + x
    tape = Tape(1, (), ((Op.LOG, 1, 0, 0, 0), (Op.ADD, 2, 0, 0, 0)), (2,))
    assert ScalarTape(tape)((-3.0,)) == [-6.0]
    np.testing.assert_array_equal(run_arrays(tape, [np.array([-3.0, 2.0])], 2), [[-6.0, 4.0]])


def test_a_tape_runs_again_and_again() -> None:
    tape = ScalarTape(Tape(1, (3.0,), ((Op.MUL, 2, 0, 1, 0), (Op.SUB, 3, 2, 0, 0)), (3, 2, 1)))
    for x in (2.0, -5.0, 2.0):
        assert tape(iter([x])) == [2 * x, 3 * x, 3.0]


def test_outputs_that_are_alike_in_all_states_are_repeated() -> None:
    tape = Tape(1, (4.0,), (), (1, 0))
    found = run_arrays(tape, [7.0], 3)
    np.testing.assert_array_equal(found, [[4.0] * 3, [7.0] * 3])


def test_tape_is_data() -> None:
    # written by hand: (x + 2) y
    tape = Tape(2, (2.0,), ((Op.ADD, 3, 0, 2, 0), (Op.MUL, 4, 3, 1, 0)), (4, 0))
    assert ScalarTape(tape)((3.0, 4.0)) == [20.0, 3.0]
    np.testing.assert_array_equal(
        run_arrays(tape, (np.array([3.0, 1.0]), 4.0), 2), [[20.0, 12.0], [3.0, 1.0]]
    )
