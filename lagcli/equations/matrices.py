"""A large system as M q̈ = f + Bᵀλ, B q̈ = γ: entries by name, common subexpressions abbreviated."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TypeVar

import symengine as se
from symengine import Basic

from lagcli.equations.abbreviations import Abbreviations, abbreviate
from lagcli.equations.formulas import Formulas, Line, Step
from lagcli.equations.typeset import Entry, Node, Sign, Symbol

_M, _F, _B, _GAMMA = (
    Sign("M", "M"),
    Sign("f", "f"),
    Sign("B", "B"),
    Sign("γ", r"\gamma"),
)
_A = Sign("q̈", r"\ddot{q}")
_LAW = Sign("M q̈", r"M \, \ddot{q}"), Sign("f + Bᵀ λ", r"f + B^{\mathrm{T}} \lambda")
_HELD = Sign("B q̈", r"B \, \ddot{q}"), _GAMMA

T = TypeVar("T")
Place = tuple[str, int, int]  # the matrix, row and column


class Matrices:
    """The entries of M, f, B and γ, with abbreviations.

    Parameters
    ----------
    formulas : Formulas
        Of the system.
    """

    def __init__(self, formulas: Formulas):
        self.formulas = formulas
        self.equations, self.model = formulas.equations, formulas.model

    @cached_property
    def entries(self) -> Mapping[Place, Basic]:
        """The nonzero entries; of M those on and above the diagonal. f and γ have one column."""
        e = self.equations
        found: dict[Place, Basic] = {}
        for i, row in enumerate(e.mass_matrix):
            found |= {("M", i, j): m for j, m in sorted(row.items()) if j >= i}
        found |= {("f", i, 0): f for i, f in enumerate(e.forcing)}
        for i, c in enumerate(e.constraints):
            found |= {("B", i, j): b for j, b in sorted(c.row.items())}
        found |= {("gamma", i, 0): c.rhs for i, c in enumerate(e.constraints)}
        return {place: x for place, x in found.items() if x != 0}

    @cached_property
    def short(self) -> Abbreviations:
        """The entries, in the order of `entries`, with the abbreviations that they use."""
        names = (*self.model.coordinate_names, *self.model.parameters, *self.model.definitions)
        known = {
            d.value: name
            for name, d in self.model.definitions.items()
            if isinstance(d.value, Basic) and not isinstance(d.value, se.Symbol | se.Number)
        }
        return abbreviate(list(self.entries.values()), names, known)

    @cached_property
    def size(self) -> float:
        """About how many lines of text all this takes."""
        return sum(map(_packed, self.short.named.values())) + sum(
            map(_alone, self.short.expressions)
        )

    def abbreviations(self, share: float = 1.0) -> list[Line]:
        """Return the abbreviations, each after those that it uses; or a first part of them."""
        shown = first_part(list(self.short.named.items()), lambda x: _packed(x[1]), share)
        return [Line((Symbol(name), self.formulas.arrange(value))) for name, value in shown]

    def lines(self, matrix: str, share: float = 1.0) -> list[Line]:
        """Return the entries of M, f, B or gamma, equal ones together; or a first part of them."""
        same: dict[Basic, list[Place]] = {}
        for place, value in zip(self.entries, self.short.expressions, strict=True):
            if place[0] == matrix:
                same.setdefault(value, []).append(place)
        shown = first_part(list(same.items()), lambda x: _alone(x[0]), share)
        return [
            Line((*map(self.entry, places), self.formulas.arrange(value)))
            for value, places in shown
        ]

    def entry(self, place: Place) -> Node:
        """Return the name of an entry."""
        matrix, i, j = place
        q, constraints = self.formulas.coordinates, self.equations.constraints
        if matrix == "M":
            return Entry(_M, (q[i], q[j]))
        if matrix == "f":
            return Entry(_F, (q[i],))
        row = Symbol(constraints[i].constraint.name, kind="constraint")
        return Entry(_B, (row, q[j])) if matrix == "B" else Entry(_GAMMA, (row,))

    def steps(self, room: float | None = None) -> list[Step]:
        """Return the system as it is to be read.

        Parameters
        ----------
        room : float, optional
            Lines of text; where more are needed, a first part of each list is given.
        """
        share = 1.0 if room is None else min(1.0, room / max(self.size, 1.0))
        law = [Line(_LAW if self.equations.constraints else (_LAW[0], _F))]
        law += [Line(_HELD)] if self.equations.constraints else []
        found = [Step("Equations of motion, in matrices", tuple(law), _REMARK)]
        if self.short.named:
            lines, count = self.abbreviations(share), len(self.short.named)
            remark = cut_short(len(lines), count)
            found.append(Step("Abbreviations", tuple(lines), remark, packed=True))
        for matrix, title in _TITLES.items():
            values = [
                value
                for place, value in zip(self.entries, self.short.expressions, strict=True)
                if place[0] == matrix
            ]
            if values:
                lines = self.lines(matrix, share)
                found.append(Step(title, tuple(lines), cut_short(len(lines), len(set(values)))))
        return found


_REMARK = (
    "Entries are named by the coordinates and constraints that they belong to. M is symmetric, its"
    " upper triangle is listed; entries that are not listed are zero."
)
_TITLES = {
    "M": "Mass matrix M",
    "f": "Forces f",
    "B": "Constraint matrix B",
    "gamma": "Right side γ",
}
#: Letters of an operation, of a name with its equality sign, and of a line.
_OPERATION, _NAME, _LINE = 4.5, 9.0, 92.0


def _packed(value: Basic) -> float:
    """Return about how much of a line of text a short formula takes."""
    return float((_OPERATION * se.count_ops(value) + _NAME) / _LINE)


def _alone(value: Basic) -> float:
    """Return about how many lines of text a formula takes that stands by itself."""
    return float(math.ceil((_OPERATION * se.count_ops(value) + 2 * _NAME) / _LINE))


def first_part(items: list[T], cost: Callable[[T], float], share: float) -> list[T]:
    """Return the first items, up to a share of what all cost; at least one."""
    if share >= 1.0:
        return items
    costs = list(map(cost, items))
    allowed, spent, shown = share * sum(costs), 0.0, 0
    while shown < len(items) and spent + costs[shown] <= allowed:
        spent += costs[shown]
        shown += 1
    return items[: max(1, shown)]


def cut_short(shown: int, count: int) -> str | None:
    """Say that a list is not whole."""
    return None if shown == count else f"The first {shown} of {count}; --full prints all."
