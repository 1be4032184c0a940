"""One degree of freedom with velocity ratios.

With one independent coordinate q and constraints without time, each coordinate u has a velocity
ratio k_u = du/dq, with u̇ = k_u q̇ and ü = k_u q̈ + k_u′ q̇². If T = ½ v·M v,

    J q̈ + ½ J′ q̇² = Σ_u k_u (Q_u − ∂V/∂u),   J = k·M k,   J′ = dJ/dq.

The ratios are solved from the differentiated constraints, and their derivatives from B k′ = γ, the
constraints differentiated twice with k in place of the velocities.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.motion import TWO, ZERO
from lagcli.equations.reduction.partition import CoordinatePartition
from lagcli.model.expression.functions import derivative
from lagcli.model.model import TIME


@dataclass(frozen=True, eq=False)
class VelocityRatios:
    """A system with one degree of freedom in terms of its velocity ratios.

    Parameters
    ----------
    independent : int
        The independent coordinate.
    ratios, derivatives : mapping of int to (expression, expression)
        Numerators and denominators of k and k′ of the dependent coordinates, in the order in which
        they are solved, in terms of q and of the names of earlier ones.
    names, derivative_names : mapping of int to symbol
        Names of k and k′.
    inertia, inertia_rate : expression
        J and J′.
    force : expression
        The right side.
    """

    independent: int
    ratios: Mapping[int, tuple[Basic, Basic]]
    derivatives: Mapping[int, tuple[Basic, Basic]]
    names: Mapping[int, Basic]
    derivative_names: Mapping[int, Basic]
    inertia: Basic
    inertia_rate: Basic
    force: Basic


def velocity_ratios(partition: CoordinatePartition) -> VelocityRatios | None:
    """Return the equations of motion with velocity ratios.

    Parameters
    ----------
    partition : CoordinatePartition

    Returns
    -------
    VelocityRatios or None
        None if there is not one independent coordinate, no dependent one, time in a constraint, or
        terms of T that are not quadratic in the velocities.
    """
    e = partition.equations
    if len(partition.independent) != 1 or not partition.dependent:
        return None
    if any(c.rheonomic or c.position is None for c in e.constraints):
        return None
    rows = [se.Add(*[m * e.v[j] for j, m in row.items()]) for row in e.mass_matrix]
    if any(se.expand(p - x) != 0 for p, x in zip(e.momenta, rows, strict=True)):
        return None
    (free,) = partition.independent
    names = {r.coordinate: se.Symbol(f"\ufdd2{r.coordinate}") for r in partition.rates}
    primes = {r.coordinate: se.Symbol(f"\ufdd3{r.coordinate}") for r in partition.rates}
    ratio = {**names, free: se.Integer(1)}
    prime = {**primes, free: ZERO}
    at_ratios = {v: ratio[i] for i, v in enumerate(e.v)}
    ratios: dict[int, tuple[Basic, Basic]] = {}
    derivatives: dict[int, tuple[Basic, Basic]] = {}
    for rate in partition.rates:
        i, below = rate.coordinate, rate.denominator
        above = [x * ratio[j] for j, x in rate.numerators.items()]
        ratios[i] = se.Add(*above), below
        above = [x * prime[j] for j, x in rate.numerators.items()]
        above.append((rate.acceleration * below).subs(at_ratios))
        derivatives[i] = se.Add(*above), below
    inertia, changes = [], []
    for i, row in enumerate(e.mass_matrix):
        for j, m in row.items():
            inertia.append(m * ratio[i] * ratio[j])
            changes.append(TWO * m * ratio[i] * prime[j])
            slope = se.Add(*[derivative(m, q) * ratio[k] for k, q in enumerate(e.q)])
            changes.append(slope * ratio[i] * ratio[j])
    moving = {v: ratio[i] * e.v[free] for i, v in enumerate(e.v)}
    at_rest = e.lagrangian.subs(dict.fromkeys(e.v, ZERO))
    forces = [
        ratio[i] * (derivative(at_rest, q) + force.subs(moving))
        for i, (q, force) in enumerate(zip(e.q, e.applied_forces, strict=True))
    ]
    changed = se.Add(*changes)
    if TIME in changed.free_symbols:  # a mass that depends on time
        return None
    return VelocityRatios(
        free,
        ratios,
        derivatives,
        names,
        primes,
        se.Add(*inertia),
        changed,
        se.Add(*forces),
    )
