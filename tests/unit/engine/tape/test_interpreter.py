"""Both interpreters: operations by hand, values that are undefined, and many states at once."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence

import numpy as np
import pytest
import symengine as se
from tape_values import batch, value

from lagcli.engine.lowering.compiler import compile_tape
from lagcli.engine.tape import interpreter
from lagcli.engine.tape.interpreter import ArrayTape, ScalarTape, run_arrays
from lagcli.engine.tape.operations import ROUNDING, Op
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


X, Y, Z = se.symbols("x y z")


@pytest.mark.parametrize("excess", [2.0**-52, 1e-15, 1e-14, 1e-13])
@pytest.mark.parametrize(
    ("function", "bound", "sign", "expected"),
    [
        (se.acos(X), 1.0, 1, 0.0),
        (se.acos(X), -1.0, -1, math.pi),
        (se.asin(X), 1.0, 1, math.pi / 2),
        (se.asin(X), -1.0, -1, -math.pi / 2),
        (se.acosh(X), 1.0, -1, 0.0),
    ],
)
def test_rounding_beyond_the_domain_is_the_bound(
    function: se.Basic, bound: float, sign: int, expected: float, excess: float
) -> None:
    at = bound + sign * excess
    assert value(function, at) == expected
    assert batch(function, (at, 0.0, 0.0)) == [expected]
    # a thousand times as far it is not rounding
    beyond = bound + sign * (1e-10 + excess)
    assert math.isnan(value(function, beyond))
    assert np.isnan(batch(function, (beyond, 0.0, 0.0))).all()


@pytest.mark.parametrize(
    "root",
    [
        se.sqrt(X**2 - Y**2),
        (X**2 - Y**2) ** se.Rational(3, 2),
        (X**2 - Y**2) ** se.Rational(1, 3),
        se.sqrt((X**2 - Y**2) / (Z + 1)),
        se.sqrt(3 * (X**2 - Y**2) * (Z + 2)),
    ],
)
def test_roots_of_differences_that_vanish(root: se.Basic) -> None:
    chosen = random.Random(7)
    for _ in range(200):
        size = 10 ** chosen.uniform(-12, 12)
        x = chosen.uniform(0.5, 1) * size
        y = x * (1 + chosen.uniform(0, 1e-14))
        point = (x, y, chosen.uniform(0, 3))
        assert value(root, *point) == 0.0
        assert batch(root, point) == [0.0]
        assert math.isnan(value(root, x, y * (1 + 1e-11), point[2]))


def test_the_tolerance_of_a_root_has_the_size_of_its_terms() -> None:
    assert math.isnan(value(se.sqrt(X - Y), 1.0, 1.0 + 1e-10))
    assert math.isnan(value(se.sqrt(X - Y), 1e-12, 1.1e-12))
    assert value(se.sqrt(X - Y), 1e6, 1e6 + 1e-8) == 0.0
    # without terms, there is nothing to round
    assert math.isnan(value(se.sqrt(X), -1e-17))
    assert math.isnan(value(se.sqrt(X * Y), -1e-17, 1.0))


@pytest.mark.parametrize(
    "sum_of_squares",
    [X**2 + Y**2, (X - Y) ** 2 + (X + Y) ** 2, 1 + X**2, se.Abs(X) + Y**2, se.exp(X) + 1],
)
def test_sums_that_cannot_be_negative_cost_nothing(sum_of_squares: se.Basic) -> None:
    tape = compile_tape([se.sqrt(sum_of_squares)], (X, Y, Z))
    assert Op.CLIP not in {op for op, *_ in tape.code}


def test_derivatives_beyond_the_bound_are_those_at_the_bound() -> None:
    slope = compile_tape([se.acos(X).diff(X), se.asin(X).diff(X)], (X,))
    for x in (1.0, 1.0 + 2.0**-52, 1.0 + 1e-14):
        assert ScalarTape(slope)((x,)) == [-math.inf, math.inf]


@pytest.mark.parametrize(
    ("function", "exact", "low", "high"),
    [
        (se.asin, np.arcsin, -1, 1),
        (se.acos, np.arccos, -1, 1),
        (se.acosh, np.arccosh, 1, 50),
    ],
)
def test_inside_the_domain_nothing_changes(
    function: Callable[[se.Basic], se.Basic],
    exact: Callable[[np.ndarray], np.ndarray],
    low: float,
    high: float,
) -> None:
    inside = np.concatenate([np.linspace(low, high, 1001), [1 - 1e-16, 1 - 1e-13, 1 + 1e-13]])
    inside = inside[(inside >= low) & (inside <= high)]
    inside = inside[inside - low > ROUNDING]
    values = batch(function(X), *((x, 0.0, 0.0) for x in inside))
    np.testing.assert_array_equal(values, exact(inside))


def test_clipped() -> None:
    np.testing.assert_array_equal(
        interpreter.clipped(np.array([-1e-14, -1e-10, 2.0, np.nan]), np.full(4, 1.0)),
        [0.0, -1e-10, 2.0, np.nan],
    )


@pytest.mark.parametrize("seed", range(5))
def test_results_are_kept_as_long_as_they_are_used(seed: int) -> None:
    """Compare random tapes with operations on NumPy's arrays, all of whose results are kept."""
    rng = random.Random(seed)
    binary = {Op.ADD: np.add, Op.SUB: np.subtract, Op.MUL: np.multiply}
    inputs = [np.array([rng.uniform(-1, 1) for _ in range(4)]) for _ in range(3)]
    code, r = [], [*inputs, np.full(4, 0.5)]
    for to in range(4, 60):
        op, a, b = rng.choice([*binary]), rng.randrange(to), rng.randrange(to)
        code.append((int(op), to, a, b, 0))
        r.append(binary[op](r[a], r[b]))
    outputs = tuple(rng.randrange(60) for _ in range(8))
    run = ArrayTape(Tape(3, (0.5,), tuple(code), outputs))
    for _ in range(2):  # blocks of a run share a tape
        np.testing.assert_array_equal(run(inputs, 4), [r[i] for i in outputs])
