"""Formulas of a system, line by line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.degrees_of_freedom import DegreesOfFreedom
from lagcli.equations.derivation.lagrange import ConstraintEquation, Equations
from lagcli.equations.presentation import formulas as general
from lagcli.equations.presentation.written import named_in, sides_built, written
from lagcli.equations.simplification.arrange import Arranger
from lagcli.equations.simplification.factors import without_content
from lagcli.equations.typesetting.nodes import (
    ZERO,
    Line,
    Node,
    Number,
    Partial,
    Rate,
    Sign,
    Sum,
    Symbol,
    VirtualDisplacement,
    product_of,
    quotient_of,
    sum_of,
    symbols_in,
    weight,
)
from lagcli.equations.typesetting.rewriting import differences, displaced, oriented
from lagcli.model import model as symbols
from lagcli.model.expression.functions import derivative
from lagcli.model.expression.grammar import Tree
from lagcli.model.model import Model

if TYPE_CHECKING:
    from lagcli.equations.typesetting.notation import Notation

#: Least number of characters of equal factors of several multipliers that are written once.
_COLLECTED = 16


class Signs:
    """Symbols of the theory, chosen to differ from the names of the model.

    Parameters
    ----------
    model : Model
    """

    def __init__(self, model: Model):
        from lagcli.equations.typesetting.notation import LATEX_GREEK, SCRIPT, letter

        self.model = model
        taken = frozenset(model.declared_names)
        letters = {letter(name) for name in taken}
        capitals = (
            Sign(SCRIPT[x], rf"\mathcal{{{x}}}") if x in taken else Sign(x, x) for x in "TVLMBJ"
        )
        self.kinetic, self.potential, self.lagrangian, *matrices = capitals
        #: Jacobi's integral q̇·∂L/∂q̇ − L.
        self.jacobi = Sign(SCRIPT["H"], r"\mathcal{H}") if "h" in taken else Sign("h", "h")
        #: M and B of M q̈ = f + Bᵀλ, B q̈ = γ; J of q̇ = J u + c, u the independent velocities.
        self.mass_matrix, self.constraint_matrix, self.null_space = matrices

        def free(*candidates: str) -> str:
            return next((x for x in candidates if x not in letters), candidates[0])

        def sign(*parts: str) -> Sign:
            below = "".join(parts[1:])
            latex = "".join(LATEX_GREEK.get(x, x) + " " for x in parts[1:]).strip()
            base = LATEX_GREEK.get(parts[0], parts[0])
            return (
                Sign(f"{parts[0]}_{below}", f"{base}_{{{latex}}}")
                if below
                else Sign(parts[0], base)
            )

        #: Numbers of coordinates and of constraints.
        self.coordinate_count, self.constraint_count = free("k", "n", "N"), free("r", "s", "p")
        row, coefficient = free("β", "α", "μ"), free("b", "a", "c", "h", "d")
        holonomic = free("φ", "f", "h")
        letters.add(holonomic)
        self.holonomic = sign(holonomic, row)
        self.forcing, self.rhs = sign(free("f", "p", "d")), sign(free("γ", "η", "ζ"))
        self.drift = sign(free("c", "d", "e"))
        rank = self.constraint_matrix
        self.rank = Sign(f"rank {rank.text}", rf"\operatorname{{rank}} {rank.latex}")
        #: Letter of the constraints at velocity level.
        self.velocity_residual = free("ψ", "g", "w")
        self.nonholonomic = sign(self.velocity_residual, row)
        self.coefficient = sign(coefficient, "i", row)
        self.multiplier = sign("λ", row)
        self.block = Sign(f"det {coefficient}", rf"\det {coefficient}")
        self.row, self.coefficient_letter = row, coefficient
        greek = LATEX_GREEK[row]
        self.reaction = Sign(
            f"Σ_{row} {self.multiplier.text} {self.coefficient.text}",
            rf"\textstyle\sum_{{{greek}}} {self.multiplier.latex} {self.coefficient.latex}",
        )

    @property
    def force(self) -> Sign:
        """The generalized force on the i-th coordinate."""
        from lagcli.equations.typesetting.notation import Notation

        text, latex = Notation(self.model).force
        return Sign(f"{text}ᵢ", f"{latex}_i")


def force(coordinate: Symbol) -> Symbol:
    """Return the symbol of the generalized force on a coordinate."""
    return Symbol(coordinate.name, kind="force")


def total_rate(expression: Basic, equations: Equations) -> Basic:
    """Return d/dt of an expression in q, v and t."""
    free = expression.free_symbols
    terms = [derivative(expression, symbols.TIME)]
    pairs = zip((*equations.q, *equations.v), (*equations.v, *equations.a), strict=True)
    terms += [derivative(expression, x) * rate for x, rate in pairs if x in free]
    return se.Add(*terms)


def law(model: Model) -> tuple[Sum, Node]:
    """Return the sides of d/dt ∂L/∂q̇_i − ∂L/∂q_i = Q_i + Σ_β λ_β b_iβ (8.85)."""
    signs = Signs(model)
    rate = Rate(Partial(signs.lagrangian, Sign("q̇ᵢ", r"\dot{q}_i")))
    left = Sum(((1, rate), (-1, Partial(signs.lagrangian, Sign("qᵢ", "q_i")))))
    if not model.constraints:
        return left, signs.force
    return left, Sum(((1, signs.force), (1, signs.reaction)))


def coefficients(equations: Equations) -> dict[str, list[tuple[Node, ...]]]:
    """Return the definitions of b_iβ for each kind of constraints in a system."""
    rows: dict[str, list[tuple[Node, ...]]] = {}
    signs = Signs(equations.model)
    sides = Sum(((1, Sign("lhs", r"\text{lhs}")), (-1, Sign("rhs", r"\text{rhs}"))))
    kinds = {c.constraint.kind for c in equations.constraints}
    if "holonomic" in kinds:
        slope = Partial(signs.holonomic, Sign("qᵢ", "q_i"))
        rows["holonomic"] = [(signs.coefficient, slope), (signs.holonomic, sides)]
    if kinds - {"holonomic"}:
        slope = Partial(signs.nonholonomic, Sign("q̇ᵢ", r"\dot{q}_i"))
        rows["nonholonomic"] = [(signs.coefficient, slope), (signs.nonholonomic, sides)]
    return rows


def _counted(equations: Equations) -> DegreesOfFreedom:
    """Return the degrees of freedom from the number of constraints that always hold."""
    lasting = [c.constraint for c in equations.constraints if c.constraint.lasting]
    held = tuple(c.name for c in lasting) if len(lasting) < len(equations.constraints) else None
    return DegreesOfFreedom(len(equations.q), len(lasting), held=held)


def _common_denominator(row: Mapping[int, Basic]) -> tuple[Basic, Mapping[int, Basic]]:
    """Return the roots and powers by which all entries are divided, and the entries without."""
    shared = [
        factor
        for factor in _factors(next(iter(row.values()), se.Integer(0)))
        if isinstance(factor, se.Pow)
        and factor.args[1].is_Number
        and factor.args[1].is_negative
        and all(factor in _factors(b) for b in row.values())
    ]
    if len(row) < 2 or not shared:
        return se.Integer(1), row
    below = se.Mul(*(1 / factor for factor in shared))
    return below, {j: b * below for j, b in row.items()}


def _factors(expression: Basic) -> tuple[Basic, ...]:
    return tuple(expression.args) if isinstance(expression, se.Mul) else (expression,)


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
        self._arranger = Arranger(self.model, self.values, named)
        self.arrange, self.in_order = self._arranger.arrange, self._arranger.in_order

    @cached_property
    def notation(self) -> Notation:
        """How names are written."""
        from lagcli.equations.typesetting.notation import Notation

        return Notation(self.model)

    @property
    def coordinates(self) -> tuple[Symbol, ...]:
        """The coordinates q_i."""
        return tuple(Symbol(name) for name in self.model.coordinate_names)

    def written(self, tree: Tree, indices: Mapping[str, int] | None = None) -> Node:
        """Return a syntax tree as a formula, as written; for a family, with index values."""
        return written(tree, self.model, self.values, indices or {})

    def definition_lines(
        self, constraints: Iterable[ConstraintEquation], nodes: Iterable[Node]
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
        """Return Σ b_i δq_i = 0 (8.79), with a common denominator below the sum."""
        below, row = _common_denominator(c.row)
        terms = [
            (1, product_of([self.arrange(b), VirtualDisplacement(self.coordinates[j])]))
            for j, b in sorted(row.items())
        ]
        content, rest = without_content(sum_of(terms))
        single = product_of([Number(content), rest])
        v = self.equations.v
        if all(b.free_symbols.isdisjoint(v) for b in row.values()):
            together = displaced(self.arrange(se.Add(*(b * v[j] for j, b in row.items()))))
            if together is not None and weight(together) < weight(single):
                single = oriented(together, self._differences(c))
        if below != 1:
            single = quotient_of(single, self._side_or_arranged(c, below))
        return Line((single, ZERO))

    def _side_or_arranged(self, c: ConstraintEquation, expression: Basic) -> Node:
        """Return an expression as the side of a constraint that it is, or else arranged."""
        if len(trees := self.constraint_trees(c)) == 2:
            for tree, value in zip(trees, sides_built(c.constraint, self.model), strict=True):
                if value == expression:
                    return self.written(tree, c.constraint.indices)
        return self.arrange(expression)

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
        return sum_of([(1, applied), *self._reactions(i)])

    def _reactions(self, i: int) -> list[tuple[int, Node]]:
        """Return the terms of Σ_β λ_β b_iβ; those with the same long b, or −b, as one term."""
        held = [c for c in self.equations.constraints if i in c.row]
        groups: dict[Basic, list[tuple[int, int]]] = {}
        for place, c in enumerate(held):
            b = c.row[i]
            opposite = se.Add(*[-x for x in b.args]) if isinstance(b, se.Add) else -b
            sign = -1 if b not in groups and opposite in groups else 1
            groups.setdefault(opposite if sign < 0 else b, []).append((sign, place))
        labels = [Symbol(c.constraint.name, kind="multiplier") for c in held]
        pairs = zip(labels, held, strict=True)
        terms: list[Node | None] = [product_of([x, self.arrange(c.row[i])]) for x, c in pairs]
        for b, members in groups.items():
            factor = self.arrange(b)
            if len(members) > 1 and len(members) * weight(factor) >= _COLLECTED:
                together = sum_of((sign, labels[place]) for sign, place in members)
                for _, place in members:
                    terms[place] = None
                terms[members[0][1]] = product_of([together, factor])
        return [(1, term) for term in terms if term is not None]

    def equation_line(self, i: int) -> Line:
        """Return the i-th equation of motion, assembled."""
        e = self.equations
        left = self.arrange(e.momentum_rates[i] - e.gradient[i], e.a[i])
        return Line((left, self.right_side(i)), self.coordinates[i])
