"""Lagrange's equations of the first kind.

With L = T − V and p = ∂L/∂v, every system is brought to

    M a = f + Bᵀλ,  B a = γ,  φ = 0,  ψ = 0,

M = ∂p/∂v,  f = ∂L/∂q − (∂p/∂q) v − ∂p/∂t + Q,  B = ∂ψ/∂v,  γ = −(∂ψ/∂q) v − ∂ψ/∂t,

where ψ is φ̇ for a holonomic constraint (seed equations 8.78 to 8.86). Derivatives are taken with
plain symbols q, v, t, and only where a symbol occurs: the terms of a sum are sorted by the
coordinates that they know, so that N bodies cost N times one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.equations.partials import by_symbol, partial, terms_of
from lagcli.model import model as symbols
from lagcli.model.functions import derivative
from lagcli.model.model import Constraint, Model

ZERO = se.Integer(0)
Row = Mapping[int, Basic]  # the nonzero entries, by column


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
        The nonzero b_i, by coordinate (row β of B).
    drift : expression
        b_0: what of ψ does not depend on v.
    rhs : expression
        γ of B a = γ.
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


@dataclass(frozen=True, eq=False)
class Equations:
    """The system of a model in symbols.

    k coordinates, r constraints.

    Parameters
    ----------
    model : Model
    q, v, a : tuples of k symbols
    lagrangian : expression
        L = T − V.
    kinetic, potential : expressions
        T and V; of a model written with L, the part of L quadratic in v and minus the rest.
    momenta : k expressions
        p_i = ∂L/∂v_i.
    gradient : k expressions
        ∂L/∂q_i.
    momentum_rates : k expressions
        d/dt p_i, with accelerations.
    applied_forces : k expressions
        Q_i, the Rayleigh dissipation's −∂D/∂v_i included.
    mass_matrix : k mappings of int to expression
        The nonzero entries of M, by row and column; both triangles.
    forcing : k expressions
        f_i.
    constraints : r ConstraintEquations
    energy : expression
        v·p − L, which is T + V when T is a quadratic form in v.
    time_power : expression
        −∂L/∂t.
    outputs : mapping of str to expression
        In q, v, a, t, parameters and multipliers.
    """

    model: Model
    q: tuple[Basic, ...]
    v: tuple[Basic, ...]
    a: tuple[Basic, ...]
    lagrangian: Basic
    kinetic: Basic
    potential: Basic
    momenta: tuple[Basic, ...]
    gradient: tuple[Basic, ...]
    momentum_rates: tuple[Basic, ...]
    applied_forces: tuple[Basic, ...]
    mass_matrix: tuple[Row, ...]
    forcing: tuple[Basic, ...]
    constraints: tuple[ConstraintEquation, ...]
    energy: Basic
    time_power: Basic
    outputs: Mapping[str, Basic]

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
    names = model.coordinate_names
    q, v, a = (
        tuple(map(f, names)) for f in (symbols.coordinate, symbols.velocity, symbols.acceleration)
    )
    motion = _Motion(q, v, a)
    lagrangian = -model.potential if model.kinetic is None else model.kinetic - model.potential
    terms = by_symbol(terms_of(lagrangian))
    momenta = tuple(partial(terms.get(x, ()), x) for x in v)
    gradient = tuple(partial(terms.get(x, ()), x) for x in q)
    dissipation = by_symbol(terms_of(model.dissipation or ZERO))
    applied = tuple(
        model.applied_forces.get(name, ZERO) - partial(dissipation.get(x, ()), x)
        for name, x in zip(names, v, strict=True)
    )
    mass, forcing, rates = [], [], []
    for p, g, force in zip(momenta, gradient, applied, strict=True):
        row, convective, explicit = motion.split(p)
        mass.append(row)
        forcing.append(g + force - convective - explicit)
        rates.append(se.Add(*[m * a[j] for j, m in row.items()], convective, explicit))
    constraints = tuple(motion.constraint(c) for c in model.constraints)
    kinetic, potential = model.kinetic, model.potential
    if kinetic is None:
        kinetic = se.Add(
            *[m * v[i] * v[j] / 2 for i, row in enumerate(mass) for j, m in row.items()]
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
        momenta=momenta,
        gradient=gradient,
        momentum_rates=tuple(rates),
        applied_forces=applied,
        mass_matrix=tuple(mass),
        forcing=tuple(forcing),
        constraints=constraints,
        energy=se.Add(*[x * p for x, p in zip(v, momenta, strict=True)], -lagrangian),
        time_power=-partial(terms.get(symbols.TIME, ()), symbols.TIME),
        outputs=_outputs(model, constraints),
    )


class _Motion:
    """Derivatives along the motion, touching only the symbols that occur."""

    def __init__(self, q: tuple[Basic, ...], v: tuple[Basic, ...], a: tuple[Basic, ...]):
        self.q, self.v, self.a = q, v, a
        self.positions = {x: i for i, x in enumerate(q)}
        self.rates = {x: i for i, x in enumerate(v)}

    def occurring(self, expression: Basic) -> tuple[list[int], list[int], bool]:
        """Return the indices of the q and v that occur, and whether t does."""
        free = expression.free_symbols
        return (
            sorted(self.positions[s] for s in free if s in self.positions),
            sorted(self.rates[s] for s in free if s in self.rates),
            symbols.TIME in free,
        )

    def split(self, p: Basic) -> tuple[dict[int, Basic], Basic, Basic]:
        """Return ∂p/∂v by column, (∂p/∂q) v, and ∂p/∂t."""
        positions, rates, timed = self.occurring(p)
        terms = by_symbol(terms_of(p))
        row = {j: partial(terms[self.v[j]], self.v[j]) for j in rates}
        convective = se.Add(*[partial(terms[self.q[j]], self.q[j]) * self.v[j] for j in positions])
        explicit = partial(terms[symbols.TIME], symbols.TIME) if timed else ZERO
        return {j: m for j, m in row.items() if m != 0}, convective, explicit

    def slope(self, expression: Basic, j: int) -> Basic:
        """Return ∂/∂v_j of an expression affine in v; written out only where that is not seen."""
        slope = derivative(expression, self.v[j])
        return se.expand(slope) if slope.free_symbols & set(self.v) else slope

    def constraint(self, constraint: Constraint) -> ConstraintEquation:
        expression = constraint.expression
        if constraint.kind == "holonomic":
            positions, _, timed = self.occurring(expression)
            terms = by_symbol(terms_of(expression))
            row = {j: partial(terms[self.q[j]], self.q[j]) for j in positions}
            drift = partial(terms[symbols.TIME], symbols.TIME) if timed else ZERO
            position: Basic | None = expression
        else:
            _, rates, _ = self.occurring(expression)
            row = {j: self.slope(expression, j) for j in rates}
            drift = expression.subs({self.v[j]: ZERO for j in rates})
            position = None
        row = {j: b for j, b in row.items() if b != 0}
        velocity = se.Add(*[b * self.v[j] for j, b in row.items()], drift)
        _, convective, explicit = self.split(velocity)
        return ConstraintEquation(
            constraint, position, velocity, row, drift, -convective - explicit
        )


def _outputs(model: Model, constraints: tuple[ConstraintEquation, ...]) -> dict[str, Basic]:
    """Return the outputs with the constraint forces written as λ b."""
    if not model.outputs:
        return {}
    forces: dict[Basic, Basic] = {}
    for j, name in enumerate(model.coordinate_names):
        parts = []
        for c in constraints:
            label = c.constraint.name
            part = symbols.multiplier(label) * c.row[j] if j in c.row else ZERO
            forces[symbols.constraint_force(name, label)] = part
            parts.append(part)
        forces[symbols.constraint_force(name)] = se.Add(*parts)
    found = {}
    for name, expression in model.outputs.items():
        used = {s: forces[s] for s in expression.free_symbols if s in forces}
        found[name] = expression.subs(used) if used else expression
    return found
