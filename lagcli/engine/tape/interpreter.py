"""Runs a tape in Python: on one state with `math`, on many at once with NumPy.

Both follow IEEE 754, as compiled code does: 1/0 is ∞, log(-1) is NaN, nothing raises, and a value
that is undefined matters only where it reaches an output.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lagcli.engine.tape.tape import ARITY, Op, Tape

Array = NDArray[np.float64]


def _special() -> Any:
    # imported when used: a run without error functions must not pay for it
    from scipy import special

    return special


@cache
def _arrays() -> dict[int, Callable[..., Any]]:
    """Return the operations on arrays."""

    def as_number(relation: Callable[..., Any]) -> Callable[..., Any]:
        return lambda a, b: np.where(relation(a, b), 1.0, 0.0)

    return {
        Op.ADD: np.add,
        Op.SUB: np.subtract,
        Op.MUL: np.multiply,
        Op.DIV: np.divide,
        Op.NEG: np.negative,
        Op.POW: np.power,
        Op.SQRT: np.sqrt,
        Op.SIN: np.sin,
        Op.COS: np.cos,
        Op.TAN: np.tan,
        Op.ASIN: np.arcsin,
        Op.ACOS: np.arccos,
        Op.ATAN: np.arctan,
        Op.ATAN2: np.arctan2,
        Op.SINH: np.sinh,
        Op.COSH: np.cosh,
        Op.TANH: np.tanh,
        Op.ASINH: np.arcsinh,
        Op.ACOSH: np.arccosh,
        Op.ATANH: np.arctanh,
        Op.EXP: np.exp,
        Op.LOG: np.log,
        Op.ERF: lambda x: _special().erf(x),
        Op.ERFC: lambda x: _special().erfc(x),
        Op.FLOOR: np.floor,
        Op.CEIL: np.ceil,
        Op.ABS: np.abs,
        Op.LT: as_number(np.less),
        Op.LE: as_number(np.less_equal),
        Op.EQ: as_number(np.equal),
        Op.NE: as_number(np.not_equal),
        Op.AND: np.multiply,
        Op.OR: np.maximum,
        Op.NOT: lambda a: 1.0 - a,
        Op.SELECT: lambda condition, a, b: np.where(condition != 0.0, a, b),
    }


def _guarded(op: Op, function: Callable[..., float]) -> Callable[..., float]:
    """Return a function that gives what IEEE 754 says (±∞ or NaN) where `math` raises."""

    def guarded(*arguments: float) -> float:
        try:
            return function(*arguments)
        except (ValueError, ZeroDivisionError, OverflowError):
            with np.errstate(all="ignore"):
                return float(_arrays()[op](*map(np.float64, arguments)))

    return guarded


def _truth(relation: Callable[[float, float], bool]) -> Callable[[float, float], float]:
    return lambda a, b: 1.0 if relation(a, b) else 0.0


#: Operations on floats that never raise.
_TOTAL: dict[Op, Callable[..., float]] = {
    Op.ADD: operator.add,
    Op.SUB: operator.sub,
    Op.MUL: operator.mul,
    Op.NEG: operator.neg,
    Op.ATAN: math.atan,
    Op.ATAN2: math.atan2,
    Op.TANH: math.tanh,
    Op.ASINH: math.asinh,
    Op.ERF: math.erf,
    Op.ERFC: math.erfc,
    Op.ABS: abs,
    Op.LT: _truth(operator.lt),
    Op.LE: _truth(operator.le),
    Op.EQ: _truth(operator.eq),
    Op.NE: _truth(operator.ne),
    Op.AND: operator.mul,
    Op.OR: max,
    Op.NOT: lambda a: 1.0 - a,
    Op.SELECT: lambda condition, a, b: a if condition else b,
}
_PARTIAL: dict[Op, Callable[..., float]] = {
    Op.DIV: operator.truediv,
    Op.POW: math.pow,
    Op.SQRT: math.sqrt,
    Op.SIN: math.sin,
    Op.COS: math.cos,
    Op.TAN: math.tan,
    Op.ASIN: math.asin,
    Op.ACOS: math.acos,
    Op.SINH: math.sinh,
    Op.COSH: math.cosh,
    Op.ACOSH: math.acosh,
    Op.ATANH: math.atanh,
    Op.EXP: math.exp,
    Op.LOG: math.log,
    Op.FLOOR: lambda x: float(math.floor(x)),
    Op.CEIL: lambda x: float(math.ceil(x)),
}
_SCALAR: dict[int, Callable[..., float]] = _TOTAL | {
    op: _guarded(op, function) for op, function in _PARTIAL.items()
}


class ScalarTape:
    """A tape bound to Python's floats."""

    def __init__(self, tape: Tape):
        self._inputs = tape.inputs
        self._rest = list(tape.constants) + [0.0] * len(tape.code)
        self._outputs = tape.outputs
        self._steps = [(_SCALAR[op], ARITY[op], to, a, b, c) for op, to, a, b, c in tape.code]

    def __call__(self, inputs: Iterable[float]) -> list[float]:
        """Return the outputs for one set of inputs; undefined values are NaN or ±∞."""
        r = [*inputs, *self._rest]
        for function, operands, to, a, b, c in self._steps:
            if operands == 2:
                r[to] = function(r[a], r[b])
            elif operands == 1:
                r[to] = function(r[a])
            else:
                r[to] = function(r[a], r[b], r[c])
        return [r[i] for i in self._outputs]


def run_arrays(tape: Tape, inputs: Iterable[Array | float], count: int) -> Array:
    """Run a tape on many states at once.

    Parameters
    ----------
    tape : Tape
    inputs : iterable of (count,) arrays or numbers
    count : int
        Number of states.

    Returns
    -------
    (outputs, count) array
    """
    functions = _arrays()
    r: list[Any] = [*inputs, *tape.constants, *([None] * len(tape.code))]
    with np.errstate(all="ignore"):
        for op, to, a, b, c in tape.code:
            operands = (r[a], r[b], r[c])[: ARITY[op]]
            r[to] = functions[op](*operands)
    out = np.empty((len(tape.outputs), count))
    for i, register in enumerate(tape.outputs):
        out[i] = r[register]
    return out
