"""Construction of SymEngine expressions, vectors and matrices from syntax trees.

No user text reaches an evaluator: names are looked up in a scope, operations are SymEngine's, the
size of each result is bounded, and every constant is checked as soon as it is built.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import symengine as se
from symengine import Basic
from symengine.lib.symengine_wrapper import Boolean

from lagcli.functions import FUNCTIONS
from lagcli.model.diagnostics import MAX_DIAGNOSTICS, Broken
from lagcli.model.expression import tensors
from lagcli.model.expression.algebra import count_operations
from lagcli.model.expression.constants import fault, relation
from lagcli.model.expression.functions import apply
from lagcli.model.expression.tensors import ShapeError, Sized, Tensor, kind_of
from lagcli.model.expression.tokens import ExpressionError, error_at
from lagcli.model.expression.trees import (
    CallExpr,
    Comparison,
    ComponentExpr,
    IndexedSumExpr,
    LogicalExpr,
    Name,
    NumberExpr,
    PowerExpr,
    ProductExpr,
    RateExpr,
    SumExpr,
    Tree,
    VectorExpr,
    walk,
)
from lagcli.model.names.scope import Scope
from lagcli.model.spelling import did_you_mean, nearest

MAX_POWER = 1000  # larger constant exponents are typos
MAX_BITS = 10_000  # size of an exact number
MAX_SIZE = 2_000_000  # operations of one expression with definitions expanded
MAX_TERMS = 100_000  # total number of terms of the indexed sums in one expression
MAX_DEPTH = 200  # nesting depth; SymEngine differentiates recursively


def name_errors(tree: Tree, scope: Scope) -> tuple[list[ExpressionError], bool]:
    """Return the errors in names and calls of a tree, and whether a name is broken.

    The search stops at the maximum number of reported errors.
    """
    errors: list[ExpressionError] = []
    subjects: set[str | int] = set()
    broken = False
    stack = [(tree, scope)]
    while stack and len(subjects) <= MAX_DIAGNOSTICS:
        part, inside = stack.pop()
        try:
            if isinstance(part, Name):
                inside.check(part)
            elif isinstance(part, CallExpr):
                check_call(part, inside)
            elif isinstance(part, IndexedSumExpr):
                outside, inside = inside, inside.check_series(part)
                outside.check_index(part.range)
            elif isinstance(part, ComponentExpr):
                for index in part.indices:
                    inside.check_index(index)
        except ExpressionError as error:
            errors.append(error)
            subjects.add(error.subject or error.start)
            if isinstance(part, IndexedSumExpr):
                continue
        except Broken:
            broken = True
        stack.extend((below, inside) for below in reversed(part.parts))
    return errors, broken


def build(tree: Tree, scope: Scope) -> Sized:
    """Build the value of a syntax tree.

    Raises
    ------
    ExpressionError
        Invalid name, function, shape, number or size, with its source offsets.
    """
    return _ExpressionBuilder(scope).operand(tree)


def _outermost_sums(tree: Tree) -> Iterator[IndexedSumExpr]:
    """Yield the indexed sums of a tree, without those in their terms."""
    stack = [tree]
    while stack:
        top = stack.pop()
        if isinstance(top, IndexedSumExpr):
            yield top
        else:
            stack.extend(reversed(top.parts))


def _is_boolean(value: object) -> bool:
    return isinstance(value, (bool, Boolean))


_NOT_REAL = (
    "roots and logarithms need positive arguments, asin, acos and atanh arguments in [-1, 1],"
    " acosh at least 1"
)


# how often a vector or rotation function repeats its arguments
_COPIES = {"cross": 2, "norm": 2, "rot_x": 4, "rot_y": 4, "rot_z": 4, "rot": 12, "quat": 6}


class _ExpressionBuilder:
    def __init__(self, scope: Scope):
        self.scope = scope
        self.terms = 0  # number of terms of indexed sums
        self.summing = False  # within the term of one

    def any(self, tree: Tree) -> Sized:
        """Build a value or a condition."""
        try:
            match tree:
                case NumberExpr():
                    value = se.Rational(tree.value.numerator, tree.value.denominator)
                    return self.made(tree, value, [])
                case Name():
                    return self.scope.lookup(tree)
                case SumExpr():
                    return self.sum(tree)
                case IndexedSumExpr():
                    return self.series(tree)
                case ProductExpr():
                    return self.product(tree)
                case PowerExpr():
                    return self.power(tree)
                case CallExpr():
                    return self.call(tree)
                case VectorExpr():
                    return self.vector(tree)
                case ComponentExpr():
                    return self.component(tree)
                case RateExpr():
                    return self.rate(tree)
                case Comparison():
                    return self.comparison(tree)
                case LogicalExpr():
                    return self.logical(tree)
        except ShapeError as error:
            raise error_at("shape", str(error), tree, error.help) from None
        except (RuntimeError, ValueError):  # SymEngine's errors for infinite arguments of functions
            raise error_at("not-a-number", "this is undefined", tree, _NOT_REAL) from None
        raise AssertionError(f"no such tree: {tree!r}")

    def made(
        self,
        tree: Tree,
        value: Any,
        parts: Sequence[Sized],
        copies: int = 1,
        levels: int = 0,
        size: int | None = None,
    ) -> Sized:
        """Return a value with its size and depth, or raise ExpressionError.

        The size defaults to that of the copies of all parts; the depth is that of the deepest part
        plus ``levels``.
        """
        if size is None:
            size = 1 + copies * sum(p.size for p in parts)
        depth = levels + max((p.depth for p in parts), default=0)
        if size > MAX_SIZE or depth > MAX_DEPTH:
            raise error_at(
                "too-large",
                f"with its definitions expanded, the expression has more than {MAX_SIZE:,}"
                " operations"
                if size > MAX_SIZE
                else f"with its definitions expanded, the expression is nested more than"
                f" {MAX_DEPTH} functions deep",
                tree,
                "reduce the nesting of definitions",
            )
        constant = all(p.constant for p in parts)
        entries = value.entries if isinstance(value, Tensor) else (value,)
        for entry in entries:
            if isinstance(entry, se.Number) or (constant and not _is_boolean(entry)):
                self.check_constant(entry, tree)
        order = max((p.order for p in parts), default=-1)
        return Sized(value, size, depth, constant, order)

    def check_constant(self, value: Basic, tree: Tree) -> None:
        why = fault(value)
        if why is None:
            return
        help_ = None
        if why == "is not a real number":
            help_ = _NOT_REAL
            if isinstance(tree, PowerExpr) and isinstance(tree.exponent, ProductExpr):
                help_ = "a power of a negative number is real only for whole exponents; cbrt(x) is"
                help_ += " the real cube root"
        raise error_at("not-a-number", f"this {why}", tree, help_)

    def operand(self, tree: Tree) -> Sized:
        """Build an operand of arithmetic: not a condition."""
        built = self.any(tree)
        if _is_boolean(built.value):
            raise error_at(
                "not-a-value", "a condition is not a value", tree, "write if(condition, a, b)"
            )
        return built

    def scalar(self, tree: Tree, where: str) -> Sized:
        built = self.operand(tree)
        if isinstance(built.value, Tensor):
            raise error_at("shape", f"{where} must be a scalar, not {built.value.kind}", tree)
        return built

    # arithmetic

    def sum(self, tree: SumExpr) -> Sized:
        parts = [self.operand(term) for _, term in tree.terms]
        signed = [(sign, part.value) for (sign, _), part in zip(tree.terms, parts, strict=True)]
        if not any(isinstance(value, Tensor) for _, value in signed):
            terms = [value if sign > 0 else -value for sign, value in signed]  # type: ignore[operator]
            return self.made(tree, se.Add(*terms), parts)
        sign, total = signed[0]
        if sign < 0 and isinstance(total, Tensor):
            total = total.map(lambda x: -x)
        for (sign, value), (_, term) in zip(signed[1:], tree.terms[1:], strict=True):
            if not (isinstance(total, Tensor) and isinstance(value, Tensor)):
                raise error_at(
                    "shape",
                    f"{kind_of(total)} and {kind_of(value)} cannot be added",
                    term,
                    "a component is written `A.x` or `A[1]`",
                )
            total = tensors.add(total, value, sign)
        return self.made(tree, total, parts)

    def series(self, tree: IndexedSumExpr) -> Sized:
        outermost = not self.summing
        if outermost:
            self.count_terms(tree)
        self.summing = True
        parts: list[Sized] = []
        term: ExpressionTemplate | None = None
        for _ in self.scope.each(tree):
            term = term or ExpressionTemplate(tree.term, self.scope, self.operand)
            parts.append(term.value())
        self.summing = not outermost
        if not parts:
            return Sized(se.Integer(0), constant=True)
        if not isinstance(parts[0].value, Tensor):
            return self.made(tree, se.Add(*[p.value for p in parts]), parts)
        total = parts[0].value
        for part in parts[1:]:
            total = tensors.add(total, part.value)
        return self.made(tree, total, parts)

    def count_terms(self, tree: IndexedSumExpr) -> None:
        """Count the terms of a sum and of the sums in it, before any of them is built."""
        inner = list(_outermost_sums(tree.term))
        for _ in self.scope.each(tree):
            self.terms += 1
            if self.terms > MAX_TERMS:
                raise error_at(
                    "too-large",
                    f"the sums of this expression have more than {MAX_TERMS:,} terms",
                    tree,
                    "use a recursive definition, such as `s[i = 1..N]: s[i-1] + x[i]`",
                )
            for part in inner:
                self.count_terms(part)

    def product(self, tree: ProductExpr) -> Sized:
        parts = [self.operand(factor) for _, factor in tree.factors]
        plain: list[Basic] = []
        tensor: Tensor | None = None
        size = 0
        for (exponent, factor), part in zip(tree.factors, parts, strict=True):
            value = part.value
            if isinstance(value, Tensor):
                if exponent < 0:
                    raise error_at("shape", f"cannot divide by {value.kind}", factor)
                if tensor is None:
                    tensor, size = value, part.size
                else:
                    # each entry contributes to a whole row or column of the product
                    size = size * value.shape[1] + part.size * tensor.shape[0]
                    tensor = tensors.multiply(tensor, value)
            elif exponent > 0:
                plain.append(value)
            elif value == 0:
                raise error_at("not-a-number", "division by zero", factor)
            else:
                plain.append(value**-1)
        if tensor is None:
            return self.made(tree, se.Mul(*plain), parts, levels=1)
        scale = se.Mul(*plain)
        scaled = tensor.map(lambda x: scale * x) if plain else tensor
        size += len(tensor.entries) * sum(p.size for p in parts if not isinstance(p.value, Tensor))
        return self.made(tree, scaled, parts, levels=1, size=size)

    def power(self, tree: PowerExpr) -> Sized:
        base = self.operand(tree.base)
        exponent = self.scalar(tree.exponent, "an exponent")
        if isinstance(base.value, Tensor):
            raise error_at(
                "shape",
                f"{base.value.kind} cannot be raised to a power",
                tree,
                "the square of a vector is dot(a, a)",
            )
        return self.raised(tree, base, exponent)

    def raised(self, tree: Tree, base: Sized, exponent: Sized) -> Sized:
        to = self.bounded_exponent(base.value, exponent.value, tree)
        if not isinstance(to, se.Number) and isinstance(base.value, (se.Mul, se.Pow)):
            self.scope.mark_nonsmooth()  # SymEngine's derivative divides by the base
        value = se.Pow(base.value, to)
        return self.made(tree, value, [base, exponent], levels=1)

    def bounded_exponent(self, base: Basic, exponent: Basic, tree: Tree) -> Basic:
        """Return the exponent, as a float if exact powers with it would be too large."""
        if not isinstance(exponent, se.Rational):
            # the derivative of a^x is a^x log(a) x'
            if isinstance(base, se.Number) and base <= 0 and self.varies(exponent):
                raise error_at(
                    "not-a-number",
                    f"{base} cannot be raised to a variable power",
                    tree,
                    "a power with a variable exponent needs a positive base",
                )
            return exponent
        p, q = (int(x) for x in exponent.get_num_den())
        factor = base.args[0] if isinstance(base, se.Mul) else base  # (x/3)^2 is x^2/9
        bits = 0
        if isinstance(factor, se.Rational):
            bits = sum(abs(int(x)).bit_length() for x in factor.get_num_den())
        exact = max(abs(p), q) <= MAX_POWER and bits * abs(p) <= MAX_BITS
        if not exact and (q == 1 or abs(p) > MAX_POWER * q):
            raise error_at(
                "too-large",
                "this power is too large",
                tree,
                f"the largest exponent is {MAX_POWER}, the largest number 1.8e308",
            )
        if base == 0 and p < 0:
            raise error_at("not-a-number", "division by zero", tree)
        return exponent if exact else se.RealDouble(p / q)

    def varies(self, value: Basic) -> bool:
        return bool(self.scope.derivative(value) != 0)

    # functions

    def call(self, tree: CallExpr) -> Sized:
        check_call(tree, self.scope)
        name = tree.function
        if name == "if":
            condition = self.condition(tree.arguments[0])
            branches = [self.operand(a) for a in tree.arguments[1:]]
            self.scope.mark_nonsmooth()
            value = tensors.choose(condition.value, *(b.value for b in branches))
            copies = len(value.entries) if isinstance(value, Tensor) else 1
            return self.made(tree, value, [condition, *branches], copies, levels=1)
        if name in TENSOR_FUNCTIONS:
            return self.tensor_call(tree)
        arguments = [self.scalar(a, f"the argument of {name}") for a in tree.arguments]
        if name == "pow":
            return self.raised(tree, *arguments)
        function = FUNCTIONS[name]
        value = apply(name, *(a.value for a in arguments))
        if function.opaque or not function.smooth:
            self.scope.mark_nonsmooth()
        copies = function.copies(len(arguments))
        return self.made(tree, value, arguments, copies, levels=copies.bit_length())

    def tensor_call(self, tree: CallExpr) -> Sized:
        name = tree.function
        arguments: list[Sized] = []
        for wanted, argument in zip(TENSOR_FUNCTIONS[name], tree.arguments, strict=True):
            built = self.operand(argument)
            if isinstance(built.value, Tensor) != (wanted == "tensor"):
                expected = "a scalar" if wanted == "scalar" else "a vector or matrix"
                raise error_at(
                    "shape",
                    f"`{name}` needs {expected} here, not {kind_of(built.value)}",
                    argument,
                )
            arguments.append(built)
        order = max(a.order for a in arguments)
        if name == "omega" and order >= 0:
            order += 1
            self.scope.check_order(tree, order)
        value = tensor_call(name, [a.value for a in arguments], self.scope)
        if name == "omega":  # the size depends on the kinds of rotations
            levels = 2 + len(arguments[0].value.factors)
            size = count_operations(value.entries)
            made = self.made(tree, value, arguments, levels=levels, size=size)
            return made._replace(order=order)
        return self.made(tree, value, arguments, _COPIES.get(name, 1), levels=2)

    def component(self, tree: ComponentExpr) -> Sized:
        base = self.operand(tree.base)
        if not isinstance(base.value, Tensor):
            raise error_at(
                "shape",
                "a scalar has no components",
                tree,
                "a vector is written `[a, b, c]`",
            )
        indices = tuple(map(self.scope.index, tree.indices))
        value = tensors.component(base.value, tree.key, indices)
        size = max(1, base.size // len(base.value.entries))
        if tree.key.isdigit():
            size = count_operations([value])
        return self.made(tree, value, [base], size=size)

    def rate(self, tree: RateExpr) -> Sized:
        built = self.operand(tree.operand)
        value, size, order = built.value, built.size, built.order
        if order >= 0:
            order += tree.order
            self.scope.check_order(tree, order)
        for _ in range(tree.order):
            derivative = self.scope.derivative
            value = value.map(derivative) if isinstance(value, Tensor) else derivative(value)
            size *= 3  # estimate for the product rule
        made = self.made(tree, value, [built], levels=2 * tree.order, size=size)
        return made._replace(order=order)

    # conditions

    def condition(self, tree: Tree) -> Sized:
        built = self.any(tree)
        if not _is_boolean(built.value):
            raise error_at(
                "not-a-condition", "expected a condition", tree, "write a comparison, as in `x > 0`"
            )
        return built

    def comparison(self, tree: Comparison) -> Sized:
        parts = [self.scalar(operand, "an operand of a comparison") for operand in tree.operands]
        pairs = zip(tree.operators, parts, parts[1:], strict=False)
        value = se.And(*[relation(sign, a.value, b.value) for sign, a, b in pairs])
        return self.made(tree, value, parts, copies=2)

    def logical(self, tree: LogicalExpr) -> Sized:
        parts = [self.condition(operand) for operand in tree.operands]
        values = [p.value for p in parts]
        if tree.operator == "not":
            return self.made(tree, se.Not(*values), parts)
        value = (se.And if tree.operator == "and" else se.Or)(*values)
        return self.made(tree, value, parts)

    # vectors

    def vector(self, tree: VectorExpr) -> Sized:
        parts = [self.operand(item) for item in tree.items]
        if not parts:
            raise ShapeError("a vector needs entries")
        if not any(isinstance(p.value, Tensor) for p in parts):
            return self.made(tree, tensors.vector(*(p.value for p in parts)), parts)
        rows: list[tuple[Basic, ...]] = []
        for part, item in zip(parts, tree.items, strict=True):
            if not (isinstance(part.value, Tensor) and part.value.is_vector):
                raise error_at(
                    "shape", f"a row of a matrix is a vector, not {kind_of(part.value)}", item
                )
            rows.append(part.value.entries)
        if len({len(row) for row in rows}) > 1:
            raise ShapeError("the rows of a matrix must have equal length")
        return self.made(tree, Tensor(tuple(rows)), parts)


class ExpressionTemplate:
    """Expression tree whose values are obtained by renaming symbols where possible.

    Parameters
    ----------
    tree : Tree
    scope : Scope
        Provides the current values of the indices.
    build : callable
        Builds the tree with these values.
    """

    def __init__(self, tree: Tree, scope: Scope, build: Callable[[Tree], Sized]):
        self.tree, self.scope, self.build = tree, scope, build
        parts = list(walk(tree))
        self.members = [p for p in parts if isinstance(p, Name) and p.indices]
        # if an index is used as a number, each value gives a different expression
        self.renamable = not any(
            isinstance(p, IndexedSumExpr)
            or (isinstance(p, ComponentExpr) and p.indices)
            or (isinstance(p, Name) and scope.has_value(p.text))
            for p in parts
        )
        self.others = [p for p in parts if isinstance(p, Name) and not p.indices]
        self.order = 2  # of the highest derivative of a coordinate
        self.first: tuple[list[Basic], Sized] | None = None

    def value(self) -> Sized:
        """Return the value for the current index values."""
        symbols = self._symbols() if self.renamable else None
        if symbols is None:
            return self.build(self.tree)
        if self.first is not None:
            names = _renaming(self.first[0], symbols)
            if names is not None:
                return _renamed(self.first[1], names)
        built = self.build(self.tree)
        if isinstance(built.value, Tensor) and built.value.factors:  # of a rotation
            return built
        self.order = built.order
        symbols = self._symbols() or []
        if self._others_contain(symbols):
            self.renamable = False
        else:
            self.first = symbols, built
        return built

    def _symbols(self) -> list[Basic] | None:
        symbols: list[Basic] = []
        for name in self.members:
            own = self.scope.symbols(name, self.order)
            if own is None:
                return None
            symbols += own
        return symbols

    def _others_contain(self, symbols: list[Basic]) -> bool:
        """Whether a name without index, such as a definition, contains symbols of members."""
        values = [self.scope.lookup(name).value for name in self.others]
        entries = [x for v in values for x in (v.entries if isinstance(v, Tensor) else (v,))]
        return any(not x.free_symbols.isdisjoint(symbols) for x in entries)


def _renaming(old: Sequence[Basic], new: Sequence[Basic]) -> dict[Basic, Basic] | None:
    """Return the mapping from old to new symbols; None if it is not one-to-one."""
    names: dict[Basic, Basic] = {}
    for a, b in zip(old, new, strict=True):
        if names.setdefault(a, b) != b:
            return None
    return names if len(set(names.values())) == len(names) else None


def _renamed(sized: Sized, names: dict[Basic, Basic]) -> Sized:
    value = sized.value
    if isinstance(value, Tensor):
        return sized._replace(value=value.map(lambda x: x.xreplace(names)))
    return sized._replace(value=value.xreplace(names))


TENSOR_FUNCTIONS: dict[str, tuple[str, ...]] = {
    "dot": ("tensor", "tensor"),
    "cross": ("tensor", "tensor"),
    "norm": ("tensor",),
    "transpose": ("tensor",),
    "omega": ("tensor",),
    "axial": ("tensor",),
    "rot_x": ("scalar",),
    "rot_y": ("scalar",),
    "rot_z": ("scalar",),
    "rot": ("tensor", "scalar"),
    "diag": ("scalar", "scalar", "scalar"),
    "quat": ("scalar", "scalar", "scalar", "scalar"),
}

_OTHER_NAMES = {
    **{alias: name for name, f in FUNCTIONS.items() for alias in f.aliases},
    **{"piecewise": "if", "where": "if"},
}
_ZERO, _ONE = se.Integer(0), se.Integer(1)
_AXES = {
    "rot_x": tensors.vector(_ONE, _ZERO, _ZERO),
    "rot_y": tensors.vector(_ZERO, _ONE, _ZERO),
    "rot_z": tensors.vector(_ZERO, _ZERO, _ONE),
}


def check_call(tree: CallExpr, scope: Scope) -> None:
    """Raise ExpressionError for an unknown function or a wrong number of arguments."""
    name, count = tree.function, len(tree.arguments)
    fewest: int
    most: int | None
    if name == "if":
        fewest = most = 3
    elif name in TENSOR_FUNCTIONS:
        fewest = most = len(TENSOR_FUNCTIONS[name])
    elif name in FUNCTIONS:
        fewest, most = FUNCTIONS[name].fewest, FUNCTIONS[name].most
    else:
        raise _unknown(tree, scope)
    if count < fewest or (most is not None and count > most):
        wanted = f"{fewest}" if most == fewest else f"{fewest} or more"
        if most not in (fewest, None):
            wanted = f"{fewest} or {most}"
        raise error_at(
            "wrong-arguments",
            f"`{name}` takes {wanted} argument{'s' if wanted != '1' else ''}, not {count}",
            tree,
            _count_help(tree),
        )


def _count_help(tree: CallExpr) -> str | None:
    """Return a remedy for a wrong number of arguments."""
    if tree.function == "if":
        return "write if(condition, a, b)"
    first = tree.arguments[0] if len(tree.arguments) == 1 else None
    if tree.function == "quat" and isinstance(first, Name):
        name = first.text
        return (
            f"a quaternion coordinate is a rotation already: write `{name}` if `{name}` is one;"
            " else name the four components"
        )
    return None


def _unknown(tree: CallExpr, scope: Scope) -> ExpressionError:
    name, end = tree.function, tree.start + len(tree.function)
    if scope.declared(name):
        message, help_ = f"`{name}` is not a function", f"write a product as `{name}*(…)`"
    elif name in _OTHER_NAMES:
        message = f"there is no function `{name}`"
        help_ = f"write it with `{name_of(name)}`"
    else:
        message = f"there is no function `{name}`"
        close = nearest(name, [*FUNCTIONS, *TENSOR_FUNCTIONS, *scope.functions, "body", "if"])
        help_ = did_you_mean(close) or "the functions are listed in docs/model-file.md"
    return ExpressionError("unknown-function", message, tree.start, end, help_, f"{name}()")


def name_of(name: str) -> str:
    """Return lagcli's name of a function that other programs call differently."""
    return _OTHER_NAMES.get(name, name)


def tensor_call(name: str, arguments: list[Basic | Tensor], scope: Scope) -> Basic | Tensor:
    """Apply a vector or rotation function to arguments of the right kinds.

    Raises
    ------
    ShapeError
        The shapes do not fit.
    """
    a, *rest = arguments
    match name:
        case "dot":
            return tensors.dot(a, *rest)
        case "cross":
            return tensors.cross(a, *rest)
        case "norm":
            return tensors.norm(a)
        case "axial":
            return tensors.axial(a)
        case "transpose":
            return tensors.transpose(a)
        case "quat":
            return tensors.quaternion(a, *rest)
        case "diag":
            return tensors.diagonal(a, *rest)
        case "omega":
            return tensors.angular_velocity(a, scope.derivative)
        case "rot":
            if any(scope.derivative(x) != 0 for x in a.entries):
                raise ShapeError("the axis of rot() must be constant")
            return tensors.rotation(a, *rest)
    return tensors.rotation(_AXES[name], a)
