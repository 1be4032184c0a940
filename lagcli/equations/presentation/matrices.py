"""A large system as M q̈ = f + Bᵀλ, B q̈ = γ: entries by name, common subexpressions abbreviated."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from functools import cache, cached_property
from typing import TypeVar

import symengine as se
from symengine import Basic

from lagcli.equations.presentation.abbreviations import Abbreviations, abbreviate
from lagcli.equations.presentation.formulas import Formulas, Line, Step
from lagcli.equations.presentation.general import Signs
from lagcli.equations.presentation.typeset import Entry, Node, Sign, Symbol

T = TypeVar("T")
#: Matrices and vectors that can be printed: M, f, B, γ, b_0 and φ or ψ of the constraints, Q, and
#: T, V, L.
PARTS = ("M", "f", "B", "gamma", "drift", "expression", "Q", "energy")
Place = tuple[str, int, int]  # the matrix, row and column


class Matrices:
    """The entries of M, f, B and γ, with abbreviations.

    Parameters
    ----------
    formulas : Formulas
        Formulas of the system.
    parts : collection of str
        One or several of `PARTS`.
    """

    def __init__(self, formulas: Formulas, parts: Collection[str] = ("M", "f", "B", "gamma")):
        self.formulas, self.parts = formulas, parts
        self.equations, self.model = formulas.equations, formulas.model
        self.signs = Signs(formulas.model)

    @cached_property
    def entries(self) -> Mapping[Place, Basic]:
        """The nonzero entries; for M, those on and above the diagonal. Vectors have one column."""
        e, constraints = self.equations, self.equations.constraints
        found: dict[Place, Basic] = {}
        for i, row in enumerate(e.mass_matrix):
            found |= {("M", i, j): m for j, m in sorted(row.items()) if j >= i}
        for i, c in enumerate(constraints):
            found |= {("B", i, j): b for j, b in sorted(c.row.items())}
        columns = {
            "f": e.forcing,
            "gamma": [c.rhs for c in constraints],
            "drift": [c.drift for c in constraints],
            "expression": [c.constraint.expression for c in constraints],
            "Q": e.applied_forces,
            "energy": (e.kinetic, e.potential, e.lagrangian),
        }
        for part, column in columns.items():
            found |= {(part, i, 0): x for i, x in enumerate(column)}
        return {place: x for place, x in found.items() if x != 0 and place[0] in self.parts}

    @cached_property
    def short(self) -> Abbreviations:
        """The entries, in the order of `entries`, with abbreviations."""
        names = (*self.model.coordinate_names, *self.model.parameters, *self.model.definitions)
        known = {
            d.value: name
            for name, d in self.model.definitions.items()
            if isinstance(d.value, Basic) and not isinstance(d.value, se.Symbol | se.Number)
        }
        return abbreviate(list(self.entries.values()), names, known)

    @cached_property
    def size(self) -> float:
        """Approximate number of lines of text of the whole system."""
        return sum(map(self._packed, self.short.named.values())) + sum(
            map(self._alone, self.short.expressions)
        )

    @cached_property
    def _operation(self) -> float:
        """Number of characters of an operation: its sign and a name."""
        names = self.model.coordinate_names
        return 4.0 + 0.9 * sum(map(len, names)) / len(names)

    @cached_property
    def _letters(self) -> Callable[[Basic], float]:
        """Return the number of characters of a formula; estimated for long formulas."""
        parts = (*self.short.named.values(), *self.short.expressions)
        if sum(map(se.count_ops, parts)) > _ESTIMATED:
            return lambda value: self._operation * float(se.count_ops(value))
        from lagcli.equations.render.formula_text import TextFormula
        from lagcli.equations.render.names import Notation

        text = TextFormula(Notation(self.model)).text
        return cache(lambda value: float(len(text(self.formulas.arrange(value)))))

    def _packed(self, value: Basic) -> float:
        """Return the approximate fraction of a line that a short formula takes."""
        return (self._letters(value) + _NAME) / _LINE

    def _alone(self, value: Basic) -> float:
        """Return the approximate number of lines of a formula that is printed on its own."""
        return float(math.ceil((self._letters(value) + 2 * _NAME) / _LINE))

    def abbreviations(self, share: float = 1.0) -> list[Line]:
        """Return the abbreviations in order of dependence, or the first of them."""
        shown = first_part(list(self.short.named.items()), lambda x: self._packed(x[1]), share)
        return [Line((Symbol(name), self.formulas.arrange(value))) for name, value in shown]

    def formulas_of(self) -> dict[Place, Node]:
        """Return all entries, arranged."""
        pairs = zip(self.entries, self.short.expressions, strict=True)
        return {place: self.formulas.arrange(value) for place, value in pairs}

    def lines(self, matrix: str, share: float = 1.0) -> list[Line]:
        """Return the entries of M, f, B or gamma, equal ones together, or the first of them."""
        same: dict[Basic, list[Place]] = {}
        for place, value in zip(self.entries, self.short.expressions, strict=True):
            if place[0] == matrix:
                same.setdefault(value, []).append(place)
        shown = first_part(list(same.items()), lambda x: self._alone(x[0]), share)
        return [
            Line((*self.names(places), self.formulas.arrange(value))) for value, places in shown
        ]

    def names(self, places: list[Place]) -> list[Node]:
        """Return the names of equal entries; of many, the first ones and the last."""
        if len(places) <= _ALIKE + 2:
            return list(map(self.entry, places))
        dots = Sign(f"⋯ ({len(places)} entries)", rf"\cdots_{{\text{{{len(places)} entries}}}}")
        return [*map(self.entry, places[:_ALIKE]), dots, self.entry(places[-1])]

    def entry(self, place: Place) -> Node:
        """Return the name of an entry."""
        matrix, i, j = place
        q, constraints = self.formulas.coordinates, self.equations.constraints
        if matrix == "M":
            return Entry(self.signs.mass_matrix, (q[i], q[j]))
        if matrix == "f":
            return Entry(self.signs.forcing, (q[i],))
        row = Symbol(constraints[i].constraint.name, kind="constraint")
        if matrix == "B":
            return Entry(self.signs.constraint_matrix, (row, q[j]))
        return Entry(self.signs.rhs, (row,))

    def steps(self, room: float | None = None) -> list[Step]:
        """Return the system as printed steps.

        Parameters
        ----------
        room : float, optional
            Number of lines; longer lists are cut.
        """
        share = 1.0 if room is None else min(1.0, room / max(self.size, 1.0))
        signs = self.signs
        remark = (
            "Entries are named by the coordinates and constraints that they belong to."
            f" {signs.mass_matrix.text} is symmetric, its upper triangle is listed; entries that"
            " are not listed are zero."
        )
        if "gamma" not in self.parts and self.equations.constraints:
            remark += f" {_without(signs)}"
        found = [Step("Equations of motion, in matrices", self._laws(), remark)]
        if self.short.named:
            lines, count = self.abbreviations(share), len(self.short.named)
            said = cut_short(len(lines), count)
            found.append(Step("Abbreviations", tuple(lines), said, packed=True))
        titles = {
            "M": f"Mass matrix {signs.mass_matrix.text}",
            "f": f"Forces {signs.forcing.text}",
            "B": f"Constraint matrix {signs.constraint_matrix.text}",
            "gamma": f"Right side {signs.rhs.text}",
        }
        for matrix, title in titles.items():
            values = [
                value
                for place, value in zip(self.entries, self.short.expressions, strict=True)
                if place[0] == matrix
            ]
            if values:
                lines = self.lines(matrix, share)
                found.append(Step(title, tuple(lines), cut_short(len(lines), len(set(values)))))
        return found

    def _laws(self) -> tuple[Line, ...]:
        """Return M q̈ = f + Bᵀ λ and B q̈ = γ."""
        m, f, b = self.signs.mass_matrix, self.signs.forcing, self.signs.constraint_matrix
        left = Sign(f"{m.text} q̈", rf"{m.latex} \, \ddot{{q}}")
        if not self.equations.constraints:
            return (Line((left, f)),)
        right = Sign(f"{f.text} + {b.text}ᵀ λ", rf"{f.latex} + {b.latex}^{{\mathrm{{T}}}} \lambda")
        held = Sign(f"{b.text} q̈", rf"{b.latex} \, \ddot{{q}}")
        return Line((left, right)), Line((held, self.signs.rhs))


def _without(signs: Signs) -> str:
    """Return the remark that γ = −(∂ψ/∂q) q̇ − ∂ψ/∂t is not listed."""
    psi = signs.velocity_residual
    return (
        f"{signs.rhs.text} = −(∂{psi}/∂q) q̇ − ∂{psi}/∂t is omitted for its length; --format json"
        " gives it."
    )


#: Number of equal entries listed before the ellipsis.
_ALIKE = 4
#: Number of characters of a name with its equality sign, and of a line.
_NAME, _LINE = 8.0, 92.0
#: Number of operations above which lengths are estimated, because arranging takes seconds.
_ESTIMATED = 8000


def first_part(items: list[T], cost: Callable[[T], float], share: float) -> list[T]:
    """Return the first items whose cost is within a share of the total; at least one."""
    if share >= 1.0:
        return items
    costs = list(map(cost, items))
    allowed, spent, shown = share * sum(costs), 0.0, 0
    while shown < len(items) and spent + costs[shown] <= allowed:
        spent += costs[shown]
        shown += 1
    return items[: max(1, shown)]


def cut_short(shown: int, count: int) -> str | None:
    """Return the remark that a list is incomplete."""
    return (
        None if shown == count else f"The first {shown} of {count}; --full writes everything out."
    )
