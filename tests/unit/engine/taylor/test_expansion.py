"""Operations on numbers → operations on series, run in Python, against Taylor coefficients."""

from __future__ import annotations

from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from series_values import coefficients

from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Arithmetic
from lagcli.engine.taylor.expansion import NotAnalytic, SeriesExpansion
from lagcli.engine.taylor.series_nodes import ZERO

ORDER = 6
#: x(t) and y(t), which are given, and a number.
X = [0.4, 0.7, -0.3, 0.2, 0.1, -0.05, 0.02]
Y = [1.3, -0.2, 0.5, 0.1, -0.3, 0.07, 0.01]
S = 0.6


def series(build: Callable[[Arithmetic], int]) -> np.ndarray:
    """Return the coefficients of a result of x, y and a number s: registers 0, 1 and 2."""
    builder = Arithmetic(3, parameters=1)
    register = build(builder)
    expansion = SeriesExpansion(builder, (0, 1))
    expansion.expand([register])
    (found,) = coefficients(expansion, [register], {0: X, 1: Y}, (X[0], Y[0], S))
    return found


def expected(function: Callable[..., mpmath.mpf]) -> np.ndarray:
    """Return the Taylor coefficients of a function of x(t) and y(t) by mpmath."""
    with mpmath.workdps(40):

        def composed(t: mpmath.mpf) -> mpmath.mpf:
            return function(*(mpmath.polyval([mpmath.mpf(c) for c in p[::-1]], t) for p in (X, Y)))

        return np.array([float(c) for c in mpmath.taylor(composed, 0, ORDER)])


FUNCTIONS = {
    Op.SQRT: mpmath.sqrt,
    Op.SIN: mpmath.sin,
    Op.COS: mpmath.cos,
    Op.TAN: mpmath.tan,
    Op.ASIN: mpmath.asin,
    Op.ACOS: mpmath.acos,
    Op.ATAN: mpmath.atan,
    Op.SINH: mpmath.sinh,
    Op.COSH: mpmath.cosh,
    Op.TANH: mpmath.tanh,
    Op.ASINH: mpmath.asinh,
    Op.ATANH: mpmath.atanh,
    Op.EXP: mpmath.exp,
    Op.LOG: mpmath.log,
    Op.ERF: mpmath.erf,
    Op.ERFC: mpmath.erfc,
}


@pytest.mark.parametrize("op", FUNCTIONS, ids=lambda op: op.name)
def test_functions_of_series(op: Op) -> None:
    found = series(lambda b: b.emit(op, 0))
    np.testing.assert_allclose(found, expected(lambda x, y: FUNCTIONS[op](x)), rtol=1e-11)


CASES: dict[str, tuple[Callable[[Arithmetic], int], Callable[..., mpmath.mpf]]] = {
    "acosh": (lambda b: b.emit(Op.ACOSH, 1), lambda x, y: mpmath.acosh(y)),
    "sum": (lambda b: b.emit(Op.ADD, 0, 1), lambda x, y: x + y),
    "difference": (lambda b: b.emit(Op.SUB, 0, 1), lambda x, y: x - y),
    "with a number": (lambda b: b.emit(Op.SUB, 2, 0), lambda x, y: S - x),
    "product": (lambda b: b.emit(Op.MUL, 0, 1), lambda x, y: x * y),
    "multiple": (lambda b: b.emit(Op.NEG, b.emit(Op.MUL, 2, 0)), lambda x, y: -S * x),
    "quotient": (lambda b: b.emit(Op.DIV, 0, 1), lambda x, y: x / y),
    "inverse": (lambda b: b.emit(Op.DIV, 2, 1), lambda x, y: S / y),
    "over a number": (lambda b: b.emit(Op.DIV, 0, 2), lambda x, y: x / S),
    "power": (lambda b: b.emit(Op.POW, 0, 2), lambda x, y: x**S),
    "exponential": (lambda b: b.emit(Op.POW, 2, 0), lambda x, y: mpmath.mpf(S) ** x),
    "both": (lambda b: b.emit(Op.POW, 0, 1), lambda x, y: x**y),
    "angle": (lambda b: b.emit(Op.ATAN2, 0, 1), lambda x, y: mpmath.atan2(x, y)),
    "angle to a number": (lambda b: b.emit(Op.ATAN2, 2, 0), lambda x, y: mpmath.atan2(S, x)),
    "nested": (
        lambda b: b.emit(Op.MUL, b.emit(Op.SIN, b.emit(Op.MUL, 0, 1)), b.emit(Op.EXP, 1)),
        lambda x, y: mpmath.sin(x * y) * mpmath.exp(y),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_operations_on_series(case: str) -> None:
    build, function = CASES[case]
    np.testing.assert_allclose(series(build), expected(function), rtol=1e-11, atol=1e-14)


@pytest.mark.parametrize("op", [Op.ABS, Op.FLOOR, Op.LT, Op.SELECT], ids=lambda op: op.name)
def test_kinks_and_jumps_have_no_series(op: Op) -> None:
    builder = Arithmetic(3)
    register = builder.emit(op, *range(op.arity))
    with pytest.raises(NotAnalytic, match=op.name.lower()):
        SeriesExpansion(builder, (0,)).operation(op, register, 0, 1)


@pytest.mark.parametrize("number", [S, 0.0])
def test_a_choice_that_stays_has_the_series_of_what_is_chosen(number: float) -> None:
    def chosen(b: Arithmetic, first: int, second: int) -> int:
        return b.emit(Op.SELECT, b.emit(Op.LT, b.zero, 2), first, second)

    for first, second in ((0, 1), (0, 2), (2, 1)):
        builder = Arithmetic(3, parameters=1)
        register = builder.emit(Op.MUL, 0, chosen(builder, first, second))
        expansion = SeriesExpansion(builder, (0, 1))
        expansion.expand([register])
        values = (X[0], Y[0], number)
        (found,) = coefficients(expansion, [register], {0: X, 1: Y}, values)
        other = (X, Y, [number] + [0.0] * ORDER)[first if number > 0 else second]
        product = [sum(X[i] * other[k - i] for i in range(k + 1)) for k in range(ORDER + 1)]
        np.testing.assert_allclose(found, product, rtol=1e-14)


def test_what_does_not_move_is_a_number() -> None:
    builder = Arithmetic(2)
    register = builder.emit(Op.ABS, 1)  # which has no series
    expansion = SeriesExpansion(builder, (0,))
    expansion.expand([register])
    assert expansion.is_invariant(register)
    assert expansion.result(register) == ZERO
    assert expansion.wanted([ZERO]) == []
