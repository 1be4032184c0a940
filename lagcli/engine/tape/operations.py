"""The table of operations: each row contains all properties of one operation for Python and C.

`lagcli.engine.core.headers` generates the C side when the core is built, so this module imports
only the standard library, and names NumPy's and SymEngine's functions by text.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from enum import Enum, IntEnum

#: Functions are continued by their bound up to this far beyond their domain, relative to 1 for
#: `acos`, `asin` and `acosh`, and to the terms of the sum for roots: ten times the relative
#: residual that projection leaves in constraints, which is larger than rounding errors.
ROUNDING = 2.0**-43


def clipped(a: float, b: float) -> float:
    """Return a, or 0 where it is negative by rounding of terms whose squares add up to b."""
    return 0.0 if a < 0.0 and a * a <= ROUNDING * ROUNDING * b else a


def bounded(a: float) -> float:
    """Return a, or ±1 where it is beyond [−1, 1] by rounding."""
    return math.copysign(1.0, a) if 1.0 < abs(a) <= 1.0 + ROUNDING else a


def raised(a: float) -> float:
    """Return a, or 1 where it is below 1 by rounding."""
    return 1.0 if 1.0 - ROUNDING <= a < 1.0 else a


#: The module of the same on arrays.
_ON_ARRAYS = "lagcli.engine.tape.domains."
#: The same in C.
_CLIPPED = f"CHOOSE((A < 0.0) & (A * A <= {ROUNDING * ROUNDING!r} * B), A - A, A)"
_BOUNDED = f"fabs(A) > 1.0 && fabs(A) <= {1 + ROUNDING!r} ? copysign(1.0, A) : A"
_RAISED = f"A < 1.0 && A >= {1 - ROUNDING!r} ? 1.0 : A"


class Kind(Enum):
    """How the core executes an operation on several numbers."""

    LIBRARY = "one number at a time, by the C library"
    RELATION = "on a batch; the result is 1 where the comparison holds, else 0"
    BATCH = "on the eight numbers of a batch"
    VECTOR = "on a batch, and on vectors of registers in a single run"
    SPECIAL = "by code of its own in each evaluator"


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
    """

    arity: int
    kind: Kind
    c: str
    scalar: Callable[..., float] | None
    array: str
    symbol: str
    results: int

    def __new__(
        cls,
        arity: int,
        kind: Kind,
        c: str,
        scalar: Callable[..., float] | None = None,
        array: str = "",
        symbol: str = "",
        results: int = 1,
    ) -> Op:
        """Number the operations in the order of their rows."""
        op = int.__new__(cls, len(cls.__members__))
        op._value_ = len(cls.__members__)
        op.arity, op.kind, op.c, op.results = arity, kind, c, results
        op.scalar, op.array, op.symbol = scalar, array, symbol
        return op

    ADD = 2, Kind.VECTOR, "A + B", operator.add
    SUB = 2, Kind.VECTOR, "A - B", operator.sub
    MUL = 2, Kind.VECTOR, "A * B", operator.mul
    DIV = 2, Kind.VECTOR, "A / B", operator.truediv, "numpy.divide"
    NEG = 1, Kind.VECTOR, "-A", operator.neg
    POW = 2, Kind.LIBRARY, "pow(A, B)", math.pow, "numpy.power"
    SQRT = 1, Kind.VECTOR, "SQRT(A)", math.sqrt, "numpy.sqrt"
    SIN = 1, Kind.BATCH, "SIN(A)", math.sin, "numpy.sin", "sin"
    COS = 1, Kind.BATCH, "COS(A)", math.cos, "numpy.cos", "cos"
    TAN = 1, Kind.LIBRARY, "tan(A)", math.tan, "numpy.tan", "tan"
    ASIN = (
        1,
        Kind.LIBRARY,
        f"asin({_BOUNDED})",
        lambda a: math.asin(bounded(a)),
        _ON_ARRAYS + "arcsin",
        "asin",
    )
    ACOS = (
        1,
        Kind.LIBRARY,
        f"acos({_BOUNDED})",
        lambda a: math.acos(bounded(a)),
        _ON_ARRAYS + "arccos",
        "acos",
    )
    ATAN = 1, Kind.LIBRARY, "atan(A)", math.atan, "numpy.arctan", "atan"
    ATAN2 = 2, Kind.LIBRARY, "atan2(A, B)", math.atan2, "numpy.arctan2", "atan2"
    SINH = 1, Kind.LIBRARY, "sinh(A)", math.sinh, "numpy.sinh", "sinh"
    COSH = 1, Kind.LIBRARY, "cosh(A)", math.cosh, "numpy.cosh", "cosh"
    TANH = 1, Kind.LIBRARY, "tanh(A)", math.tanh, "numpy.tanh", "tanh"
    ASINH = 1, Kind.LIBRARY, "asinh(A)", math.asinh, "numpy.arcsinh", "asinh"
    ACOSH = (
        1,
        Kind.LIBRARY,
        f"acosh({_RAISED})",
        lambda a: math.acosh(raised(a)),
        _ON_ARRAYS + "arccosh",
        "acosh",
    )
    ATANH = 1, Kind.LIBRARY, "atanh(A)", math.atanh, "numpy.arctanh", "atanh"
    EXP = 1, Kind.LIBRARY, "exp(A)", math.exp, "numpy.exp"
    LOG = 1, Kind.LIBRARY, "log(A)", math.log, "numpy.log", "log"
    ERF = 1, Kind.LIBRARY, "erf(A)", math.erf, "scipy.special.erf", "erf"
    ERFC = 1, Kind.LIBRARY, "erfc(A)", math.erfc, "scipy.special.erfc", "erfc"
    FLOOR = 1, Kind.LIBRARY, "floor(A)", lambda a: float(math.floor(a)), "numpy.floor", "floor"
    CEIL = 1, Kind.LIBRARY, "ceil(A)", lambda a: float(math.ceil(a)), "numpy.ceil", "ceiling"
    ABS = 1, Kind.VECTOR, "ABS(A)", abs, "", "Abs"
    LT = 2, Kind.RELATION, "A < B", operator.lt, "numpy.less", "StrictLessThan"
    LE = 2, Kind.RELATION, "A <= B", operator.le, "numpy.less_equal", "LessThan"
    EQ = 2, Kind.RELATION, "A == B", operator.eq, "numpy.equal", "Equality"
    NE = 2, Kind.RELATION, "A != B", operator.ne, "numpy.not_equal", "Unequality"
    AND = 2, Kind.BATCH, "A * B", operator.mul, "", "And"
    OR = 2, Kind.BATCH, "LARGER(A, B)", max, "numpy.maximum", "Or"
    NOT = 1, Kind.BATCH, "1.0 - A", lambda a: 1.0 - a, "", "Not"
    SELECT = 3, Kind.BATCH, "CHOOSE(A != 0.0, B, C)", lambda a, b, c: b if a else c, "numpy.where"
    CLIP = 2, Kind.BATCH, _CLIPPED, clipped, _ON_ARRAYS + "clipped"
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
