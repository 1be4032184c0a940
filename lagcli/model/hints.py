"""Hints: what is probably meant otherwise in a model that has no error."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from fractions import Fraction
from itertools import product
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.errors import SourceLocation
from lagcli.model.expression.dimension import MASS
from lagcli.model.expression.trees import (
    CallExpr,
    IndexedSumExpr,
    Name,
    NumberExpr,
    PowerExpr,
    ProductExpr,
    SumExpr,
    Tree,
    walk,
)
from lagcli.model.expression.units import read_unit
from lagcli.model.locations import ExpressionLocations
from lagcli.model.model import InitialValue, Model, Parameter
from lagcli.model.names.members import family_of

_TURN = 2 * math.pi
_PERIODIC = (se.sin, se.cos, se.tan)
#: Largest number of terms of an energy that is examined.
_MOST = 200
#: Names of masses, where parameters have no units.
_MASS = r"[mM](?:ass)?(?:_?[0-9A-Z]\w*|_\w+)?"


class Hint(NamedTuple):
    """What is probably meant otherwise.

    Parameters
    ----------
    message : str
    location : SourceLocation or None
    """

    message: str
    location: SourceLocation | None

    def __str__(self) -> str:
        where = "" if self.location is None else f"{self.location.with_line}: "
        return where + self.message


def hints(model: Model) -> tuple[Hint, ...]:
    """Return the hints on a model, in the order of the file's keys.

    Parameters
    ----------
    model : Model

    Returns
    -------
    tuple of Hint
        Angles that start beyond a turn without a unit, and kinetic energies without their 1/2.
    """
    return (*_doubled_masses(model), *_angles_in_degrees(model))


# angles


def _angles_in_degrees(model: Model) -> Iterator[Hint]:
    """Yield a hint for each angle whose start is a bare number beyond a turn."""
    large: dict[str, tuple[InitialValue, str]] = {}
    for name, start in model.initial_positions.items():
        if abs(start.value) > _TURN and start.unit is None and (text := _bare(model, start)):
            large[name] = start, text
    if not large:
        return
    units = {c.name: c.unit for c in model.coordinates}
    inside, outside = _symbols(_expressions_of(model))
    seen: set[SourceLocation | None] = set()
    for name, (start, text) in large.items():
        unit = units.get(name)
        if unit is not None and read_unit(unit).dimension._replace(rad=0) != _NUMBER:
            continue
        if name in inside - outside and (start.location is None or start.location not in seen):
            seen.add(start.location)
            yield Hint(
                f"`{name}` starts at {text} rad, {abs(start.value) / _TURN:.2g} turns; an angle in"
                f" degrees is written `{text} deg`",
                start.location,
            )


_NUMBER = read_unit("1").dimension


def _bare(model: Model, start: InitialValue) -> str | None:
    """Return the number of a value that is one, or a parameter without a unit that is one."""
    tree = None if start.written is None else start.written.tree
    if isinstance(tree, Name):
        parameter = model.parameters.get(tree.text)
        if parameter is None or parameter.unit is not None or not _is_literal(parameter):
            return None
        return f"{start.value:.15g}"
    return f"{start.value:.15g}" if tree is not None and _is_number(tree) else None


def _is_number(tree: Tree) -> bool:
    if isinstance(tree, SumExpr) and len(tree.terms) == 1:
        tree = tree.terms[0][1]
    return isinstance(tree, NumberExpr)


def _is_literal(parameter: Parameter) -> bool:
    """Whether the value of a parameter is a number, and no expression of others."""
    return parameter.written is None or _is_number(parameter.written.tree)


def _expressions_of(model: Model) -> Iterator[Basic]:
    """Yield the expressions that determine the motion."""
    yield from (x for x in (model.kinetic, model.potential, model.dissipation) if x is not None)
    yield from model.applied_forces.values()
    yield from (c.expression for c in model.constraints)


def _symbols(expressions: Iterable[Basic]) -> tuple[set[str], set[str]]:
    """Return the names that are angles within sines and cosines, and those elsewhere.

    In ``cos(k*x)`` and ``sin(x/R)``, x is no angle.
    """
    inside: set[str] = set()
    outside: set[str] = set()
    known: set[Basic] = set()
    stack = list(expressions)
    while stack:
        part = stack.pop()
        if part in known:
            continue
        known.add(part)
        if isinstance(part, se.Symbol):
            outside.add(part.name)
        elif isinstance(part, _PERIODIC):
            argument = part.args[0]
            for symbol in argument.free_symbols:
                angle = isinstance(argument.diff(symbol), se.Number)
                (inside if angle else outside).add(symbol.name)
        else:
            stack += [x for x in getattr(part, "args", ()) if isinstance(x, Basic)]
    return inside, outside


# kinetic energy


class _Term(NamedTuple):
    """A product: a number, and factors that are no numbers; and how often a sum repeats it."""

    factor: Fraction
    parts: tuple[Tree, ...]
    repeated: bool = False


class _TooLong(Exception):
    """An energy has more terms than are examined."""


def _doubled_masses(model: Model) -> Iterator[Hint]:
    """Yield a hint if T gives masses the inertia 2 m, and nothing explains the 2.

    Each term with the mass has the factor 1 beside the square of a velocity, and there are several
    squares: of one alone, the inertia 2 m may be that of a hoop that rolls. A potential energy with
    2 m, as of two masses that move together, explains it.
    """
    key = "L" if model.kinetic is None else "T"
    reader = _Energies(model)
    try:
        terms = list(reader.terms(model.trees[key]))
        others = list(reader.terms(model.trees["V"])) if "V" in model.trees else []
    except _TooLong:
        return
    moving = [term for term in terms if any(map(reader.has_rate, term.parts))]
    others += [term for term in terms if not any(map(reader.has_rate, term.parts))]
    squares: dict[str, int] = {}
    right: set[str] = set()
    for term in moving:
        for mass in reader.masses(term):
            found = reader.squares(term)
            if term.factor == 1 and found:
                squares[mass] = squares.get(mass, 0) + found
            else:
                right.add(mass)
    explained = {m for x in others if not x.factor % 2 for m in reader.masses(x)}
    doubled = [x for x in squares if x not in right and x not in explained]
    whole = not right and sum(squares[x] for x in doubled) > 1
    doubled = [x for x in doubled if squares[x] > 1 or whole]
    if doubled:
        name = doubled[0].removesuffix("[]")
        node = ExpressionLocations(model).entry(key)
        yield Hint(
            f"`{key}` gives `{name}` the inertia 2 {name}; the kinetic energy of a mass {name} is"
            f" {name}/2 times its squared velocity",
            None if node is None else node.location,
        )


class _Energies:
    """Reads the terms of energies as they are written, with their definitions."""

    def __init__(self, model: Model):
        self.model = model
        self.families = {family_of(name): p for name, p in model.parameters.items()}
        self.rates: dict[str, bool] = {}

    def terms(self, tree: Tree) -> list[_Term]:
        """Return the terms of an expression, multiplied out."""
        match tree:
            case NumberExpr():
                return [_Term(tree.value, ())]
            case SumExpr():
                found = [
                    x._replace(factor=sign * x.factor)
                    for sign, term in tree.terms
                    for x in self.terms(term)
                ]
            case IndexedSumExpr():
                found = [x._replace(repeated=True) for x in self.terms(tree.term)]
            case ProductExpr():
                found = self._product(tree)
            case Name() if (inner := self._definition(tree)) is not None:
                found = self.terms(inner)
            case _:
                return [_Term(Fraction(1), (tree,))]
        if len(found) > _MOST:
            raise _TooLong
        return found

    def _product(self, tree: ProductExpr) -> list[_Term]:
        found = [_Term(Fraction(1), ())]
        for exponent, factor in tree.factors:
            if exponent < 0:
                number = _value(factor)
                inverse = number is None or not number
                by = [_Term(Fraction(1), (factor,) * inverse)]
                if number:
                    by = [_Term(1 / number, ())]
            else:
                by = self.terms(factor)
            if len(found) * len(by) > _MOST:
                raise _TooLong
            found = [
                _Term(a.factor * b.factor, a.parts + b.parts, a.repeated or b.repeated)
                for a, b in product(found, by)
            ]
        return found

    def _definition(self, name: Name) -> Tree | None:
        if name.primes or name.indices:
            return None
        return self.model.trees.get(f"definitions.{name.text}")

    def masses(self, term: _Term) -> list[str]:
        """Return the parameters among the factors of a term that are masses."""
        return [x.text for x in term.parts if isinstance(x, Name) and self._is_mass(x)]

    def _is_mass(self, name: Name) -> bool:
        parameter = self.families.get(name.text)
        if name.primes or parameter is None or not _is_literal(parameter):
            return False
        if parameter.unit is not None:
            return read_unit(parameter.unit).dimension == MASS
        return re.fullmatch(_MASS, name.text.removesuffix("[]")) is not None

    def squares(self, term: _Term) -> int:
        """Return the number of squares of velocities in a term."""
        count = sum(map(self._squares, term.parts))
        return 2 * count if term.repeated else count

    def _squares(self, part: Tree) -> int:
        if isinstance(part, CallExpr) and part.function == "dot":
            return 2 if all(map(self.has_rate, part.arguments)) else 0
        if isinstance(part, PowerExpr) and _value(part.exponent) == 2 and self.has_rate(part.base):
            whole = isinstance(part.base, CallExpr) and part.base.function == "norm"
            return 2 if whole else 1
        return 0

    def has_rate(self, tree: Tree) -> bool:
        """Whether an expression contains a velocity."""
        return any(isinstance(x, Name) and self._is_rate(x) for x in walk(tree))

    def _is_rate(self, name: Name) -> bool:
        if self.model.names.resolve(name)[1]:
            return True
        inner = self._definition(name)
        if inner is None:
            return False
        if name.text not in self.rates:
            self.rates[name.text] = False
            self.rates[name.text] = self.has_rate(inner)
        return self.rates[name.text]


def _value(tree: Tree) -> Fraction | None:
    return tree.value if isinstance(tree, NumberExpr) else None
