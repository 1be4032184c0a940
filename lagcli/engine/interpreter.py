"""Runs a tape in Python: on one state with `math`, on many at once with NumPy."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lagcli.engine.tape import Op, Tape

Array = NDArray[np.float64]


def _guarded(function: Callable[..., float]) -> Callable[..., float]:
    """Return a function that gives NaN where `math` raises."""

    def guarded(*arguments: float) -> float:
        try:
            return function(*arguments)
        except (ValueError, ZeroDivisionError):
            return math.nan
        except OverflowError:
            return math.inf

    return guarded


def _truth(relation: Callable[[float, float], bool]) -> Callable[[float, float], float]:
    return lambda a, b: 1.0 if relation(a, b) else 0.0


_SCALAR: dict[Op, Callable[..., float]] = {
    Op.ADD: operator.add,
    Op.SUB: operator.sub,
    Op.MUL: operator.mul,
    Op.DIV: _guarded(operator.truediv),
    Op.NEG: operator.neg,
    Op.POW: _guarded(math.pow),
    Op.SQRT: _guarded(math.sqrt),
    Op.SIN: _guarded(math.sin),
    Op.COS: _guarded(math.cos),
    Op.TAN: _guarded(math.tan),
    Op.ASIN: _guarded(math.asin),
    Op.ACOS: _guarded(math.acos),
    Op.ATAN: math.atan,
    Op.ATAN2: math.atan2,
    Op.SINH: _guarded(math.sinh),
    Op.COSH: _guarded(math.cosh),
    Op.TANH: math.tanh,
    Op.ASINH: math.asinh,
    Op.ACOSH: _guarded(math.acosh),
    Op.ATANH: _guarded(math.atanh),
    Op.EXP: _guarded(math.exp),
    Op.LOG: _guarded(math.log),
    Op.ERF: math.erf,
    Op.ERFC: math.erfc,
    Op.FLOOR: _guarded(lambda x: float(math.floor(x))),
    Op.CEIL: _guarded(lambda x: float(math.ceil(x))),
    Op.ABS: abs,
    Op.LT: _truth(operator.lt),
    Op.LE: _truth(operator.le),
    Op.EQ: _truth(operator.eq),
    Op.NE: _truth(operator.ne),
    Op.AND: lambda a, b: a * b,
    Op.OR: max,
    Op.NOT: lambda a: 1.0 - a,
    Op.SELECT: lambda condition, a, b: a if condition else b,
}
_ARITY = {op: 1 for op in (Op.NEG, Op.SQRT, Op.SIN, Op.COS, Op.TAN, Op.ASIN, Op.ACOS, Op.ATAN)}
_ARITY |= {op: 1 for op in (Op.SINH, Op.COSH, Op.TANH, Op.ASINH, Op.ACOSH, Op.ATANH, Op.EXP)}
_ARITY |= {op: 1 for op in (Op.LOG, Op.ERF, Op.ERFC, Op.FLOOR, Op.CEIL, Op.ABS, Op.NOT)}
_ARITY[Op.SELECT] = 3


def _arrays() -> dict[Op, Callable[..., Any]]:
    from scipy import special

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
        Op.ERF: special.erf,
        Op.ERFC: special.erfc,
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


class ScalarTape:
    """A tape bound to Python's floats."""

    def __init__(self, tape: Tape):
        self._inputs = tape.inputs
        self._rest = list(tape.constants) + [0.0] * len(tape.code)
        self._outputs = tape.outputs
        self._steps = [
            (_SCALAR[Op(op)], _ARITY.get(Op(op), 2), to, a, b, c) for op, to, a, b, c in tape.code
        ]

    def __call__(self, inputs: Iterable[float]) -> list[float]:
        """Return the outputs for one set of inputs; undefined values are NaN."""
        r = [*inputs, *self._rest]
        for function, arity, to, a, b, c in self._steps:
            if arity == 2:
                r[to] = function(r[a], r[b])
            elif arity == 1:
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
            arity = _ARITY.get(Op(op), 2)
            operands = (r[a], r[b], r[c])[:arity]
            r[to] = functions[Op(op)](*operands)
    out = np.empty((len(tape.outputs), count))
    for i, register in enumerate(tape.outputs):
        out[i] = r[register]
    return out
