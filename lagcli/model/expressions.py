"""Trees of the grammar → SymEngine expressions, vectors and matrices.

Nothing of the user's text reaches an evaluator: names are looked up in a scope, operations are
SymEngine's, and every step is bounded.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import symengine as se
from symengine import Basic

from lagcli.model import tensors
from lagcli.model.functions import FUNCTIONS, cases
from lagcli.model.grammar import (
    Call,
    Comparison,
    ExpressionError,
    Logical,
    Name,
    Number,
    Power,
    Product,
    Sum,
    Tree,
    Vector,
)
from lagcli.model.source import nearest
from lagcli.model.tensors import ShapeError, Tensor

Value = Basic | Tensor

MAX_POWER = 1000  # integer powers beyond it are typing errors
MAX_BITS = 10_000  # of an exact number
MAX_SIZE = 500_000  # operations of one expression when its definitions are written out

_RELATIONS: dict[str, Callable[[Basic, Basic], Basic]] = {
    "<": se.Lt,
    "<=": se.Le,
    ">": se.Gt,
    ">=": se.Ge,
    "==": se.Eq,
    "!=": se.Ne,
}


@dataclass(frozen=True)
class Sized:
    """A value and the number of operations it takes when written out."""

    value: Value
    size: int


class Scope(Protocol):
    """What an expression may name."""

    def lookup(self, name: Name) -> Sized:
        """Return what a name stands for, or raise ExpressionError."""
        ...

    def derivative(self, expression: Basic) -> Basic:
        """Return the total time derivative."""
        ...


def build(tree: Tree, scope: Scope) -> Sized:
    """Turn a tree into a value.

    Raises
    ------
    ExpressionError
        A name, function, shape, number or size that does not fit, at its place.
    """
    builder = _Builder(scope)
    value = builder.value(tree)
    if _is_boolean(value):
        raise ExpressionError(
            "not-a-value",
            "a condition is not a value",
            tree.start,
            tree.end,
            "write if(condition, a, b)",
        )
    return Sized(value, builder.size)


def number(expression: Basic) -> float:
    """Return the value of an expression without symbols.

    Raises
    ------
    ValueError
        It has no real, finite value.
    """
    try:
        value = float(expression.n(53, real=True))
    except RuntimeError:  # SymEngine's word for "not real"
        value = math.nan
    if not math.isfinite(value):
        raise ValueError("not a real, finite number")
    return value


def _is_boolean(value: object) -> bool:
    return isinstance(value, bool) or not isinstance(value, (se.Expr, Tensor))


def _kind(value: Value) -> str:
    return value.kind if isinstance(value, Tensor) else "a scalar"


class _Builder:
    def __init__(self, scope: Scope):
        self.scope = scope
        self.size = 0

    def value(self, tree: Tree) -> Value:
        try:
            return self._dispatch(tree)
        except ShapeError as error:
            raise ExpressionError("shape", str(error), tree.start, tree.end) from None

    def grow(self, by: int, tree: Tree) -> None:
        self.size += by
        if self.size > MAX_SIZE:
            raise ExpressionError(
                "too-large",
                f"the expression takes more than {MAX_SIZE:,} operations when its definitions"
                " are written out",
                tree.start,
                tree.end,
                "let definitions refer to each other less often",
            )

    def _dispatch(self, tree: Tree) -> Value:
        self.grow(1, tree)
        match tree:
            case Number():
                return se.Rational(tree.value.numerator, tree.value.denominator)
            case Name():
                found = self.scope.lookup(tree)
                self.grow(found.size, tree)
                return found.value
            case Sum():
                return self._sum(tree)
            case Product():
                return self._product(tree)
            case Power():
                return self._power(tree)
            case Call():
                return self._call(tree)
            case Vector():
                return self._vector(tree)
            case Comparison():
                return self._comparison(tree)
            case Logical():
                return self._logical(tree)
        raise AssertionError(f"no such tree: {tree!r}")

    def operand(self, tree: Tree) -> Value:
        """Build something that arithmetic can use."""
        value = self.value(tree)
        if _is_boolean(value):
            raise ExpressionError(
                "not-a-value",
                "a condition is not a value",
                tree.start,
                tree.end,
                "write if(condition, a, b)",
            )
        return value

    def scalar(self, tree: Tree, where: str) -> Basic:
        value = self.operand(tree)
        if isinstance(value, Tensor):
            raise ExpressionError(
                "shape", f"{where} must be a scalar, not {value.kind}", tree.start, tree.end
            )
        return value

    def _sum(self, tree: Sum) -> Value:
        values = [(sign, self.operand(term)) for sign, term in tree.terms]
        if not any(isinstance(value, Tensor) for _, value in values):
            return se.Add(*[sign * value for sign, value in values])
        sign, total = values[0]
        if sign < 0 and isinstance(total, Tensor):
            total = total.map(lambda x: -x)
        for (sign, value), (_, term) in zip(values[1:], tree.terms[1:], strict=True):
            if not (isinstance(total, Tensor) and isinstance(value, Tensor)):
                raise ExpressionError(
                    "shape",
                    f"{_kind(total)} and {_kind(value)} cannot be added",
                    term.start,
                    term.end,
                )
            total = tensors.add(total, value, sign)
        return total

    def _product(self, tree: Product) -> Value:
        plain: list[Basic] = []
        tensor: Tensor | None = None
        for exponent, factor in tree.factors:
            value = self.operand(factor)
            if isinstance(value, Tensor):
                if exponent < 0:
                    raise ShapeError(f"cannot divide by {value.kind}")
                tensor = value if tensor is None else tensors.multiply(tensor, value)
            elif exponent > 0:
                plain.append(value)
            else:
                if value == 0:
                    raise ExpressionError(
                        "not-a-number", "division by zero", factor.start, factor.end
                    )
                plain.append(value**-1)
        if tensor is None:
            return self.checked(se.Mul(*plain), tree)
        if not plain:
            return tensor
        scale = se.Mul(*plain)
        return tensor.map(lambda x: scale * x)

    def _power(self, tree: Power) -> Basic:
        base = self.operand(tree.base)
        exponent = self.scalar(tree.exponent, "an exponent")
        if isinstance(base, Tensor):
            raise ExpressionError(
                "shape",
                f"{base.kind} cannot be raised to a power",
                tree.start,
                tree.end,
                "the square of a vector is dot(a, a)",
            )
        self.bound_power(base, exponent, tree)
        return self.checked(base**exponent, tree)

    def bound_power(self, base: Basic, exponent: Basic, tree: Tree) -> None:
        if not isinstance(exponent, (se.Integer, se.Rational)):
            return
        bits = 0
        if isinstance(base, (se.Integer, se.Rational)):
            p, q = base.get_num_den() if isinstance(base, se.Rational) else (base, 1)
            bits = abs(int(p)).bit_length() + int(q).bit_length()
        p, q = exponent.get_num_den() if isinstance(exponent, se.Rational) else (exponent, 1)
        size = abs(int(p))
        if size > MAX_POWER or int(q) > MAX_POWER or bits * size > MAX_BITS:
            raise ExpressionError(
                "too-large",
                "this power is too large to be meant",
                tree.start,
                tree.end,
                f"powers go up to {MAX_POWER}, and numbers up to what a double can hold",
            )
        if base == 0 and int(p) < 0:
            raise ExpressionError("not-a-number", "division by zero", tree.start, tree.end)

    def checked(self, value: Basic, tree: Tree) -> Basic:
        """Refuse a constant that is not a real, finite number."""
        if isinstance(value, (se.Integer, se.Rational, se.Symbol)) or value.free_symbols:
            return value
        try:
            number(value)
        except ValueError:
            raise ExpressionError(
                "not-a-number",
                "this has no real, finite value",
                tree.start,
                tree.end,
                "roots and logarithms need positive arguments, asin and acos arguments in [-1, 1]",
            ) from None
        return value

    def _call(self, tree: Call) -> Value:
        name = tree.function
        if name == "if":
            return self._if(tree)
        if name in _TENSOR_FUNCTIONS:
            return self._tensor_call(tree)
        function = FUNCTIONS.get(name)
        if function is None:
            raise self.unknown_function(tree)
        n = len(tree.arguments)
        if n < function.fewest or (function.most is not None and n > function.most):
            raise self.wrong_count(tree, function.fewest, function.most)
        arguments = [self.scalar(a, f"the argument of {name}") for a in tree.arguments]
        # functions written as cases repeat their arguments
        self.grow(2 * n, tree)
        if name == "pow":
            self.bound_power(arguments[0], arguments[1], tree)
        try:
            value = function.apply(*arguments)
        except RuntimeError:
            value = se.nan
        return self.checked(value, tree)

    def wrong_count(self, tree: Call, fewest: int, most: int | None) -> ExpressionError:
        wanted = f"{fewest}" if most == fewest else f"{fewest} or more"
        if most not in (fewest, None):
            wanted = f"{fewest} or {most}"
        return ExpressionError(
            "wrong-arguments",
            f"`{tree.function}` takes {wanted} argument{'s' if wanted != '1' else ''},"
            f" not {len(tree.arguments)}",
            tree.start,
            tree.end,
        )

    def unknown_function(self, tree: Call) -> ExpressionError:
        name, end = tree.function, tree.start + len(tree.function)
        if name in ("sum", "sum_"):
            return ExpressionError(
                "not-yet",
                "sums over an index are not part of this version",
                tree.start,
                end,
                "write the terms out",
            )
        try:
            self.scope.lookup(Name(tree.start, end, name, 0))
        except ExpressionError:
            pass
        else:
            return ExpressionError(
                "unknown-function",
                f"`{name}` is not a function",
                tree.start,
                end,
                f"write a product as `{name}*(…)`",
            )
        close = nearest(name, [*FUNCTIONS, *_TENSOR_FUNCTIONS, "if"])
        other = {"arcsin": "asin", "arccos": "acos", "arctan": "atan", "ln": "log", "sgn": "sign"}
        if name in other:
            close = [other[name]]
        return ExpressionError(
            "unknown-function",
            f"`{name}` is not a function of the grammar",
            tree.start,
            end,
            "did you mean " + " or ".join(f"`{c}`" for c in close) + "?"
            if close
            else "the functions are listed in docs/model-file.md",
        )

    def _if(self, tree: Call) -> Basic:
        if len(tree.arguments) != 3:
            raise self.wrong_count(tree, 3, 3)
        condition = self.condition(tree.arguments[0])
        when_true = self.scalar(tree.arguments[1], "a case of if()")
        when_false = self.scalar(tree.arguments[2], "a case of if()")
        return cases(condition, when_true, when_false)

    def condition(self, tree: Tree) -> Basic:
        value = self.value(tree)
        if not _is_boolean(value):
            raise ExpressionError(
                "not-a-condition",
                "a condition is missing here",
                tree.start,
                tree.end,
                "compare, as in `x > 0`",
            )
        return value

    def _comparison(self, tree: Comparison) -> Basic:
        values = [self.scalar(operand, "what is compared") for operand in tree.operands]
        pairs = zip(tree.operators, values, values[1:], strict=False)
        return se.And(*[_RELATIONS[o](left, right) for o, left, right in pairs])

    def _logical(self, tree: Logical) -> Basic:
        values = [self.condition(operand) for operand in tree.operands]
        if tree.operator == "not":
            return se.Not(values[0])
        return (se.And if tree.operator == "and" else se.Or)(*values)

    def _vector(self, tree: Vector) -> Tensor:
        values = [self.operand(item) for item in tree.items]
        if not values:
            raise ShapeError("a vector needs entries")
        if not any(isinstance(v, Tensor) for v in values):
            return tensors.vector(*values)
        rows = []
        for value, item in zip(values, tree.items, strict=True):
            if not (isinstance(value, Tensor) and value.is_vector):
                raise ExpressionError(
                    "shape",
                    f"a row of a matrix is a vector, not {_kind(value)}",
                    item.start,
                    item.end,
                )
            rows.append(value.entries)
        if len({len(row) for row in rows}) > 1:
            raise ShapeError("the rows of a matrix must have one length")
        return Tensor(tuple(rows))

    def _tensor_call(self, tree: Call) -> Value:
        name = tree.function
        signature = _TENSOR_FUNCTIONS[name]
        if len(tree.arguments) != len(signature):
            raise self.wrong_count(tree, len(signature), len(signature))
        arguments: list[Value] = []
        for wanted, argument in zip(signature, tree.arguments, strict=True):
            value = self.operand(argument)
            if isinstance(value, Tensor) != (wanted == "tensor"):
                expected = "a scalar" if wanted == "scalar" else "a vector or matrix"
                raise ExpressionError(
                    "shape",
                    f"`{name}` needs {expected} here, not {_kind(value)}",
                    argument.start,
                    argument.end,
                )
            arguments.append(value)
        self.grow(60, tree)
        derivative = self.scope.derivative
        zero, one = se.Integer(0), se.Integer(1)
        axes = {
            "rot_x": tensors.vector(one, zero, zero),
            "rot_y": tensors.vector(zero, one, zero),
            "rot_z": tensors.vector(zero, zero, one),
        }
        match name:
            case "dot":
                return tensors.dot(*arguments)  # type: ignore[arg-type]
            case "cross":
                return tensors.cross(*arguments)  # type: ignore[arg-type]
            case "norm":
                return tensors.norm(*arguments)  # type: ignore[arg-type]
            case "transpose":
                return tensors.transpose(*arguments)  # type: ignore[arg-type]
            case "quat":
                return tensors.quaternion(*arguments)  # type: ignore[arg-type]
            case "omega":
                return tensors.angular_velocity(arguments[0], derivative)  # type: ignore[arg-type]
            case "rot":
                axis, angle = arguments
                if any(derivative(x) != 0 for x in axis.entries):  # type: ignore[union-attr]
                    raise ShapeError("the axis of rot() must be constant")
                return tensors.rotation(axis, angle)  # type: ignore[arg-type]
        return tensors.rotation(axes[name], arguments[0])  # type: ignore[arg-type]


_TENSOR_FUNCTIONS = {
    "dot": ("tensor", "tensor"),
    "cross": ("tensor", "tensor"),
    "norm": ("tensor",),
    "transpose": ("tensor",),
    "omega": ("tensor",),
    "rot_x": ("scalar",),
    "rot_y": ("scalar",),
    "rot_z": ("scalar",),
    "rot": ("tensor", "scalar"),
    "quat": ("scalar", "scalar", "scalar", "scalar"),
}
