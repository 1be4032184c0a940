"""The functions of the expression language: one record each, for Python and C.

Everything about a function follows from its record: the grammar, dimensional analysis, symbolic
derivatives, operations of tapes in Python and C, power series, interval enclosures and the names in
each output. Functions of vectors are in `lagcli.model.names.building`.

The core is built with this module, so it imports only the standard library, and names functions of
SymEngine, NumPy and SciPy by text.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from fractions import Fraction
from typing import Any, NamedTuple


class DimensionRule(Enum):
    """The dimensions that a function accepts, and the dimension of its value."""

    NUMBER = "numbers or angles → number"
    ANGLE = "numbers or angles → angle"
    SAME = "arguments of one dimension → that dimension"
    DIRECTION = "arguments of one dimension → angle"
    SIGN = "an argument of any dimension → number"
    POWER = "the first argument raised to the second"


class Kind(Enum):
    """How the core executes an operation on several numbers."""

    LIBRARY = "one number at a time, by the C library"
    RELATION = "on a batch; the result is 1 where the comparison holds, else 0"
    BATCH = "on the eight numbers of a batch"
    VECTOR = "on a batch, and on vectors of registers in a single run"
    SPECIAL = "by code of its own in each evaluator"


class Domain(NamedTuple):
    """The interval of arguments with a real value.

    Parameters
    ----------
    low, high : float
    open : bool
        Whether finite bounds do not belong to the domain.
    rounded : bool
        Whether arguments beyond a bound by rounding have the value at the bound.
    """

    low: float = -math.inf
    high: float = math.inf
    open: bool = False
    rounded: bool = False


class Operation(NamedTuple):
    """The operation of tapes that evaluates a function; its opcode has the function's name.

    Parameters
    ----------
    c : str
        C expression of the value, with operands A and B. Names in capitals are macros, which differ
        between scalar and vector evaluators.
    scalar : callable
        Function of Python floats. It may raise if the result is infinite or NaN.
    array : str
        Dotted name of the function of arrays.
    slope : callable, optional
        The derivative f′(x) as ``slope(f, x, y)``, y = f(x), by + - * / and the functions of ``f``:
        ``f.exp``. With ``enclosure``, ``f.sqrt``, ``f.exp`` and ``f.log`` alone: the core encloses
        its power series by those. None for jumps, whose derivative is 0, and for functions that
        every evaluator differentiates itself.
    enclosure : str
        Function of ``core/tape/interval.c`` that encloses the values on an interval: ``increasing``
        or ``decreasing``, or one of its own. Empty if ``operate`` has a case of its own.
    domain : Domain
    arity : int
    kind : Kind
    """

    c: str
    scalar: Callable[..., float]
    array: str
    slope: Callable[[Any, Any, Any], Any] | None = None
    enclosure: str = ""
    domain: Domain = Domain()
    arity: int = 1
    kind: Kind = Kind.LIBRARY


class Spelling(NamedTuple):
    """How formulas write a function; text, JSON and the grammar write its name.

    Parameters
    ----------
    latex : str
        Command; by default its name in upright letters. Markdown writes LaTeX.
    mathml : str
        Name, if it is not that of the grammar.
    prefix : bool
        Whether an argument that is a name needs no parentheses: sin φ.
    fences : pair of str
        Delimiters around the argument instead of the name, in MathML.
    latex_fences : pair of str
        The same in LaTeX.
    """

    latex: str = ""
    mathml: str = ""
    prefix: bool = False
    fences: tuple[str, str] | None = None
    latex_fences: tuple[str, str] | None = None


class Function(NamedTuple):
    """A scalar function of the expression language.

    Parameters
    ----------
    dimension : DimensionRule or Fraction
        Its rule of dimensions; a fraction is a power of the argument.
    fewest, most : int
        Numbers of arguments; ``most`` is None if there is no limit.
    symbol : str
        SymEngine's class of the function, or the name of the function that creates the expression.
    expression : callable, optional
        The function in terms of others: ``expression(f, *arguments)``, where ``f`` has SymEngine's
        functions, and ``cases`` and ``relation``, which decide about constants.
        Without ``symbol`` and ``expression`` the function is opaque to SymEngine.
    operation : Operation, optional
        Its operation; functions with ``expression`` need none.
    smooth : bool
        False for piecewise expressions and functions with jumps.
    copies : callable
        How often the result repeats each argument, given their number.
    aliases : tuple of str
        Names in other programs, for suggestions.
    spelling : Spelling
    """

    dimension: DimensionRule | Fraction
    fewest: int = 1
    most: int | None = 1
    symbol: str = ""
    expression: Callable[..., Any] | None = None
    operation: Operation | None = None
    smooth: bool = True
    copies: Callable[[int], int] = lambda count: 1
    aliases: tuple[str, ...] = ()
    spelling: Spelling = Spelling()

    @property
    def opaque(self) -> bool:
        """Whether SymEngine knows neither the function nor an expression of it."""
        return not self.symbol and self.expression is None


def _chosen(f: Any, sign: str, xs: tuple[Any, ...]) -> Any:
    """Return the minimum or maximum by bisection: each level of cases repeats its arguments."""
    if len(xs) == 1:
        return xs[0]
    half = len(xs) // 2
    left, right = _chosen(f, sign, xs[:half]), _chosen(f, sign, xs[half:])
    return f.cases(f.relation(sign, left, right), left, right)


def _copies_in_halves(count: int) -> int:
    return int(2 ** (count - 1).bit_length())


def _absolute(f: Any, x: Any) -> Any:
    return f.cases(f.relation(">=", x, f.zero), x, -x)


def _sign(f: Any, x: Any) -> Any:
    below = f.cases(f.relation("<", x, f.zero), -f.one, f.zero)
    return f.cases(f.relation(">", x, f.zero), f.one, below)


def _cube_root(f: Any, x: Any) -> Any:
    third = f.one / 3
    return f.cases(f.relation(">=", x, f.zero), x**third, -((-x) ** third))


_NUMBER, _ANGLE, _SAME = DimensionRule.NUMBER, DimensionRule.ANGLE, DimensionRule.SAME
_UNIT = Domain(-1.0, 1.0, rounded=True)
_BELL = 2.0 / math.sqrt(math.pi)

#: The functions by their names in model files. Their operations are numbered in this order.
FUNCTIONS: dict[str, Function] = {
    "pow": Function(
        DimensionRule.POWER,
        2,
        2,
        expression=lambda f, x, y: x**y,
        operation=Operation("pow(A, B)", math.pow, "numpy.power", arity=2),
    ),
    "sqrt": Function(
        Fraction(1, 2),
        symbol="sqrt",
        operation=Operation(
            "SQRT(A)",
            math.sqrt,
            "numpy.sqrt",
            slope=lambda f, x, y: 0.5 / y,
            domain=Domain(0.0),
            kind=Kind.VECTOR,
        ),
    ),
    "sin": Function(
        _NUMBER,
        symbol="sin",
        operation=Operation(
            "SIN(A)", math.sin, "numpy.sin", slope=lambda f, x, y: f.cos(x), kind=Kind.BATCH
        ),
        aliases=("sine",),
        spelling=Spelling(r"\sin", prefix=True),
    ),
    "cos": Function(
        _NUMBER,
        symbol="cos",
        operation=Operation(
            "COS(A)", math.cos, "numpy.cos", slope=lambda f, x, y: -f.sin(x), kind=Kind.BATCH
        ),
        aliases=("cosine",),
        spelling=Spelling(r"\cos", prefix=True),
    ),
    "tan": Function(
        _NUMBER,
        symbol="tan",
        operation=Operation(
            "tan(A)", math.tan, "numpy.tan", lambda f, x, y: 1 + y * y, enclosure="tangent"
        ),
        aliases=("tangent",),
        spelling=Spelling(r"\tan", prefix=True),
    ),
    "asin": Function(
        _ANGLE,
        symbol="asin",
        operation=Operation(
            "asin(A)",
            math.asin,
            "numpy.arcsin",
            lambda f, x, y: 1 / f.sqrt(1 - x * x),
            "increasing",
            _UNIT,
        ),
        aliases=("arcsin",),
        spelling=Spelling(r"\arcsin", "arcsin"),
    ),
    "acos": Function(
        _ANGLE,
        symbol="acos",
        operation=Operation(
            "acos(A)",
            math.acos,
            "numpy.arccos",
            lambda f, x, y: -(1 / f.sqrt(1 - x * x)),
            "decreasing",
            _UNIT,
        ),
        aliases=("arccos",),
        spelling=Spelling(r"\arccos", "arccos"),
    ),
    "atan": Function(
        _ANGLE,
        symbol="atan",
        operation=Operation(
            "atan(A)", math.atan, "numpy.arctan", lambda f, x, y: 1 / (1 + x * x), "increasing"
        ),
        aliases=("arctan",),
        spelling=Spelling(r"\arctan", "arctan"),
    ),
    "atan2": Function(
        DimensionRule.DIRECTION,
        2,
        2,
        symbol="atan2",
        operation=Operation("atan2(A, B)", math.atan2, "numpy.arctan2", arity=2),
        smooth=False,  # SymEngine writes atan2(x, x) with sign(x)
        aliases=("arctan2",),
    ),
    "sinh": Function(
        _NUMBER,
        symbol="sinh",
        operation=Operation("sinh(A)", math.sinh, "numpy.sinh", lambda f, x, y: f.cosh(x)),
        spelling=Spelling(r"\sinh", prefix=True),
    ),
    "cosh": Function(
        _NUMBER,
        symbol="cosh",
        operation=Operation("cosh(A)", math.cosh, "numpy.cosh", lambda f, x, y: f.sinh(x)),
        spelling=Spelling(r"\cosh", prefix=True),
    ),
    "tanh": Function(
        _NUMBER,
        symbol="tanh",
        operation=Operation(
            "tanh(A)", math.tanh, "numpy.tanh", lambda f, x, y: 1 - y * y, "increasing"
        ),
        spelling=Spelling(r"\tanh", prefix=True),
    ),
    "asinh": Function(
        _NUMBER,
        symbol="asinh",
        operation=Operation(
            "asinh(A)",
            math.asinh,
            "numpy.arcsinh",
            lambda f, x, y: 1 / f.sqrt(1 + x * x),
            "increasing",
        ),
        aliases=("arcsinh",),
    ),
    "acosh": Function(
        _NUMBER,
        symbol="acosh",
        operation=Operation(
            "acosh(A)",
            math.acosh,
            "numpy.arccosh",
            lambda f, x, y: 1 / f.sqrt(x * x - 1),
            "increasing",
            Domain(1.0, rounded=True),
        ),
        aliases=("arccosh",),
    ),
    "atanh": Function(
        _NUMBER,
        symbol="atanh",
        operation=Operation(
            "atanh(A)",
            math.atanh,
            "numpy.arctanh",
            lambda f, x, y: 1 / (1 - x * x),
            "increasing",
            Domain(-1.0, 1.0, open=True),
        ),
        aliases=("arctanh",),
    ),
    "exp": Function(
        _NUMBER,
        symbol="exp",
        operation=Operation("exp(A)", math.exp, "numpy.exp", lambda f, x, y: y),
    ),
    "log": Function(
        _NUMBER,
        1,
        2,
        symbol="log",
        expression=lambda f, x, *base: f.log(x) / f.log(*base) if base else f.log(x),
        operation=Operation(
            "log(A)",
            math.log,
            "numpy.log",
            lambda f, x, y: 1 / x,
            domain=Domain(0.0, open=True),
        ),
        aliases=("ln",),
        spelling=Spelling(r"\log", prefix=True),
    ),
    "erf": Function(
        _NUMBER,
        symbol="erf",
        operation=Operation(
            "erf(A)",
            math.erf,
            "scipy.special.erf",
            lambda f, x, y: _BELL * f.exp(-(x * x)),
            "increasing",
        ),
    ),
    "erfc": Function(
        _NUMBER,
        symbol="erfc",
        operation=Operation(
            "erfc(A)",
            math.erfc,
            "scipy.special.erfc",
            lambda f, x, y: -_BELL * f.exp(-(x * x)),
            "decreasing",
        ),
    ),
    "floor": Function(
        _NUMBER,
        symbol="floor",
        expression=lambda f, x: f.floor(x),
        operation=Operation("floor(A)", lambda a: float(math.floor(a)), "numpy.floor"),
        smooth=False,
        aliases=("mod",),
        spelling=Spelling(fences=("⌊", "⌋"), latex_fences=(r"\lfloor ", r" \rfloor")),
    ),
    "ceil": Function(
        _NUMBER,
        symbol="ceiling",
        expression=lambda f, x: f.ceiling(x),
        operation=Operation("ceil(A)", lambda a: float(math.ceil(a)), "numpy.ceil"),
        smooth=False,
        aliases=("ceiling",),
        spelling=Spelling(fences=("⌈", "⌉"), latex_fences=(r"\lceil ", r" \rceil")),
    ),
    "exp2": Function(_NUMBER, expression=lambda f, x: 2**x),
    "expm1": Function(
        _NUMBER,
        operation=Operation(
            "expm1(A)", math.expm1, "numpy.expm1", lambda f, x, y: f.exp(x), "increasing"
        ),
    ),
    "log10": Function(_NUMBER, expression=lambda f, x: f.log(x) / f.log(10), aliases=("lg",)),
    "log2": Function(_NUMBER, expression=lambda f, x: f.log(x) / f.log(2)),
    "log1p": Function(
        _NUMBER,
        operation=Operation(
            "log1p(A)",
            math.log1p,
            "numpy.log1p",
            lambda f, x, y: 1 / (1 + x),
            "increasing",
            Domain(-1.0, open=True),
        ),
    ),
    "cbrt": Function(Fraction(1, 3), expression=_cube_root, smooth=False, copies=lambda count: 3),
    "hypot": Function(_SAME, 1, None, expression=lambda f, *xs: f.sqrt(sum(x**2 for x in xs))),
    "abs": Function(
        _SAME,
        expression=_absolute,
        smooth=False,
        copies=lambda count: 3,
        aliases=("Abs",),
        spelling=Spelling(fences=("|", "|"), latex_fences=(r"\lvert ", r" \rvert")),
    ),
    "fabs": Function(_SAME, expression=_absolute, smooth=False, copies=lambda count: 3),
    "sign": Function(
        DimensionRule.SIGN,
        expression=_sign,
        smooth=False,
        copies=lambda count: 2,
        aliases=("sgn", "signum"),
    ),
    "step": Function(
        DimensionRule.SIGN,
        expression=lambda f, x: f.cases(f.relation(">=", x, f.zero), f.one, f.zero),
        smooth=False,
        aliases=("heaviside", "Heaviside"),
    ),
    "min": Function(
        _SAME,
        1,
        None,
        expression=lambda f, *xs: _chosen(f, "<=", xs),
        smooth=False,
        copies=_copies_in_halves,
        spelling=Spelling(r"\min"),
    ),
    "max": Function(
        _SAME,
        1,
        None,
        expression=lambda f, *xs: _chosen(f, ">=", xs),
        smooth=False,
        copies=_copies_in_halves,
        spelling=Spelling(r"\max"),
    ),
    "degrees": Function(_NUMBER, expression=lambda f, x: x * 180 / f.pi),
    "radians": Function(_ANGLE, expression=lambda f, x: x * f.pi / 180),
}

#: The functions that have an operation, by the names of their opcodes.
OPERATIONS = {name.upper(): f for name, f in FUNCTIONS.items() if f.operation is not None}
