"""Lagrange's equations of the second kind.

The holonomic constraints are solved for the dependent coordinates u(q, t), and L(q, q̇, t) is
written in the independent ones:

    d/dt ∂L/∂q̇_k − ∂L/∂q_k = Σ_i J_ik Q_i,

where J is the matrix of `CoordinatePartition.null_space`. Dependent coordinates with a long closed
form, or without one, remain names of functions u(q, t); they are differentiated by the chain rule,
∂u/∂q_k = J_uk.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.derivation.motion import ZERO
from lagcli.equations.reduction.closed_forms import Solution, solve
from lagcli.equations.reduction.partition import CoordinateBlock, CoordinatePartition, number
from lagcli.errors import Diagnostic, UsageError
from lagcli.model import model as symbols
from lagcli.model.expression.functions import derivative


@dataclass(frozen=True, eq=False)
class Maggi:
    """Maggi's equations of a system with n independent coordinates.

    Parameters
    ----------
    partition : CoordinatePartition
    """

    partition: CoordinatePartition

    @cached_property
    def equations_of_motion(self) -> tuple[Basic, ...]:
        """The n left sides Σ_i J_ik (d/dt ∂L/∂q̇_i − ∂L/∂q_i − Q_i)."""
        e = self.partition.equations
        parts = zip(e.momentum_rates, e.gradient, e.applied_forces, strict=True)
        residuals = [rate - slope - force for rate, slope, force in parts]
        return self._projected(residuals)

    @cached_property
    def mass_matrix(self) -> tuple[tuple[Basic, ...], ...]:
        """JᵀM J, n by n."""
        rows = self.partition.null_space
        size = len(self.partition.independent)
        columns = []
        for k in range(size):
            column = [row[k] if k in row else se.Integer(0) for row in rows]
            columns.append(self._projected(self._weighted(column)))
        return tuple(tuple(columns[k][i] for k in range(size)) for i in range(size))

    @cached_property
    def forcing(self) -> tuple[Basic, ...]:
        """Jᵀ(f − M c), where a = J a_independent + c."""
        weighted = self._weighted(self.partition.acceleration_rhs)
        forces = self.partition.equations.forcing
        left = [f - x for f, x in zip(forces, weighted, strict=True)]
        return self._projected(left)

    def _weighted(self, vector: tuple[Basic, ...] | list[Basic]) -> list[Basic]:
        mass = self.partition.equations.mass_matrix
        return [se.Add(*[m * vector[j] for j, m in row.items()]) for row in mass]

    def _projected(self, vector: list[Basic]) -> tuple[Basic, ...]:
        terms: list[list[Basic]] = [[] for _ in self.partition.independent]
        for x, row in zip(vector, self.partition.null_space, strict=True):
            for k, j in row.items():
                terms[k].append(j * x)
        return tuple(se.Add(*parts) for parts in terms)


#: Largest number of operations of a closed form that is substituted into L.
_SHORT = 30
#: Number of operations of the dependent velocities or of L above which L is not written out.
_LONG = 600
_FEW = 3  # largest number of dependent coordinates for which the second kind may be short


@dataclass(frozen=True, eq=False)
class SolvedBlock:
    """Constraints and the coordinates that they determine; no solutions if they are implicit."""

    block: CoordinateBlock
    solutions: tuple[Solution, ...]


@dataclass(frozen=True, eq=False)
class SecondKind:
    """L and the equations of motion in independent coordinates.

    n independent coordinates.

    Parameters
    ----------
    partition : CoordinatePartition
    blocks : tuple of SolvedBlock
        The dependent coordinates in the order in which they are solved.
    written_out : bool
        Whether long closed forms are also substituted into L.
    """

    partition: CoordinatePartition
    blocks: tuple[SolvedBlock, ...]
    written_out: bool = False

    @property
    def equations(self) -> Equations:
        """The equations of the first kind."""
        return self.partition.equations

    @cached_property
    def named(self) -> tuple[int, ...]:
        """Dependent coordinates that remain names of functions of the independent ones."""
        place = {x: i for i, x in enumerate(self.equations.q)}
        solved = {place[s.unknown] for s in self.inserted}
        return tuple(i for i in self.partition.dependent if i not in solved)

    @cached_property
    def inserted(self) -> tuple[Solution, ...]:
        """Solutions that are substituted into L, in order of dependence."""
        solutions: list[Solution] = []
        unknown = {self.equations.q[i] for i in self.partition.dependent}
        for solution in (s for block in self.blocks for s in block.solutions):
            parts = [x for x in (solution.sine, solution.cosine) if x is not None]
            whole = [self._with(solutions, x) for x in parts or [solution.value]]
            short = max(map(se.count_ops, whole)) <= _SHORT
            if self.written_out or (short and not any(x.free_symbols & unknown for x in whole)):
                solutions.append(solution)
        return tuple(solutions)

    @staticmethod
    def _with(solutions: list[Solution] | tuple[Solution, ...], expression: Basic) -> Basic:
        for solution in reversed(solutions):
            expression = solution.put_into(expression)
        return expression

    def reduced(self, expression: Basic) -> Basic:
        """Return an expression in q, v and t with dependent positions and velocities replaced."""
        moving = {self.equations.v[i]: x for i, x in self._velocities.items()}
        used = {v: x for v, x in moving.items() if v in expression.free_symbols}
        return self._with(self.inserted, expression.subs(used) if used else expression)

    @cached_property
    def _velocities(self) -> dict[int, Basic]:
        p, v = self.partition, self.equations.v
        free = [v[i] for i in p.independent]
        return {
            i: se.Add(*[x * free[k] for k, x in p.null_space[i].items()], p.drift[i])
            for i in p.dependent
        }

    @cached_property
    def rates(self) -> Mapping[int, Basic]:
        """The dependent velocities by coordinate, in independent ones."""
        return {i: self._with(self.inserted, x) for i, x in self._velocities.items()}

    @cached_property
    def jacobian(self) -> tuple[Mapping[int, Basic], ...]:
        """J by coordinate, with dependent coordinates replaced as in L."""
        rows = self.partition.null_space
        return tuple({k: self._with(self.inserted, x) for k, x in row.items()} for row in rows)

    @cached_property
    def _drift(self) -> tuple[Basic, ...]:
        return tuple(self._with(self.inserted, x) for x in self.partition.drift)

    @cached_property
    def is_long(self) -> bool:
        """Whether L written out would be long: M and f are then projected instead of derived from
        L."""
        if self.written_out:
            return False
        operations = sum(se.count_ops(x) for x in self.rates.values())
        return operations > _LONG or se.count_ops(self.equations.lagrangian) > _LONG

    @property
    def entries(self) -> int:
        """Number of nonzero entries of f and of M on and above its diagonal."""
        rows = self._projected.mass_matrix
        return len(rows) + sum(x != 0 for i, row in enumerate(rows) for x in row[i:])

    @cached_property
    def _projected(self) -> Maggi:
        return Maggi(self.partition)

    def lagrangian_uses(self, unknown: Basic) -> bool:
        """Whether L contains a coordinate other than in the sines and cosines of its solution."""
        e = self.equations.lagrangian
        for x in (*e.atoms(se.sin), *e.atoms(se.cos)):
            if x.args[0] == unknown:
                e = e.xreplace({x: se.Integer(1)})
        return unknown in e.free_symbols

    @cached_property
    def lagrangian(self) -> Basic:
        """L in the independent coordinates and velocities (8.89)."""
        return self.reduced(self.equations.lagrangian)

    @cached_property
    def momenta(self) -> tuple[Basic, ...]:
        """The n derivatives ∂L/∂v_k."""
        return tuple(derivative(self.lagrangian, v) for v in self._v)

    @cached_property
    def gradient(self) -> tuple[Basic, ...]:
        """The n derivatives ∂L/∂q_k."""
        return tuple(self._slope(self.lagrangian, k) for k in range(len(self._v)))

    @cached_property
    def applied_forces(self) -> tuple[Basic, ...]:
        """The n generalized forces Σ_i J_ik Q_i."""
        e = self.equations
        terms: list[list[Basic]] = [[] for _ in self._v]
        for i, force in enumerate(e.applied_forces):
            if force != 0:
                reduced = self.reduced(force)
                for k, x in self.jacobian[i].items():
                    terms[k].append(x * reduced)
        return tuple(se.Add(*x) if x else ZERO for x in terms)

    @cached_property
    def mass_matrix(self) -> tuple[tuple[Basic, ...], ...]:
        """∂²L/∂v_k∂v_l, n by n."""
        if self.is_long:
            rows = self._projected.mass_matrix
            return tuple(tuple(self._with(self.inserted, x) for x in row) for row in rows)
        return tuple(tuple(derivative(p, v) for v in self._v) for p in self.momenta)

    @cached_property
    def momentum_rates(self) -> tuple[Basic, ...]:
        """The n time derivatives d/dt ∂L/∂v_k, including accelerations."""
        a = [self.equations.a[i] for i in self.partition.independent]
        rates = []
        for p, row in zip(self.momenta, self.mass_matrix, strict=True):
            moving = [m * x for m, x in zip(row, a, strict=True)]
            rates.append(se.Add(*moving, self._convective(p)))
        return tuple(rates)

    @cached_property
    def forcing(self) -> tuple[Basic, ...]:
        """The n right sides f of M a = f."""
        if self.is_long:
            return tuple(map(self.reduced, self._projected.forcing))
        parts = zip(self.momenta, self.gradient, self.applied_forces, strict=True)
        return tuple(slope + force - self._convective(p) for p, slope, force in parts)

    @property
    def _v(self) -> list[Basic]:
        return [self.equations.v[i] for i in self.partition.independent]

    def _slope(self, expression: Basic, k: int) -> Basic:
        """Return ∂/∂q_k, where named coordinates are functions of q_k."""
        q = self.equations.q
        terms = [derivative(expression, q[self.partition.independent[k]])]
        terms += [
            derivative(expression, q[i]) * self.jacobian[i][k]
            for i in self.named
            if k in self.jacobian[i] and q[i] in expression.free_symbols
        ]
        return se.Add(*terms)

    def _convective(self, expression: Basic) -> Basic:
        """Return the time derivative without accelerations."""
        q = self.equations.q
        terms = [derivative(expression, symbols.TIME)]
        terms += [
            derivative(expression, q[i]) * self._drift[i]
            for i in self.named
            if q[i] in expression.free_symbols
        ]
        terms += [self._slope(expression, k) * v for k, v in enumerate(self._v)]
        return se.Add(*terms)


def second_kind(partition: CoordinatePartition, written_out: bool = False) -> SecondKind:
    """Derive Lagrange's equations of the second kind.

    Parameters
    ----------
    partition : CoordinatePartition
    written_out : bool
        Whether long closed forms of dependent coordinates are also substituted into L.

    Returns
    -------
    SecondKind

    Raises
    ------
    UsageError
        A constraint is nonholonomic.
    """
    e = partition.equations
    others = [c.constraint for c in e.constraints if c.position is None]
    if others:
        listed = ", ".join(f"`{c.name}`" for c in others[:6])
        raise UsageError(
            Diagnostic(
                "not-supported",
                f"the second kind needs holonomic constraints, but {listed}"
                f" {'is' if len(others) == 1 else 'are'} nonholonomic",
                others[0].location,
                "use --kind maggi",
            )
        )
    blocks = []
    for block in partition.blocks:
        # the sides as written, because their squares are recognized
        sides = [e.constraints[i].constraint.expression for i in block.rows]
        unknowns = [e.q[i] for i in block.columns]
        solutions = solve(sides, unknowns, lambda x: number(x, partition.values))
        blocks.append(SolvedBlock(block, tuple(solutions)))
    return SecondKind(partition, tuple(blocks), written_out)


def second_kind_is_short(partition: CoordinatePartition) -> bool:
    """Whether the second kind exists, reduces the equations, and can be written out briefly."""
    constraints = partition.equations.constraints
    if not partition.dependent or any(c.position is None for c in constraints):
        return False
    if not partition.independent or len(partition.dependent) > _FEW:
        return False
    second = second_kind(partition)
    return not second.named and sum(map(se.count_ops, second.forcing)) < _LONG
