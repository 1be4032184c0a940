"""Values of expressions, by tapes and exactly."""

from __future__ import annotations

import math
import os
from fractions import Fraction

import numpy as np
import symengine as se
from core_parts import run_tape

from lagcli.engine.lowering.compiler import compile_tape
from lagcli.engine.tape.interpreter import ScalarTape, run_arrays
from lagcli.functions import FUNCTIONS
from lagcli.model.expression.functions import apply

VARIABLES = se.symbols("x y z")

#: Whether the core multiplies and adds in one operation (`make test-fma`): it rounds less often
#: than the reference, and than its own vectors, which are contracted elsewhere.
CONTRACTED = "LAGCLI_CONTRACTION" in os.environ


def value(expression: se.Basic, *point: float) -> float:
    """Evaluate by a tape, one state at a time: by Python and by the core, alike.

    With contraction they may differ, and the value is that of the core.
    """
    inputs = (*point, *[0.0] * (3 - len(point)))
    # which inputs stay the same along a run decides the order of the operations
    tapes = [compile_tape([expression], VARIABLES[: 3 - k], VARIABLES[3 - k :]) for k in (0, 2)]
    found = [ScalarTape(tape)(inputs)[0] for tape in tapes]
    if CONTRACTED:
        return float(run_tape(tapes[0], inputs)[0])
    for tape, expected in zip(tapes, found, strict=True):
        np.testing.assert_array_equal(run_tape(tape, inputs), [expected])
    return found[0]


def assert_same(found: np.ndarray, expected: np.ndarray) -> None:
    """Compare values of the core with the reference's, to the last bit.

    With contraction, each of the few operations of a value differs by half a unit in the last place
    of its operands, which are not larger than the largest of all values.
    """
    if CONTRACTED:
        size = np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=0, atol=8 * np.finfo(float).eps * size)
    else:
        np.testing.assert_array_equal(found, expected)


def batch(expression: se.Basic, *points: tuple[float, float, float]) -> np.ndarray:
    """Evaluate by a tape, all states at once."""
    columns = np.array(points, dtype=float).T
    return run_arrays(compile_tape([expression], VARIABLES), columns, len(points))[0]


#: The functions that SymEngine does not know, by those that it knows.
_KNOWN = {"expm1": lambda x: se.exp(x) - 1, "log1p": lambda x: se.log(1 + x)}


def in_known_functions(expression: se.Basic) -> se.Basic:
    """Return an expression in functions that SymEngine can evaluate and differentiate."""
    calls = expression.atoms(se.FunctionSymbol)
    return expression.xreplace({x: _KNOWN[x.get_name()](*x.args) for x in calls})


def exactly(expression: se.Basic, point: tuple[float, ...]) -> float:
    """Evaluate by substitution of exact numbers; NaN where that is not a real number."""
    values = {
        s: se.Rational(*Fraction(x).as_integer_ratio())
        for s, x in zip(VARIABLES, point, strict=True)
    }
    try:
        return float(in_known_functions(expression).subs(values).n(200, real=True))
    except RuntimeError:  # not a real number
        return math.nan


def applied(name: str, *arguments: se.Basic) -> se.Basic:
    function = FUNCTIONS[name]
    most = len(arguments) if function.most is None else function.most
    return apply(name, *arguments[: max(function.fewest, most)])
