"""The names that a model declares."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import symengine as se
from symengine import Basic

from lagcli.errors import SourceLocation
from lagcli.model import model as symbols
from lagcli.model.expression.functions import derivative
from lagcli.model.expression.trees import Name
from lagcli.model.names.scoping import Sized

DOTS = (("_ddot", 2), ("_dot", 1))
#: The symbols of a coordinate and of its derivatives, by their number of dots.
MOTION = (symbols.coordinate, symbols.velocity, symbols.acceleration)


@dataclass(frozen=True)
class Context:
    """Where an expression stands, and what may be named there."""

    where: str
    coordinates: bool = True
    accelerations: bool = False
    multipliers: bool = False
    definitions: bool = True
    time: bool = True


@dataclass
class Symbols:
    """All names that a model declares.

    Parameters
    ----------
    coordinates, constraints : dicts with str keys
        The members of families among them: ``x[1]``.
    parameters, definitions : mappings of str to callables
        What each stands for; the callables raise Broken for one that has an error of its own.
    constants : mapping of str to callables
        The values of the parameters, for indices.
    families : dict of str to set of str
        The names with members, as ``x[]``, and what the members are: coordinate, definition.
    constraint_families : set of str
        Those of the constraints.
    lines : mapping of str to (str, int)
        What each name is, and the line that declares it.
    places : dict of str to SourceLocation
        Where each name is declared first.
    broken : set of str
        Names whose declaration is in error: what uses them is not in error for it.
    suspects : set of str
        Words that may have been meant as names, likewise.
    structural : set of str
        Parameters that have been used in an index or a range.
    incomplete : bool
        Whether a block of declarations cannot be read, so that any name may have been meant.
    smooth : bool
        Whether no expression uses a function with kinks or jumps.
    """

    coordinates: dict[str, None] = field(default_factory=dict)
    constraints: dict[str, None] = field(default_factory=dict)
    parameters: Mapping[str, Callable[[], Basic]] = field(default_factory=dict)
    definitions: Mapping[str, Callable[[], Sized]] = field(default_factory=dict)
    constants: Mapping[str, Callable[[], Basic]] = field(default_factory=dict)
    families: dict[str, set[str]] = field(default_factory=dict)
    constraint_families: set[str] = field(default_factory=set)
    lines: dict[str, tuple[str, int]] = field(default_factory=dict)
    places: dict[str, SourceLocation] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)
    suspects: set[str] = field(default_factory=set)
    structural: set[str] = field(default_factory=set)
    incomplete: bool = False
    smooth: bool = True
    rates: dict[Basic, Basic] = field(default_factory=dict, init=False, repr=False)

    def declared(self, text: str) -> bool:
        """Whether a name is declared, or a family."""
        return (
            text in self.coordinates
            or text in self.parameters
            or text in self.definitions
            or text in self.families
        )

    def resolve(self, name: Name) -> tuple[str, int]:
        """Return a name without its dots, and their number: ``x_dot`` is ``x'`` unless declared."""
        if not self.declared(name.text):
            stem = name.text.removesuffix("[]")
            brackets = name.text[len(stem) :]
            for suffix, order in DOTS:
                base = stem.removesuffix(suffix)
                if base != stem and (self.declared(base + brackets) or base in self.suspects):
                    return base + brackets, name.primes + order
        return name.text, name.primes

    def members(self, base: str) -> list[str]:
        """Return the members of a family."""
        start = f"{base}["
        every = (*self.coordinates, *self.definitions, *self.parameters)
        return [name for name in every if name.startswith(start)]

    def slope(self, expression: Basic, symbol: Basic) -> Basic:
        """Return ∂expression/∂symbol."""
        return expression.diff(symbol) if self.smooth else derivative(expression, symbol)

    def derivative(self, expression: Basic) -> Basic:
        """Return the total time derivative of an expression in q, q' and t."""
        terms = []
        for term in expression.args if isinstance(expression, se.Add) else (expression,):
            rate = self.rates.get(term)
            if rate is None:
                rate = self.rates[term] = self._rate(term)
            terms.append(rate)
        return se.Add(*terms)

    def _rate(self, term: Basic) -> Basic:
        parts = []
        for symbol in term.free_symbols:
            if symbol == symbols.TIME:
                parts.append(self.slope(term, symbol))
                continue
            name = symbol.name.rstrip("'")
            if name in self.coordinates:
                order = len(symbol.name) - len(name)
                parts.append(self.slope(term, symbol) * MOTION[order + 1](name))
        return se.Add(*parts)
