"""The table of operations: each row contains all properties of one operation for Python and C.

Rows of functions follow from `lagcli.functions`. `lagcli.engine.core.headers` generates the C side
when the core is built, so this module imports only the standard library, and names NumPy's and
SymEngine's functions by text.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable
from enum import IntEnum
from functools import partial
from typing import Any

from lagcli import functions
from lagcli.functions import Domain, Function, Kind, Operation

#: Functions are continued by their bound up to this far beyond their domain, relative to 1 for
#: `acos`, `asin` and `acosh`, and to the terms of the sum for roots: ten times the relative
#: residual that projection leaves in constraints, which is larger than rounding errors.
ROUNDING = 2.0**-43


def clipped(a: float, b: float) -> float:
    """Return a, or 0 where it is negative by rounding of terms whose squares add up to b."""
    return a - a if a < 0.0 and a * a <= ROUNDING * ROUNDING * b else a


def bounded(a: float, domain: Domain) -> float:
    """Return a, or the bound of a domain where it is beyond by rounding."""
    if domain.low - ROUNDING <= a < domain.low:
        return domain.low
    return domain.high if domain.high < a <= domain.high + ROUNDING else a


_CLIPPED = f"CHOOSE((A < 0.0) & (A * A <= {ROUNDING * ROUNDING!r} * B), A - A, A)"


def _bounded_in_c(domain: Domain) -> str:
    """Return `bounded` as a C expression of A."""
    text = "A"
    if domain.low > -math.inf:
        text = f"A < {domain.low!r} && A >= {domain.low - ROUNDING!r} ? {domain.low!r} : {text}"
    if domain.high < math.inf:
        text = f"A > {domain.high!r} && A <= {domain.high + ROUNDING!r} ? {domain.high!r} : {text}"
    return text


def _at_bound(function: Callable[[float], float], domain: Domain, a: float) -> float:
    return function(bounded(a, domain))


def _row(function: Function) -> tuple[Any, ...]:
    """Return the row of a function's operation."""
    operation = function.operation
    assert operation is not None
    c, scalar, domain = operation.c, operation.scalar, operation.domain
    if domain.rounded:
        c = re.sub(r"\bA\b", _bounded_in_c(domain), c)
        scalar = partial(_at_bound, scalar, domain)
    arity, kind, array = operation.arity, operation.kind, operation.array
    return arity, kind, c, scalar, array, function.symbol, 1, operation


class Op(IntEnum):
    """Operations of tapes, followed by those of programs; true is 1 and false 0.

    Attributes
    ----------
    arity : int
        Number of operands.
    kind : Kind
    c : str
        C expression of the value, with operands A, B and C. Names in capitals are macros, which
        differ between scalar and vector evaluators.
    scalar : callable, optional
        Function of Python floats; None for operations that occur only in programs. It may raise if
        the result is infinite or NaN.
    array : str
        Dotted name of the function of arrays; empty if ``scalar`` also works for arrays.
    symbol : str
        Class in SymEngine; empty for operations that the compiler handles separately.
    results : int
        Number of results.
    function : Operation, optional
        The function of the grammar that it evaluates.
    """

    arity: int
    kind: Kind
    c: str
    scalar: Callable[..., float] | None
    array: str
    symbol: str
    results: int
    function: Operation | None

    # operations of functions that the engine uses by name
    POW: Op
    SQRT: Op
    SIN: Op
    COS: Op
    TAN: Op
    ATAN2: Op
    SINH: Op
    COSH: Op
    TANH: Op
    EXP: Op
    LOG: Op
    FLOOR: Op
    CEIL: Op

    def __new__(
        cls,
        arity: int,
        kind: Kind,
        c: str,
        scalar: Callable[..., float] | None = None,
        array: str = "",
        symbol: str = "",
        results: int = 1,
        function: Operation | None = None,
    ) -> Op:
        """Number the operations in the order of their rows."""
        op = int.__new__(cls, len(cls.__members__))
        op._value_ = len(cls.__members__)
        op.arity, op.kind, op.c, op.results = arity, kind, c, results
        op.scalar, op.array, op.symbol, op.function = scalar, array, symbol, function
        return op

    ADD = 2, Kind.VECTOR, "A + B", operator.add
    SUB = 2, Kind.VECTOR, "A - B", operator.sub
    MUL = 2, Kind.VECTOR, "A * B", operator.mul
    DIV = 2, Kind.VECTOR, "A / B", operator.truediv, "numpy.divide"
    NEG = 1, Kind.VECTOR, "-A", operator.neg
    vars().update((name, _row(function)) for name, function in functions.OPERATIONS.items())
    ABS = 1, Kind.VECTOR, "ABS(A)", abs, "", "Abs"
    LT = 2, Kind.RELATION, "A < B", operator.lt, "numpy.less", "StrictLessThan"
    LE = 2, Kind.RELATION, "A <= B", operator.le, "numpy.less_equal", "LessThan"
    EQ = 2, Kind.RELATION, "A == B", operator.eq, "numpy.equal", "Equality"
    NE = 2, Kind.RELATION, "A != B", operator.ne, "numpy.not_equal", "Unequality"
    AND = 2, Kind.BATCH, "A * B", operator.mul, "", "And"
    OR = 2, Kind.BATCH, "LARGER(A, B)", max, "numpy.maximum", "Or"
    NOT = 1, Kind.BATCH, "1.0 - A", lambda a: 1.0 - a, "", "Not"
    SELECT = 3, Kind.BATCH, "CHOOSE(A != 0.0, B, C)", lambda a, b, c: b if a else c, "numpy.where"
    CLIP = 2, Kind.BATCH, _CLIPPED, clipped, "lagcli.engine.tape.interpreter.clipped"
    # operations that occur only in programs
    MULADD = 3, Kind.VECTOR, "A * B + C"
    MULSUB = 3, Kind.VECTOR, "A * B - C"
    SUBMUL = 3, Kind.VECTOR, "C - A * B"
    MOVE = 1, Kind.VECTOR, "A"
    SINCOS = 1, Kind.SPECIAL, "", None, "", "", 2
    END = 0, Kind.SPECIAL, "", None, "", "", 0


#: The operations by their numbers.
OPERATIONS = tuple(Op)
#: Numbers of operands, by operation.
ARITY = tuple(op.arity for op in Op)
#: Numbers of operands and results.
PLACES = tuple(op.arity + op.results for op in Op)

# streams of programs, and power series

#: Flag of vector operations, added to an operation.
VECTOR = 64
#: Least and largest number of elements of a vector: a shorter one takes as long as its parts.
SHORTEST, LONGEST = 8, 256
#: Largest number of results and operands of an operation, also on series.
NODE_VALUES = 7
#: Step of an operand whose registers are listed individually.
INDEXED = -(2**31)
#: Registers in a cache line.
LINE = 8
#: The largest order of a series; the loops of the core have this limit.
MAX_ORDER = 31
