"""Names of family members, and their formatting in messages."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import groupby
from typing import Any, NamedTuple

from lagcli.model.expression.tokens import ExpressionError, error_at
from lagcli.model.expression.trees import (
    CallExpr,
    Name,
    NumberExpr,
    PowerExpr,
    ProductExpr,
    Range,
    SumExpr,
    Tree,
    walk,
)

_INDEX = re.compile(r"\[(-?\d+)(?:,(-?\d+))?\]")
_OPEN = re.compile(r"\[,?\]")


def with_indices(family: str, indices: Iterable[int]) -> str:
    """Return the name of a member: ``Qc.rod[].x[,]`` with 2, 3, 4 is ``Qc.rod[2].x[3,4]``."""
    values = iter(indices)

    def closed(match: re.Match[str]) -> str:
        return f"[{','.join(str(next(values)) for _ in range(len(match[0]) - 1))}]"

    return _OPEN.sub(closed, family)


def indices_of(member: str) -> tuple[int, ...]:
    """Return the indices in a member's name, empty for other names: 3 of ``r[3].x``."""
    match = _INDEX.search(member)
    return tuple(int(k) for k in match.groups() if k is not None) if match else ()


def family_of(member: str) -> str:
    """Return the name of a member's family: ``x[]``, ``r[].x``, ``u[,]``; other names unchanged."""
    if "[" not in member:
        return member
    return _INDEX.sub(lambda match: "[]" if match[2] is None else "[,]", member)


def format_members(base: str, members: Sequence[str]) -> str:
    """Return the members of a family as ranges: x[0], x[1..20]; u[1..3, 1..5]."""
    indices = sorted({indices_of(member) for member in members} - {()})
    if indices and len(indices[0]) > 1:
        spans = [sorted(set(column)) for column in zip(*indices, strict=False)]
        inside = ", ".join(f"{s[0]}..{s[-1]}" if len(s) > 1 else f"{s[0]}" for s in spans)
        return f"`{base}[{inside}]`"
    places = enumerate(k for (k,) in indices)
    runs = [[k for _, k in run] for _, run in groupby(places, lambda x: x[1] - x[0])]
    shown = [
        f"`{base}[{run[0]}]`" if len(run) == 1 else f"`{base}[{run[0]}..{run[-1]}]`"
        for run in runs[:4]
    ]
    return ", ".join(shown) + (", …" if len(runs) > 4 else "")


def families(names: Iterable[str]) -> list[str]:
    """Return names, with members of a family as x[1..20]."""
    members: dict[str, list[str]] = {}
    for name in names:
        members.setdefault(family_of(name), []).append(name)
    return [
        format_members(family.removesuffix("[]"), listed).replace("`", "")
        if family.endswith("[]")
        else family
        for family, listed in members.items()
    ]


def split_names(text: str) -> list[str]:
    """Return the names of a list with commas; those in brackets belong to a name: ``u[1,2]``."""
    return [x.strip() for x in re.split(r",(?![^\[]*\])", text)]


def members_clause(base: str, members: Sequence[str]) -> str:
    """Return a clause that lists the members of a family."""
    return (
        f"there is only {format_members(base, members)}"
        if members
        else f"the family `{base}` is empty"
    )


def descending(tree: Range, span: range) -> ExpressionError:
    """Return the error for a range that ends before it starts."""
    return error_at(
        "bad-range",
        f"the range {span.start}..{span.stop - 1} is descending",
        tree,
        "write ranges in ascending order: first..last",
    )


MAX_MEMBERS = 10_000  # of one range; a chain of 5000 bodies needs no more
_LARGEST = 10**9  # of an index; larger ones are typing errors

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "floor": math.floor,
    "ceil": math.ceil,
    "min": min,
    "max": max,
    "abs": abs,
}


class IndexEvaluator(NamedTuple):
    """Evaluator of indices and ranges.

    Parameters
    ----------
    values : mapping of str to int
        Values of the indices in scope.
    parameter : callable
        Returns the value of an integer parameter; raises ExpressionError for other names.
    """

    values: Mapping[str, int]
    parameter: Callable[[Name], int]

    def at(self, tree: Tree) -> int:
        """Return the value of an index.

        Raises
        ------
        ExpressionError
            It is not an integer, or contains something that is not allowed in an index.
        """
        value = self._value(tree)
        if not isinstance(value, int):
            if value != int(value):
                raise _error(tree, f"an index is a whole number, not {float(value):g}")
            value = int(value)
        if abs(value) > _LARGEST:
            raise _error(tree, "this index is too large")
        return value

    def range(self, tree: Range) -> range:
        """Return the indices of a range, both ends included; ``1..0`` is empty.

        Raises
        ------
        ExpressionError
            As `at`, and for a range that is too long.
        """
        first, last = self.at(tree.first), self.at(tree.last)
        if last - first >= MAX_MEMBERS:
            raise _error(
                tree,
                f"the range {first}..{last} is too long",
                f"a range has at most {MAX_MEMBERS:,} members",
                "too-large",
            )
        return range(first, last + 1)

    def _value(self, tree: Tree) -> Any:
        match tree:
            case Name():
                if tree.text in self.values:
                    return self.values[tree.text]
                if tree.text == "pi":
                    return math.pi
                return self.parameter(tree)
            case NumberExpr():
                value = tree.value
                return value.numerator if value.denominator == 1 else value
            case SumExpr():
                return sum(sign * self._value(term) for sign, term in tree.terms)
            case ProductExpr():
                return self._product(tree)
            case PowerExpr():
                base, exponent = self._value(tree.base), self.at(tree.exponent)
                if not 0 <= exponent <= 60 or abs(base) > _LARGEST:
                    raise _error(tree, "this power is not a valid index")
                return base**exponent
            case CallExpr() if tree.function in _FUNCTIONS:
                arguments = [self._value(a) for a in tree.arguments]
                single = tree.function in ("floor", "ceil", "abs")
                if not arguments or (single and len(arguments) > 1):
                    raise _error(tree, f"wrong number of arguments for `{tree.function}`")
                function = _FUNCTIONS[tree.function]
                return function(*arguments) if single else function(arguments)
        raise _not_whole(tree)

    def _product(self, tree: ProductExpr) -> Any:
        result: Any = 1
        for exponent, factor in tree.factors:
            value = self._value(factor)
            if exponent < 0 and value == 0:
                raise _error(factor, "division by zero", kind="not-a-number")
            if exponent > 0:
                result = result * value
            else:
                result = (Fraction(result) if isinstance(result, int) else result) / value
            if abs(result) > _LARGEST**2:
                raise _error(tree, "this index is too large")
        return result


def names_in(tree: Tree) -> Iterator[Name]:
    """Yield the names used in an index or a range."""
    for root in (tree.first, tree.last) if isinstance(tree, Range) else (tree,):
        for part in walk(root):
            if isinstance(part, Name):
                yield part


def form_errors(tree: Tree) -> Iterator[ExpressionError]:
    """Yield the errors of an index or a range that do not depend on values."""
    for root in (tree.first, tree.last) if isinstance(tree, Range) else (tree,):
        for part in walk(root):
            good = isinstance(part, (NumberExpr, Name, SumExpr, ProductExpr, PowerExpr)) or (
                isinstance(part, CallExpr) and part.function in _FUNCTIONS
            )
            if not good:
                yield _not_whole(part)
                break


def _not_whole(tree: Tree) -> ExpressionError:
    return _error(
        tree,
        "this is not allowed in an index",
        "an index may use whole numbers, pi, + - * / ^, floor, ceil, min, max and abs",
    )


def _error(
    tree: Tree, message: str, help_: str | None = None, kind: str = "bad-index"
) -> ExpressionError:
    return ExpressionError(kind, message, tree.start, tree.end, help_)
