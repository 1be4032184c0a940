"""Compilation of expressions to a tape.

Equal subexpressions share one register, constants are folded to doubles, integer powers are
products. Subexpressions that depend only on parameters are multiplied and added first, so that they
can be reused between evaluations.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from functools import lru_cache, partial, reduce
from typing import TYPE_CHECKING

import numpy as np
import symengine as se
from symengine import Basic

from lagcli.engine.tape.inputs import NO_FUNCTIONS, InputFunctions, interpolated
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import COMMUTATIVE, Builder, Tape
from lagcli.model.expression.functions import is_opaque
from lagcli.model.model import read_input

if TYPE_CHECKING:
    from lagcli.model.model import Model

MAX_PRODUCT_POWER = 64  # x^n by repeated squaring up to here, by pow beyond
#: Number of expressions from which those that differ only in names are compiled once, ...
_MANY = 500
#: ... the most names in one of them, or terms in one that is no long sum, ...
_FEW = 24
#: ... and how many more of them may have no template before them than have one.
_VAIN = 64

_OPERATIONS = {getattr(se, op.symbol): op for op in Op if op.symbol}
#: SymEngine writes tan(x + pi/2) as −cot(x), and atan2(x, x) with sign(x).
_RECIPROCAL = {
    se.cot: Op.TAN,
    se.sec: Op.COS,
    se.csc: Op.SIN,
    se.coth: Op.TANH,
    se.sech: Op.COSH,
    se.csch: Op.SINH,
}
_NOT_FINITE = (type(se.oo), type(-se.oo), type(se.zoo), type(se.nan))
_TRUTH = (bool, type(se.true), type(se.false))
#: What stands for the variables on which a constant depends.
_INVARIANT = -1, -1
_OF_INPUTS = (se.FunctionSymbol, se.Derivative)
#: What stands for the names in a template.
_PLACES = [se.Symbol(str(k)) for k in range(_FEW)]
#: The parts of an expression, and which of them are subtracted or divide.
_Parts = tuple[Sequence[Basic], Sequence[bool]]


def compile_tape(
    expressions: Iterable[Basic],
    variables: Sequence[Basic],
    parameters: Sequence[Basic] = (),
    functions: InputFunctions = NO_FUNCTIONS,
) -> Tape:
    """Compile expressions to one tape.

    Parameters
    ----------
    expressions : iterable of expressions
        One output each.
    variables, parameters : sequences of symbols
        One input register each, in this order; parameters are constant along a run.
    functions : InputFunctions, optional
        Known functions of time; t must be the first variable then.

    Raises
    ------
    KeyError
        An expression contains a symbol that is not an input.
    """
    outputs = list(expressions)
    if not outputs:
        held = len(parameters) + functions.size
        return Tape(len(variables) + held, (), (), (), held, functions=functions)
    compiler = _Compiler(variables, parameters, functions)
    alike = len(outputs) >= _MANY and not functions.size
    register = compiler.register_alike if alike else compiler.register
    return compiler.finish([register(e) for e in outputs])


class _Orders(dict[int, tuple[int, int, int]]):
    """Sort keys of terms and factors by register; constant ones come first.

    The first and the last variable on which a register depends, and the register: the operations
    for all bodies are then in the same order.
    """

    def __missing__(self, register: int) -> tuple[int, int, int]:
        return *_INVARIANT, register


class _Template:
    """The operations of an expression whose names are replaced by places.

    Parameters
    ----------
    expression : expression
    places : sequence of symbols
    parameters : int
        Number of the first place that stands for a parameter.
    """

    def __init__(self, expression: Basic, places: Sequence[Basic], parameters: int):
        compiler = _Compiler(places[:parameters], places[parameters:], NO_FUNCTIONS)
        result = compiler.register(expression)
        # registers as places in a list: the inputs, the constants and the results, in order
        self.constants = tuple(compiler.constants)
        held = len(places) + len(self.constants)

        def place(register: int) -> int:
            if register < 0:
                return len(places) - 1 - register
            return register if register < len(places) else held + register - len(places)

        self.steps = [
            (op, op in COMMUTATIVE, [place(x) for x in operands])
            for op, *operands in compiler.operations
        ]
        self.result = place(result)


class _Compiler(Builder):
    """Compiles expressions to operations."""

    def __init__(
        self, variables: Sequence[Basic], parameters: Sequence[Basic], functions: InputFunctions
    ):
        held = len(parameters) + functions.size
        super().__init__(len(variables) + held, held, 0, functions)
        first = len(variables) + len(parameters)
        self.parameters_begin = len(variables)
        self.templates: dict[tuple[Basic, int], _Template] = {}
        self.vain = 0  # expressions without a template before them, less those with one
        self.pieces = {
            name: (first + at, degree) for name, (at, degree) in functions.places().items()
        }
        self.known: dict[Basic, int] = {s: i for i, s in enumerate([*variables, *parameters])}
        self.orders = _Orders((x, (x, x, x)) for x in range(len(variables)))

    def note(self, op: int, register: int, operands: tuple[int, ...]) -> None:
        """Record the dependencies of a new register."""
        orders, first, last = self.orders, -1, -1
        for x in operands:
            if x in orders:
                begin, end, _ = orders[x]
                if last < 0:
                    first, last = begin, end
                else:
                    if begin < first:
                        first = begin
                    if end > last:
                        last = end
        if last < 0:
            self.invariant.add(register)
        else:
            orders[register] = first, last, register

    def order(self, register: int) -> tuple[int, int, int]:
        """Return the sort key of terms and factors: constant ones first."""
        return self.orders[register]

    def register_alike(self, expression: Basic) -> int:
        """Return the register of one of many expressions, such as one for each body.

        Those that differ only in names have one template, whose operations are repeated with other
        registers. Terms of long sums have templates of their own.
        """
        known = self.known
        if isinstance(expression, se.Add) and len(expression.args) > _FEW:
            for term in expression.args:
                self.register_alike(_sign_split(term)[0])
        elif not isinstance(expression, (se.Symbol, se.Number, *_TRUTH)):
            if (register := known.get(expression)) is not None:
                return register
            names = expression.free_symbols if self.vain < _VAIN else set()
            if 0 < len(names) <= _FEW and known.keys() >= names:
                return self._repeat(expression, sorted(names, key=known.__getitem__))
            self.vain += 1
        return self.register(expression)

    def _repeat(self, expression: Basic, names: Sequence[Basic]) -> int:
        """Return the register of an expression, by the operations of its template.

        Parameters
        ----------
        expression : expression
        names : sequence of symbols
            Its symbols, in the order of the inputs.
        """
        inputs = [self.known[name] for name in names]
        parameters = bisect_left(inputs, self.parameters_begin)
        renamed = expression.xreplace(dict(zip(names, _PLACES, strict=False)))
        template = self.templates.get((renamed, parameters))
        self.vain += 1 if template is None else -1
        if template is None:
            template = _Template(renamed, _PLACES[: len(names)], parameters)
            self.templates[renamed, parameters] = template
        registers = [*inputs, *map(self.constant, template.constants)]
        orders, known, new = self.orders, self.operations.get, self.new
        for op, commutative, operands in template.steps:
            # as `emit`, without its calls: most of the time is spent here
            key = (op, *[registers[x] for x in operands])
            if commutative and orders[key[1]] > orders[key[2]]:
                key = op, key[2], key[1]
            register = known(key)
            registers.append(new(key) if register is None else register)
        register = self.known[expression] = registers[template.result]
        return register

    def register(self, expression: Basic) -> int:
        """Return the register of an expression; compiles its parts first, without recursion."""
        known = self.known
        stack: list[tuple[Basic, _Parts | None]] = [(expression, None)]
        while stack:
            top, parts = stack.pop()
            key = _key(top)
            if key in known:
                continue
            if parts is None:
                if (read := _input_read(top)) is not None:
                    known[top] = self._input(*read)
                    continue
                parts = _parts(top)
                missing = [part for part in parts[0] if _key(part) not in known]
                if missing:
                    stack.append((top, parts))
                    stack += [(part, None) for part in missing]
                    continue
            known[key] = self._assemble(top, *parts)
        return known[_key(expression)]

    def _assemble(self, e: Basic, parts: Sequence[Basic], apart: Sequence[bool]) -> int:
        """Emit the operation of an expression whose parts have been compiled; see `_parts`."""
        if isinstance(e, se.Add):
            return self._sum(parts, apart)
        if isinstance(e, se.Mul):
            return self._product(parts, apart)
        if isinstance(e, _TRUTH):
            return self.constant(1.0 if e else 0.0)
        if isinstance(e, se.Symbol):
            raise KeyError(e.name)
        if not e.args or isinstance(e, _NOT_FINITE):
            return self.constant(_double(e))
        if isinstance(e, se.Pow):
            base, exponent = e.args
            return self._power(base, exponent)
        if isinstance(e, se.Piecewise):
            return self._cases(e)
        operands = [self.known[_key(a)] for a in parts]
        kind = type(e)
        if kind in _OPERATIONS or is_opaque(e):
            op = Op[e.get_name().upper()] if is_opaque(e) else _OPERATIONS[kind]
            if op.arity == 1:
                return self.emit(op, *operands)
            return reduce(partial(self.emit, op), operands)  # And and Or may have many
        if kind in _RECIPROCAL:
            return self.emit(Op.DIV, self.constant(1.0), self.emit(_RECIPROCAL[kind], operands[0]))
        if kind is se.sign:
            return self._sign(operands[0])
        raise TypeError(f"no operation for {kind.__name__}: {e}")

    def _input(self, name: str, order: int) -> int:
        """Emit a derivative of a known function of time: that of its piece, by Horner's rule."""
        if name not in self.pieces:
            raise KeyError(name)
        origin, degree = self.pieces[name]
        x = self.emit(Op.SUB, 0, origin)
        total = self.constant(0.0)
        for k in range(degree, order - 1, -1):
            term, factor = origin + 1 + k, math.perm(k, order)
            if factor != 1:
                term = self.emit(Op.MUL, term, self.constant(factor))
            total = term if k == degree else self.emit(Op.ADD, self.emit(Op.MUL, total, x), term)
        return total

    def _sign(self, x: int) -> int:
        zero, one = self.constant(0.0), self.constant(1.0)
        # if neither holds, x itself: 0 or NaN
        negative = self.emit(Op.SELECT, self.emit(Op.LT, x, zero), self.emit(Op.NEG, one), x)
        return self.emit(Op.SELECT, self.emit(Op.LT, zero, x), one, negative)

    def _sum(self, terms: Sequence[Basic], negative: Sequence[bool]) -> int:
        plus: list[int] = []
        minus: list[int] = []
        for term, subtracted in zip(terms, negative, strict=True):
            (minus if subtracted else plus).append(self.known[term])
        plus.sort(key=self.orders.__getitem__)
        minus.sort(key=self.orders.__getitem__)
        if plus:
            total, *rest = plus
        else:
            total, rest = self.emit(Op.NEG, minus.pop(0)), []
        for x in rest:
            total = self.emit(Op.ADD, total, x)
        for x in minus:
            total = self.emit(Op.SUB, total, x)
        return total

    def _product(self, factors: Sequence[Basic], inverse: Sequence[bool]) -> int:
        numerator: list[int] = []
        denominator: list[int] = []
        for factor, divides in zip(factors, inverse, strict=True):
            (denominator if divides else numerator).append(self.known[factor])
        minus_one = self.constants.get(-1.0)
        negative = minus_one is not None and -1 - minus_one in numerator
        if negative:
            numerator.remove(-1 - minus_one)  # type: ignore[operator]
        numerator.sort(key=self.orders.__getitem__)
        denominator.sort(key=self.orders.__getitem__)
        total = numerator[0] if numerator else self.constant(1.0)
        for x in numerator[1:]:
            total = self.emit(Op.MUL, total, x)
        if denominator:
            divisor = denominator[0]
            for x in denominator[1:]:
                divisor = self.emit(Op.MUL, divisor, x)
            total = self.emit(Op.DIV, total, divisor)
        return self.emit(Op.NEG, total) if negative else total

    def _power(self, base: Basic, exponent: Basic) -> int:
        if base == se.E:
            return self.emit(Op.EXP, self.known[_key(exponent)])
        x = self.known[_key(base)]
        halves = _as_products(exponent)
        if not halves:
            if isinstance(exponent, se.Number) and not isinstance(exponent, se.Integer):
                x = self._clipped(base)
            return self.emit(Op.POW, x, self.known[_key(exponent)])
        result = self._integer_power(x, abs(halves) // 2)
        if halves % 2:
            root = self.emit(Op.SQRT, self._clipped(base))
            result = root if result is None else self.emit(Op.MUL, result, root)
        assert result is not None
        return result if halves > 0 else self.emit(Op.DIV, self.constant(1.0), result)

    def _clipped(self, e: Basic) -> int:
        """Return the register of the argument of a root: 0 where a sum is negative by rounding."""
        x = self.known[_key(e)]
        if _is_nonnegative(e) or not _has_sum(e):
            return x
        return self.emit(Op.CLIP, x, self._squares(e))

    def _squares(self, e: Basic) -> int:
        """Return the register of a sum with its terms squared, or of a product with its factors.

        Squares have power series and derivatives everywhere, unlike magnitudes.
        """
        if isinstance(e, se.Add):
            squares = [self._squares(_sign_split(term)[0]) for term in e.args]
            return reduce(partial(self.emit, Op.ADD), sorted(squares, key=self.orders.__getitem__))
        if isinstance(e, se.Mul) and _has_sum(e):
            total = self.constant(1.0)
            for factor in e.args:
                base, inverse = _inverse_split(factor)
                total = self.emit(Op.DIV if inverse else Op.MUL, total, self._squares(base))
            return total
        if isinstance(e, se.Number):
            return self.constant(_double(e) ** 2)
        x = self.known[_key(e)]
        return self.emit(Op.MUL, x, x)

    def _integer_power(self, x: int, n: int) -> int | None:
        result: int | None = None
        while n:
            if n & 1:
                result = x if result is None else self.emit(Op.MUL, result, x)
            n >>= 1
            if n:
                x = self.emit(Op.MUL, x, x)
        return result

    def _cases(self, e: Basic) -> int:
        values, conditions = e.args[0::2], e.args[1::2]
        total = self.constant(math.nan) if conditions[-1] != se.true else None
        for value, condition in zip(reversed(values), reversed(conditions), strict=True):
            x = self.known[_key(value)]
            total = (
                x if total is None else self.emit(Op.SELECT, self.known[_key(condition)], x, total)
            )
        assert total is not None
        return total


def _key(e: object) -> object:
    # python's True equals 1, so truth needs its own keys
    return ("bool", bool(e)) if type(e) in _TRUTH else e


def _input_read(e: Basic) -> tuple[str, int] | None:
    """Return the known function of time that an expression is, and the order of its derivative."""
    return read_input(e) if isinstance(e, _OF_INPUTS) else None


def _double(e: Basic) -> float:
    """Return the double nearest to a number or a constant such as pi."""
    if isinstance(e, (se.Integer, se.Rational)):
        # SymEngine truncates fractions where Python rounds them
        numerator, denominator = map(int, e.get_num_den())
        try:
            return numerator / denominator
        except OverflowError:
            return math.inf if numerator > 0 else -math.inf
    if isinstance(e, _NOT_FINITE):
        return math.inf if e == se.oo else -math.inf if e == -se.oo else math.nan
    if isinstance(e, se.Number) and not e.is_real:
        return math.nan
    return float(e) if isinstance(e, se.Number) else float(e.n(53, real=True))


def _as_products(exponent: Basic) -> int:
    """Return twice the exponent of x^n or x^(n/2) that is compiled to products; 0 for any other."""
    if isinstance(exponent, se.Integer):
        halves = 2 * int(exponent)
    elif isinstance(exponent, se.Rational):
        numerator, denominator = map(int, exponent.get_num_den())
        halves = numerator if denominator == 2 else 0
    else:
        halves = 0
    return halves if abs(halves) <= 2 * MAX_PRODUCT_POWER else 0


def _has_sum(e: Basic) -> bool:
    """Return whether an expression is a sum, or a product with one."""
    if isinstance(e, se.Mul):
        return any(isinstance(_inverse_split(factor)[0], se.Add) for factor in e.args)
    return isinstance(e, se.Add)


def _is_nonnegative(e: Basic) -> bool:
    """Return whether an expression is a sum or product of squares and the like."""
    if isinstance(e, (se.Add, se.Mul)):
        return all(map(_is_nonnegative, e.args))
    if isinstance(e, se.Pow):
        base, exponent = e.args
        if not isinstance(exponent, se.Integer):
            return isinstance(exponent, se.Rational) or _is_nonnegative(base)
        return int(exponent) % 2 == 0 or _is_nonnegative(base)
    if isinstance(e, se.Number):
        return bool(e.is_real and not e.is_negative)
    return isinstance(e, (se.Abs, se.cosh)) or e == se.pi or e == se.E


def _sign_split(term: Basic) -> tuple[Basic, bool]:
    """Return a term without a leading negative number, and whether it had one."""
    if isinstance(term, se.Mul):
        first = term.args[0]
        if isinstance(first, se.Number) and first.is_negative:
            return -term, True
    return term, False


def _inverse_split(factor: Basic) -> tuple[Basic, bool]:
    """Return the divisor of a factor, and True; or the factor, and False."""
    if isinstance(factor, se.Pow) and factor.args[0] != se.E:
        exponent = factor.args[1]
        if isinstance(exponent, se.Number) and exponent.is_negative:
            return factor.args[0] ** -exponent, True
    return factor, False


def _parts(e: Basic) -> _Parts:
    """Return the parts that must be compiled before an expression.

    For terms of a sum it is also returned whether they are subtracted, for factors of a product
    whether they divide it.
    """
    if isinstance(e, se.Add):
        terms, negative = zip(*map(_sign_split, e.args), strict=True)
        return terms, negative
    if isinstance(e, se.Mul):
        factors, inverse = zip(*map(_inverse_split, e.args), strict=True)
        return factors, inverse
    if isinstance(e, (bool, *_NOT_FINITE)):
        return (), ()
    if isinstance(e, se.Pow):
        base, exponent = e.args
        if base == se.E:
            return (exponent,), ()
        return ((base,) if _as_products(exponent) else (base, exponent)), ()
    return e.args, ()


@lru_cache(maxsize=4)
def input_functions(model: Model) -> InputFunctions:
    """Return the known functions of time of a model's inputs.

    Parameters
    ----------
    model : Model

    Returns
    -------
    InputFunctions
        In the model's order.
    """
    return InputFunctions(
        tuple(
            interpolated(
                name,
                np.array(x.data.times),
                np.array(x.data.values),
                x.interpolation,
                x.extend,
            )
            for name, x in model.inputs.items()
        )
    )
