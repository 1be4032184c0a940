"""The table of operations: each row contains all properties of one operation for Python and C.

`lagcli.engine.core.headers` generates the C side when the core is built, so this module imports
only the standard library, and names NumPy's and SymEngine's functions by text.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from enum import Enum, IntEnum


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
    ASIN = 1, Kind.LIBRARY, "asin(A)", math.asin, "numpy.arcsin", "asin"
    ACOS = 1, Kind.LIBRARY, "acos(A)", math.acos, "numpy.arccos", "acos"
    ATAN = 1, Kind.LIBRARY, "atan(A)", math.atan, "numpy.arctan", "atan"
    ATAN2 = 2, Kind.LIBRARY, "atan2(A, B)", math.atan2, "numpy.arctan2", "atan2"
    SINH = 1, Kind.LIBRARY, "sinh(A)", math.sinh, "numpy.sinh", "sinh"
    COSH = 1, Kind.LIBRARY, "cosh(A)", math.cosh, "numpy.cosh", "cosh"
    TANH = 1, Kind.LIBRARY, "tanh(A)", math.tanh, "numpy.tanh", "tanh"
    ASINH = 1, Kind.LIBRARY, "asinh(A)", math.asinh, "numpy.arcsinh", "asinh"
    ACOSH = 1, Kind.LIBRARY, "acosh(A)", math.acosh, "numpy.arccosh", "acosh"
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
