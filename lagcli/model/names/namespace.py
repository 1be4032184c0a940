"""Namespace of a model: the names that it declares, and their meanings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.errors import SourceLocation
from lagcli.model import model as symbols
from lagcli.model.expression.functions import derivative
from lagcli.model.expression.tensors import Sized
from lagcli.model.expression.trees import Name, Tree

DOTS = (("_ddot", 2), ("_dot", 1))


def motion(name: str, order: int) -> Basic:
    """Return the symbol of a coordinate's derivative: q, q', q'', …"""
    return se.Symbol(name + "'" * order)


class Allowed(IntEnum):
    """Kinds of names that an expression may use; each includes those before it."""

    NUMBERS = 0
    """Parameters, represented by their values."""
    PARAMETERS = 1
    """Parameters, represented by their symbols."""
    MOTION = 2
    """Coordinates, velocities, definitions, inputs and time."""
    MULTIPLIERS = 3
    """Multipliers and constraint forces."""
    ACCELERATIONS = 4
    """Accelerations."""


class Macro(NamedTuple):
    """A function.

    Parameters
    ----------
    arguments : tuple of str
    tree : Tree or None
        Its expression; None if that has an error.
    calls : int
        Number of calls that have been expanded in it.
    """

    arguments: tuple[str, ...]
    tree: Tree | None
    calls: int = 0


@dataclass(eq=False)
class Namespace:
    """The declared names of a model.

    While a model is loaded, its sections add the names that they declare; the loaded model keeps it
    for expressions that are given later, such as measures of sweeps.

    Parameters
    ----------
    coordinates, constraints : dicts with str keys
        Names in declaration order, including members of families: ``x[1]``.
    parameters, definitions : mappings of str to callables
        Functions that return the value of a name, or raise Broken if its declaration is in error.
    constants : mapping of str to callables
        Functions that return the numeric value of a parameter, for indices and other places that
        need a number.
    families : dict of str to set of str
        Names of families, as ``x[]``, and the kinds of their members: coordinate, definition.
    broken_constraints : set of str
        Constraints that have an error, so that their components are not known.
    constraint_families : set of str
        Families of constraints.
    lines : mapping of str to (str, int)
        Kind of each name, and the line of its declaration.
    locations : dict of str to SourceLocation
        Location of the first declaration of each name.
    broken : set of str
        Names whose declaration is in error; their uses are not reported.
    suspects : set of str
        Words in malformed declarations that may have been meant as names; likewise not reported.
    inputs : mapping of str to int
        Known functions of time, and how often each may be differentiated.
    structural : set of str
        Parameters used in an index or a range.
    needs : mapping of str to lists of str
        Names that the value of each parameter or family of parameters depends on.
    member_count : int
        Number of members of all families so far.
    functions : mapping of str to Macro
        The model's functions.
    kinds : mapping of str to str
        Kinds of the coordinates that are vectors or rotations, and of families of these: ``r[]``.
    aliases : dict of str to str
        Other names of coordinates: the angle of a pin on the ground, for that of its body.
    joints : set of str
        Joints of a machine, which the names of their constraints begin with.
    placing : set of str or None
        Parameters that guesses of a machine depend on; None if the file gives all guesses.
    incomplete : bool
        Whether a block of declarations is unreadable, so that any name may be declared there.
    smooth : bool
        Whether all functions used are smooth: no kinks, no jumps.
    """

    coordinates: dict[str, None] = field(default_factory=dict)
    constraints: dict[str, None] = field(default_factory=dict)
    parameters: Mapping[str, Callable[[], Basic]] = field(default_factory=dict)
    definitions: Mapping[str, Callable[[], Sized]] = field(default_factory=dict)
    constants: Mapping[str, Callable[[], Basic]] = field(default_factory=dict)
    inputs: Mapping[str, int] = field(default_factory=dict)
    families: dict[str, set[str]] = field(default_factory=dict)
    constraint_families: set[str] = field(default_factory=set)
    broken_constraints: set[str] = field(default_factory=set)
    lines: dict[str, tuple[str, int]] = field(default_factory=dict)
    locations: dict[str, SourceLocation] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)
    suspects: set[str] = field(default_factory=set)
    structural: set[str] = field(default_factory=set)
    needs: Mapping[str, list[str]] = field(default_factory=dict)
    member_count: int = 0
    functions: Mapping[str, Macro] = field(default_factory=dict)
    kinds: Mapping[str, str] = field(default_factory=dict)
    aliases: dict[str, str] = field(default_factory=dict)
    joints: set[str] = field(default_factory=set)
    placing: set[str] | None = None
    incomplete: bool = False
    smooth: bool = True

    def unaliased(self, name: str) -> str:
        """Return a coordinate or velocity, ``phi'`` or ``phi_dot``, by its name in the model."""
        for ending in ("", "'", "_dot"):
            own = self.aliases.get(name.removesuffix(ending)) if name.endswith(ending) else None
            if own is not None:
                return own + ("'" if ending else "")
        return name

    @cached_property
    def rates(self) -> dict[Basic, Basic]:
        """The time derivatives that are known so far."""
        return {}

    def may_be_constraint(self, text: str) -> bool:
        """Whether an undeclared name may be a component of a constraint that has an error."""
        return self.incomplete or text.rpartition(".")[0] in self.broken_constraints

    def declared(self, text: str) -> bool:
        """Whether a name or a family is declared."""
        return (
            text in self.coordinates
            or text in self.parameters
            or text in self.definitions
            or text in self.inputs
            or text in self.families
        )

    def may_be_vector(self, text: str) -> bool:
        """Whether a name may stand for a vector or matrix: a definition, or one of a family."""
        return text in self.definitions or "definition" in self.families.get(text, ())

    def resolve(self, name: Name) -> tuple[str, int]:
        """Split a name into base and order of derivative: ``x_dot`` is ``x'`` unless declared."""
        if not self.declared(name.text):
            stem, bracket, rest = name.text.partition("[")
            for suffix, order in DOTS:  # x_dot, x_dot[1], and r[1].x_dot
                base = stem.removesuffix(suffix)
                text = base + bracket + rest
                if base != stem and (self.declared(text) or base in self.suspects):
                    return text, name.primes + order
                text = name.text.removesuffix(suffix)
                if bracket and text != name.text and self.declared(text):
                    return text, name.primes + order
        return name.text, name.primes

    def members(self, base: str) -> list[str]:
        """Return the names of the members of a family."""
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
                parts.append(self.slope(term, symbol) * motion(name, order + 1))
        return se.Add(*parts)
