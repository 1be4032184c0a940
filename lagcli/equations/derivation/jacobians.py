"""Jacobians of the equations of motion, for implicit methods.

Along the motion, G = f − M a + Bᵀλ and Γ = γ − B a vanish. Their derivatives with respect to q, v
and t at fixed a and λ determine the derivatives of a and λ:

    M δa − Bᵀ δλ = G_q δq + G_v δv + G_t δt,  B δa = Γ_q δq + Γ_v δv + Γ_t δt.

Only nonzero derivatives are formed, so that the cost is linear in the number of bodies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from symengine import Basic

from lagcli.equations.derivation.lagrange import Equations, Row
from lagcli.equations.derivation.motion import ZERO, Motion
from lagcli.model.model import TIME


@dataclass(frozen=True, eq=False)
class Gradient:
    """Nonzero partial derivatives of an expression with respect to q and v, and to t."""

    position: Row
    velocity: Row
    time: Basic


@dataclass(frozen=True, eq=False)
class Jacobians:
    """Derivatives of the equations of motion at fixed a and λ.

    k coordinates, r constraints; in q, v, a, t, multipliers and parameters.

    Parameters
    ----------
    force : k Gradients
        Gradients of G = f − M a + Bᵀλ.
    rhs : r Gradients
        Gradients of Γ = γ − B a.
    power : Gradient
        Gradient of the power of all forces, Q·v − ∂L/∂t + λ·(B v).
    """

    force: tuple[Gradient, ...]
    rhs: tuple[Gradient, ...]
    power: Gradient


def differentiate(equations: Equations) -> Jacobians:
    """Differentiate the equations of motion.

    Parameters
    ----------
    equations : Equations

    Returns
    -------
    Jacobians
    """
    eq = equations
    force, rhs = defects(eq)
    power = [q * v for q, v in zip(eq.applied_forces, eq.v, strict=True)]
    power += [v * x for v, reaction in zip(eq.v, _reactions(eq), strict=True) for x in reaction]
    columns = {x: i for i, x in enumerate((*eq.q, *eq.v, TIME))}
    differ = partial(_gradient, Motion.of(eq.model), columns)
    return Jacobians(
        force=tuple(differ(parts) for parts in force),
        rhs=tuple(differ(parts) for parts in rhs),
        power=differ([*power, eq.time_power]),
    )


def defects(equations: Equations) -> tuple[list[list[Basic]], list[list[Basic]]]:
    """Return the terms of G = f − M a + Bᵀλ and of Γ = γ − B a, by coordinate and constraint."""
    eq = equations
    force = [
        [f, own, *(-m * eq.a[j] for j, m in row.items()), *reaction]
        for f, own, row, reaction in zip(
            eq.forcing, eq.reactive_forces, eq.mass_matrix, _reactions(eq), strict=True
        )
    ]
    rhs = [[c.rhs, *(-b * eq.a[j] for j, b in c.row.items())] for c in eq.constraints]
    return force, rhs


def _reactions(eq: Equations) -> list[list[Basic]]:
    """Return the terms of Bᵀλ, by coordinate."""
    reactions: list[list[Basic]] = [[] for _ in eq.q]
    for multiplier, c in zip(eq.multipliers, eq.constraints, strict=True):
        for j, b in c.row.items():
            reactions[j].append(multiplier * b)
    return reactions


def _gradient(motion: Motion, columns: Mapping[Basic, int], parts: Sequence[Basic]) -> Gradient:
    """Return the gradient of a sum; the columns are those of q, v and t."""
    row, count = motion.row(parts, columns), len(motion.q)
    return Gradient(
        position={j: x for j, x in row.items() if j < count},
        velocity={j - count: x for j, x in row.items() if count <= j < 2 * count},
        time=row.get(2 * count, ZERO),
    )
