"""Formulas of a system, line by line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.degrees_of_freedom import DegreesOfFreedom
from lagcli.equations.derivation.lagrange import ConstraintEquation, Equations
from lagcli.equations.presentation import general
from lagcli.equations.presentation.typeset import (
    ZERO,
    Node,
    Number,
    Sign,
    Symbol,
    VirtualDisplacement,
    product_of,
    sum_of,
    symbols_in,
    weight,
)
from lagcli.equations.presentation.written import named_in, sides_built, written
from lagcli.equations.simplification.arrange import Arranger
from lagcli.equations.simplification.sums import without_content
from lagcli.equations.simplification.variations import differences, displaced, oriented
from lagcli.model.expression.grammar import Tree


@dataclass(frozen=True)
class Line:
    """A formula lhs = rhs [= rhs …], or a single expression.

    Parameters
    ----------
    sides : tuple of Node
    label : Node or str, optional
        Coordinate or constraint to which the formula belongs.
    note : str, optional
        Remark on the formula.
    span : Sign, optional
        Range of the index of a formula that holds for several members: i = 2, …, N.
    """

    sides: tuple[Node, ...]
    label: Node | str | None = None
    note: str | None = None
    span: Sign | None = None

    @property
    def remark(self) -> str | None:
        """Note and range as plain text."""
        span = self.span.text if self.span is not None else None
        return "; ".join(x for x in (self.note, span) if x) or None


@dataclass(frozen=True)
class Step:
    """A step of a derivation.

    Parameters
    ----------
    title : str
    lines : tuple of Line
    remark : str or None
        Explanation or source of the step.
    packed : bool
        Whether short lines may be placed side by side.
    lead : str or None
        Text printed before the lines: "Substituting the definitions gives".
    """

    title: str
    lines: tuple[Line, ...]
    remark: str | None = None
    packed: bool = False
    lead: str | None = None


def _counted(equations: Equations) -> DegreesOfFreedom:
    """Return the degrees of freedom from the number of constraints that always hold."""
    lasting = [c.constraint for c in equations.constraints if c.constraint.lasting]
    held = tuple(c.name for c in lasting) if len(lasting) < len(equations.constraints) else None
    return DegreesOfFreedom(len(equations.q), len(lasting), held=held)


class Formulas:
    """Formulas of a system for display.

    Parameters
    ----------
    equations : Equations
    numeric : bool
        Whether parameters are replaced by their values.
    named : bool
        Whether roots are replaced by the names of definitions with the same value.
    freedom : DegreesOfFreedom, optional
        Degrees of freedom, if the rank of B at the initial state is known.
    """

    def __init__(
        self,
        equations: Equations,
        numeric: bool = False,
        named: bool = True,
        freedom: DegreesOfFreedom | None = None,
    ):
        self.equations = equations
        self.model = equations.model
        self.freedom = freedom or _counted(equations)
        self.values: Mapping[str, Fraction] = {}
        if numeric:
            values = self.model.parameter_values
            self.values = {name: Fraction(repr(value)) for name, value in values.items()}
        self.arrange = Arranger(self.model, self.values, named).arrange

    @property
    def coordinates(self) -> tuple[Symbol, ...]:
        """The coordinates q_i."""
        return tuple(Symbol(name) for name in self.model.coordinate_names)

    def written(self, tree: Tree, indices: Mapping[str, int] | None = None) -> Node:
        """Return a syntax tree as a formula, as written; for a family, with index values."""
        return written(tree, self.model, self.values, indices or {})

    def definition_lines(
        self, constraints: Iterable[ConstraintEquation], nodes: Iterable[Node] = ()
    ) -> tuple[Line, ...]:
        """Return the definitions that constraints and formulas use, as written."""
        definitions = self.model.definitions
        used: dict[str, None] = {}
        for c in constraints:
            for tree in self.constraint_trees(c):
                used.update(dict.fromkeys(named_in(tree, self.model, c.constraint.indices)))
        for name in symbols_in(nodes):
            if name in definitions:
                d = definitions[name]
                used.update(dict.fromkeys(named_in(d.tree, self.model, d.indices)))
                used[name] = None
        return tuple(self._definition_line(name) for name in definitions if name in used)

    def all_definition_lines(self) -> tuple[Line, ...]:
        """Return all definitions, as written."""
        return tuple(map(self._definition_line, self.model.definitions))

    def _definition_line(self, name: str) -> Line:
        definition = self.model.definitions[name]
        return Line((Symbol(name), self.written(definition.tree, definition.indices)))

    def uses_definitions(self, tree: Tree) -> bool:
        """Whether a tree uses definitions."""
        return bool(named_in(tree, self.model))

    def constraint_trees(self, c: ConstraintEquation) -> list[Tree]:
        """Return the sides of a constraint as formulas."""
        sides = (c.constraint.left, c.constraint.right)
        return [side for side in sides if side is not None]

    def constraint_line(self, c: ConstraintEquation) -> Line:
        """Return a constraint as written."""
        indices = c.constraint.indices
        sides = tuple(self.written(tree, indices) for tree in self.constraint_trees(c))
        if not sides:
            sides = (self.arrange(c.constraint.expression),)
        return Line(sides if len(sides) == 2 else (*sides, ZERO))

    def variation_line(self, c: ConstraintEquation) -> Line:
        """Return Σ b_i δq_i = 0 (8.79)."""
        terms = [
            (1, product_of([self.arrange(b), VirtualDisplacement(self.coordinates[j])]))
            for j, b in sorted(c.row.items())
        ]
        content, rest = without_content(sum_of(terms))
        single = product_of([Number(content), rest])
        v = self.equations.v
        if any(not b.free_symbols.isdisjoint(v) for b in c.row.values()):
            return Line((single, ZERO))
        together = displaced(self.arrange(se.Add(*(b * v[j] for j, b in c.row.items()))))
        if together is None or weight(together) >= weight(single):
            return Line((single, ZERO))
        return Line((oriented(together, self._differences(c)), ZERO))

    def _differences(self, c: ConstraintEquation) -> frozenset[Node]:
        return differences(self.constraint_line(c).sides)

    def _differentiated(self, c: ConstraintEquation, sides: Iterable[Basic]) -> Line:
        written = self._differences(c)
        rates = [oriented(self.arrange(side), written) for side in sides]
        return Line(tuple(rates) if len(rates) == 2 else (*rates, ZERO))

    def rate_line(self, c: ConstraintEquation) -> Line:
        """Return the time derivative of both sides of a holonomic constraint."""
        sides = sides_built(c.constraint, self.model)
        return self._differentiated(c, [general.total_rate(x, self.equations) for x in sides])

    def acceleration_line(self, c: ConstraintEquation) -> Line:
        """Return the constraint differentiated to accelerations, side by side as written."""
        e = self.equations
        sides = sides_built(c.constraint, self.model)
        if c.position is not None:
            sides = tuple(general.total_rate(side, e) for side in sides)
        return self._differentiated(c, [general.total_rate(side, e) for side in sides])

    def right_side(self, i: int, forces_named: bool = False) -> Node:
        """Return Q_i + Σ_β λ_β b_iβ, with Q_i as a symbol or expanded."""
        applied = self.arrange(self.equations.applied_forces[i])
        if forces_named and applied != ZERO:
            applied = general.force(self.coordinates[i])
        terms = [(1, applied)]
        for c in self.equations.constraints:
            if i in c.row:
                label = Symbol(c.constraint.name, kind="multiplier")
                terms.append((1, product_of([label, self.arrange(c.row[i])])))
        return sum_of(terms)

    def equation_line(self, i: int) -> Line:
        """Return the i-th equation of motion, assembled."""
        e = self.equations
        left = self.arrange(e.momentum_rates[i] - e.gradient[i], e.a[i])
        return Line((left, self.right_side(i)), self.coordinates[i])
