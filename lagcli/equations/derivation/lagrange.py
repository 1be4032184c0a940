"""Lagrange's equations of the first kind.

With L = T − V and p = ∂L/∂v, every system is brought to

    M a = f + Bᵀλ,  B a = γ,  φ = 0,  ψ = 0,

M = ∂p/∂v,  f = ∂L/∂q − (∂p/∂q) v − ∂p/∂t + Q,  B = ∂ψ/∂v,  γ = −(∂ψ/∂q) v − ∂ψ/∂t,

where ψ is φ̇ for a holonomic constraint (textbook equations 8.78 to 8.86). Derivatives are taken
with respect to plain symbols q, v, t, and only of terms in which the symbol occurs, so that the
cost is linear in the number of bodies. Terms quadratic in the velocities, which make up most
Lagrangians, are handled separately: see `quadratic`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import symengine as se
from symengine import Basic

from lagcli.columns import ColumnName, read_column_name
from lagcli.equations.derivation.motion import TWO, ZERO, Motion, addends
from lagcli.equations.derivation.quadratic import QuadraticForms, QuadraticPart, QuadraticTerm
from lagcli.equations.derivation.recursion import LEAST_RECURSIVE, Velocity, velocities_of
from lagcli.model import model as symbols
from lagcli.model.expression.algebra import expand_terms
from lagcli.model.model import Constraint, Model, check_is_model

Row = Mapping[int, Basic]  # nonzero entries by column


class ConstraintEquation(NamedTuple):
    """One constraint and its derivatives.

    Parameters
    ----------
    constraint : Constraint
    position : expression or None
        φ(q, t); None for a nonholonomic constraint.
    velocity : expression
        ψ(q, v, t) = Σ b_i v_i + b_0.
    row : mapping of int to expression
        The nonzero b_i = ∂ψ/∂v_i by coordinate: row β of B. They depend on v for a constraint that
        is nonlinear in v (Chetaev's rule).
    drift : expression
        b_0 = ψ − Σ b_i v_i; it does not depend on v for a constraint that is affine in v.
    rhs : expression
        γ in B a = γ.
    """

    constraint: Constraint
    position: Basic | None
    velocity: Basic
    row: Row
    drift: Basic
    rhs: Basic

    @property
    def rheonomic(self) -> bool:
        """Whether the constraint depends on time."""
        return symbols.TIME in self.constraint.expression.free_symbols


class RecursiveEquations(NamedTuple):
    """M and f by velocities that are defined one after the other; see `recursion`.

    Parameters
    ----------
    mass_matrix : nq mappings of int to expression
        M_0: nonzero entries by row and column.
    forcing : nq expressions
        f_0.
    velocities : tuple of Velocity
    """

    mass_matrix: tuple[Row, ...]
    forcing: tuple[Basic, ...]
    velocities: tuple[Velocity, ...]


@dataclass(frozen=True, eq=False)
class Equations:
    """Symbolic equations of motion of a model.

    nq coordinates, nc constraints.

    Parameters
    ----------
    model : Model
    q, v, a : tuples of nq symbols
    lagrangian : expression
        L = T − V.
    kinetic, potential : expressions
        T and V. If the model gives L: its part quadratic in v, and minus the rest.
    applied_forces : nq expressions
        Q_i, including −∂D/∂v_i of the Rayleigh dissipation function.
    free_forces, reactive_forces : nq expressions
        The terms of Q_i that do not depend on multipliers, and those that do.
    mass_matrix : nq mappings of int to expression
        Nonzero entries of M by row and column; both triangles.
    forcing : nq expressions
        f_i, without the terms that depend on multipliers.
    constraints : nc ConstraintEquations
    energy : expression
        v·p − L, which is T + V when T is a quadratic form in v.
    time_power : expression
        −∂L/∂t.
    outputs : mapping of str to expression
        In q, v, a, t, parameters and multipliers.
    recursive : RecursiveEquations, optional
        M and f by velocities that are defined one after the other, of a large model.
    """

    model: Model
    q: tuple[Basic, ...]
    v: tuple[Basic, ...]
    a: tuple[Basic, ...]
    lagrangian: Basic
    kinetic: Basic
    potential: Basic
    applied_forces: tuple[Basic, ...]
    free_forces: tuple[Basic, ...]
    reactive_forces: tuple[Basic, ...]
    mass_matrix: tuple[Row, ...]
    forcing: tuple[Basic, ...]
    constraints: tuple[ConstraintEquation, ...]
    energy: Basic
    time_power: Basic
    outputs: Mapping[str, Basic]
    recursive: RecursiveEquations | None = None

    def __repr__(self) -> str:
        return f"<Equations of {self.model!r}>"

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the model, which determines its equations."""
        return derive, (self.model,)

    @cached_property
    def _motion(self) -> Motion:
        return Motion.of(self.model)

    @property
    def switches(self) -> bool:
        """Whether constraints switch, events occur, or forces depend on multipliers."""
        return self.model.switches or any(x != ZERO for x in self.reactive_forces)

    @cached_property
    def momenta(self) -> tuple[Basic, ...]:
        """The k momenta p_i = ∂L/∂v_i."""
        terms = self._motion.by_symbol(addends(self.lagrangian))
        return tuple(self._motion.sum_diff(terms.get(x, ()), x) for x in self.v)

    @cached_property
    def gradient(self) -> tuple[Basic, ...]:
        """The k derivatives ∂L/∂q_i."""
        terms = self._motion.by_symbol(addends(self.lagrangian))
        return tuple(self._motion.sum_diff(terms.get(x, ()), x) for x in self.q)

    @cached_property
    def momentum_rates(self) -> tuple[Basic, ...]:
        """The k time derivatives d/dt p_i, including accelerations."""
        motion = self._motion
        rates = []
        for p in self.momenta:
            row = motion.row([p], motion.rate_columns)
            moving = [m * self.a[j] for j, m in row.items()]
            rates.append(se.Add(*moving, motion.convective(p)))
        return tuple(rates)

    @property
    def multipliers(self) -> tuple[Basic, ...]:
        """The symbols λ_β, in the model's order."""
        return tuple(symbols.multiplier(c.constraint.name) for c in self.constraints)


def derive(model: Model) -> Equations:
    """Derive Lagrange's equations of the first kind (8.85).

    Parameters
    ----------
    model : Model

    Returns
    -------
    Equations
    """
    check_is_model(model, "derive")
    motion = Motion.of(model)
    q, v, a = motion.q, motion.v, motion.a
    lagrangian = -model.potential if model.kinetic is None else model.kinetic - model.potential
    forms = QuadraticForms(motion)
    products, rest = forms.split(lagrangian)
    of_rest = _of_rest(rest, motion)
    quadratic = QuadraticPart(products, motion)
    dynamics = _dynamics(model, lagrangian, forms, quadratic, rest, of_rest)
    dissipation = motion.by_symbol(addends(model.dissipation or ZERO))
    constraints = tuple(_constraint(c, motion) for c in model.constraints)
    forces = with_forces(model, constraints, model.applied_forces)
    applied = tuple(
        forces.get(name, ZERO) - motion.sum_diff(dissipation.get(x, ()), x)
        for name, x in zip(model.coordinate_names, v, strict=True)
    )
    multipliers = frozenset(symbols.multiplier(c.name) for c in model.constraints)
    parts = [_by_multipliers(force, multipliers) for force in applied]
    free, reactive = zip(*parts, strict=True)
    kinetic, potential = model.kinetic, model.potential
    if kinetic is None:
        kinetic = se.Add(
            *[m * v[i] * v[j] / TWO for i, row in enumerate(dynamics.mass) for j, m in row.items()]
        )
        potential = kinetic - lagrangian
    return Equations(
        model=model,
        q=q,
        v=v,
        a=a,
        lagrangian=lagrangian,
        kinetic=kinetic,
        potential=potential,
        applied_forces=applied,
        mass_matrix=tuple(dynamics.mass),
        free_forces=free,
        reactive_forces=reactive,
        forcing=tuple(f + force for f, force in zip(dynamics.forcing, free, strict=True)),
        constraints=constraints,
        energy=dynamics.energy,
        time_power=dynamics.time_power,
        outputs=with_forces(model, constraints, model.outputs),
        recursive=_recursive(model, forms, products, of_rest, free, reactive),
    )


class _Dynamics(NamedTuple):
    """Terms derived from L: M, ∂L/∂q − (∂p/∂q) v − ∂p/∂t, v·p − L and −∂L/∂t."""

    mass: list[dict[int, Basic]]
    forcing: list[Basic]
    energy: Basic
    time_power: Basic


class _Rest(NamedTuple):
    """What the terms of L that are no products of velocities contribute.

    Parameters
    ----------
    mass : list of dict of int to expression
        To M, by row and column.
    forces : list of lists of expressions
        To ∂L/∂q − (∂p/∂q) v − ∂p/∂t, by coordinate.
    products : list of expressions
        The v_i p_i.
    """

    mass: list[dict[int, Basic]]
    forces: list[list[Basic]]
    products: list[Basic]


def _dynamics(
    model: Model,
    lagrangian: Basic,
    forms: QuadraticForms,
    quadratic: QuadraticPart,
    rest: list[Basic],
    contributions: _Rest,
) -> _Dynamics:
    motion = forms.motion
    timed = [term for term in addends(lagrangian) if motion.occurring(term).timed]
    # T may have terms without velocities, for instance with a prescribed rotation
    squares = quadratic.homogeneous and motion.by_symbol(rest).keys().isdisjoint(motion.v)
    if squares and model.kinetic is not None and _same(rest, forms.split(-model.potential)[1]):
        energy = [model.kinetic, model.potential]  # as written, so that they are shared
    else:
        energy = [quadratic.energy(), *(-term for term in rest), *contributions.products]
    return _Dynamics(
        *_mass_and_forces(quadratic, contributions),
        se.Add(*energy),
        -motion.sum_diff(timed, symbols.TIME),
    )


def _of_rest(rest: Sequence[Basic], motion: Motion) -> _Rest:
    terms = motion.by_symbol(rest)
    found = _Rest([{} for _ in motion.q], [[] for _ in motion.q], [])
    for i, (q, v) in enumerate(zip(motion.q, motion.v, strict=True)):
        if q in terms:
            found.forces[i].append(motion.sum_diff(terms[q], q))
        if v not in terms:
            continue
        p = motion.sum_diff(terms[v], v)
        found.forces[i].append(-motion.convective(p))
        found.products.append(v * p)
        found.mass[i].update(motion.row([p], motion.rate_columns))
    return found


def _mass_and_forces(
    quadratic: QuadraticPart, rest: _Rest
) -> tuple[list[dict[int, Basic]], list[Basic]]:
    """Return M, and ∂L/∂q − (∂p/∂q) v − ∂p/∂t."""
    mass = quadratic.mass_matrix()
    for row, more in zip(mass, rest.mass, strict=True):
        for j, m in more.items():
            row[j] = row.get(j, ZERO) + m
    forces = zip(quadratic.forces(), rest.forces, strict=True)
    return (
        [{j: m for j, m in sorted(row.items()) if m != ZERO} for row in mass],
        [se.Add(*parts, *more) for parts, more in forces],
    )


def _recursive(
    model: Model,
    forms: QuadraticForms,
    products: Sequence[QuadraticTerm],
    rest: _Rest,
    free: Sequence[Basic],
    reactive: Sequence[Basic],
) -> RecursiveEquations | None:
    """Return the recursive form of a large model; None if there is none."""
    if len(model.coordinate_names) < LEAST_RECURSIVE or model.switches:
        return None
    if not any(len(term.first.row) > 1 for term in products) or any(x != ZERO for x in reactive):
        return None
    velocities, others = velocities_of(products, forms)
    if not velocities:
        return None
    mass, forcing = _mass_and_forces(QuadraticPart(others, forms.motion), rest)
    total = tuple(f + force for f, force in zip(forcing, free, strict=True))
    return RecursiveEquations(tuple(mass), total, tuple(velocities))


def _by_multipliers(force: Basic, multipliers: frozenset[Basic]) -> tuple[Basic, Basic]:
    """Return the terms of a force that do not depend on multipliers, and those that do."""
    if multipliers.isdisjoint(force.free_symbols):
        return force, ZERO
    split: tuple[list[Basic], list[Basic]] = [], []
    for term in addends(force):
        split[not multipliers.isdisjoint(term.free_symbols)].append(term)
    return se.Add(*split[0]), se.Add(*split[1])


def _same(terms: list[Basic], others: list[Basic]) -> bool:
    return bool(se.Add(*terms) == se.Add(*others))


def _constraint(constraint: Constraint, motion: Motion) -> ConstraintEquation:
    expression = constraint.expression
    position: Basic | None = None
    if constraint.kind == "holonomic":
        position = expression
        acceleration = _second_rate(expression, motion)
        slopes = motion.slopes(expression)
        row, drift = slopes.by_position, slopes.by_time
    else:
        rates = motion.occurring(expression).rates
        row = {j: _slope(expression, j, motion) for j in rates}
        row = {j: b for j, b in row.items() if b != ZERO}
        if constraint.kind == "nonlinear":
            drift = expression - se.Add(*[b * motion.v[j] for j, b in row.items()])
        else:
            drift = expression.subs({motion.v[j]: ZERO for j in rates})
    velocity = expression
    if constraint.kind != "nonlinear":
        velocity = se.Add(*[b * motion.v[j] for j, b in row.items()], drift)
    if position is None:
        acceleration = motion.convective(velocity)
    return ConstraintEquation(constraint, position, velocity, row, drift, -acceleration)


def _slope(expression: Basic, j: int, motion: Motion) -> Basic:
    """Return ∂/∂v_j of an expression affine in v, expanded only if v does not cancel otherwise."""
    slope = motion.diff(expression, motion.v[j])
    return expand_terms(slope) if motion.occurring(slope).rates else slope


def _second_rate(expression: Basic, motion: Motion) -> Basic:
    """Return the part of φ̈ without accelerations; for a square c w², 2 c (ẇ² + w ẅ)."""
    terms: list[Basic] = []
    others: list[Basic] = []
    for term in addends(expression):
        factors = term.args if isinstance(term, se.Mul) else (term,)
        constant = [x for x in factors if motion.occurring(x).is_constant]
        moving = [x for x in factors if not motion.occurring(x).is_constant]
        square = len(moving) == 1 and isinstance(moving[0], se.Pow) and moving[0].args[1] == TWO
        if square and isinstance(moving[0].args[0], se.Add):
            w = moving[0].args[0]
            rate = motion.convective(w)
            terms.append(TWO * se.Mul(*constant) * (rate**TWO + w * motion.convective(rate)))
        else:
            others.append(term)
    rest = motion.convective(motion.convective(se.Add(*others)))
    return se.Add(*terms, rest)


def with_forces(
    model: Model, constraints: tuple[ConstraintEquation, ...], expressions: Mapping[str, Basic]
) -> dict[str, Basic]:
    """Substitute λ b for constraint forces in expressions."""
    forces = _ConstraintForces(model, constraints)
    columns = {}
    for name, expression in expressions.items():
        named = {s: forces.named(s.name) for s in expression.free_symbols}
        used = {s: forces.of(n) for s, n in named.items() if n is not None and n.coordinate}
        columns[name] = expression.subs(used) if used else expression
    return columns


class _ConstraintForces:
    """Constraint forces by their names in outputs, created on demand."""

    def __init__(self, model: Model, constraints: tuple[ConstraintEquation, ...]):
        self.positions = {name: j for j, name in enumerate(model.coordinate_names)}
        self.constraints = {c.constraint.name: c for c in constraints}
        self.by_coordinate: dict[int, list[ConstraintEquation]] = {}

    def named(self, text: str) -> ColumnName | None:
        """Return the column that a symbol names, if it is a constraint force."""
        if not text.startswith("Qc."):
            return None
        return read_column_name(text, self.positions, self.constraints)

    def of(self, name: ColumnName) -> Basic:
        """Return a constraint force, total or of one constraint, as λ b."""
        j = self.positions[name.coordinate]
        if name.constraint:
            return self.part(self.constraints[name.constraint], j)
        if not self.by_coordinate:
            for c in self.constraints.values():
                for i in c.row:
                    self.by_coordinate.setdefault(i, []).append(c)
        return se.Add(*[self.part(c, j) for c in self.by_coordinate.get(j, ())])

    def part(self, c: ConstraintEquation, j: int) -> Basic:
        """Return λ b of one constraint on one coordinate."""
        return symbols.multiplier(c.constraint.name) * c.row.get(j, ZERO)
