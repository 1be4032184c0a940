"""The variational equations: derivatives of the motion with respect to parameters.

With s = ∂q/∂θ along a motion,

    M s̈ − Bᵀ λ_θ = G_q s + G_v ṡ + G_θ,  B s̈ = Γ_q s + Γ_v ṡ + Γ_θ,
    φ_q s + φ_θ = 0,  B ṡ + ψ_q s + ψ_θ = 0,

G = f − M a + Bᵀλ and Γ = γ − B a at fixed a and λ: the matrix is that of the accelerations. A
direction θ changes parameters at given rates ∂p/∂θ; an initial value changes none.

References
----------
E. J. Haug, R. Wehage and N. C. Barman, Design sensitivity analysis of planar mechanism and machine
dynamics, J. Mech. Des. 103 (1981), doi:10.1115/1.3254955.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.jacobians import Gradient, differentiate
from lagcli.equations.derivation.lagrange import Equations, Row
from lagcli.equations.derivation.motion import Motion
from lagcli.equations.derivation.parameter_jacobians import differentiate_parameters

Rates = Mapping[str, Basic]  # ∂p/∂θ by parameter, in symbols of parameters


@dataclass(frozen=True, eq=False)
class VariationalEquations:
    """The right sides of the variational equations, for each direction.

    k coordinates, r constraints, h of them holonomic.

    Parameters
    ----------
    positions, rates : tuples of k symbols, by direction
        s and ṡ.
    accelerations, multipliers : tuples of k and r symbols, by direction
        s̈ and λ_θ.
    force : tuples of k expressions, by direction
        G_q s + G_v ṡ + G_θ.
    rhs : tuples of r expressions, by direction
        Γ_q s + Γ_v ṡ + Γ_θ.
    position : tuples of h expressions, by direction
        φ_q s + φ_θ.
    drift : tuples of r expressions, by direction
        ψ_q s + ψ_θ.
    """

    positions: tuple[tuple[Basic, ...], ...]
    rates: tuple[tuple[Basic, ...], ...]
    accelerations: tuple[tuple[Basic, ...], ...]
    multipliers: tuple[tuple[Basic, ...], ...]
    force: tuple[tuple[Basic, ...], ...]
    rhs: tuple[tuple[Basic, ...], ...]
    position: tuple[tuple[Basic, ...], ...]
    drift: tuple[tuple[Basic, ...], ...]


def variational_equations(
    equations: Equations, directions: Sequence[Rates]
) -> VariationalEquations:
    """Derive the variational equations.

    Parameters
    ----------
    equations : Equations
    directions : sequence of mappings of str to expression
        ∂p/∂θ of the parameters that each direction changes.

    Returns
    -------
    VariationalEquations
    """
    eq, motion = equations, Motion.of(equations.model)
    changed = [p for p in eq.model.parameters if any(p in rates for rates in directions)]
    partial = differentiate_parameters(eq, changed)
    found = differentiate(eq)
    velocity = [motion.slopes(c.velocity).by_position for c in eq.constraints]
    holonomic = [c for c in eq.constraints if c.position is not None]
    blocks: dict[str, list[tuple[Basic, ...]]] = {
        name: [] for name in VariationalEquations.__dataclass_fields__
    }
    for number, rates in enumerate(directions):
        s, u, a = (
            tuple(se.Symbol(f"d{x.name}/d{number}") for x in symbols)
            for symbols in (eq.q, eq.v, eq.a)
        )
        multipliers = tuple(se.Symbol(f"d{x.name}/d{number}") for x in eq.multipliers)
        weights = {i: rates[name] for i, name in enumerate(changed) if name in rates}

        def along(
            gradient: Gradient,
            explicit: Row,
            s: tuple[Basic, ...] = s,
            u: tuple[Basic, ...] = u,
            weights: Mapping[int, Basic] = weights,
        ) -> Basic:
            terms = [x * s[j] for j, x in gradient.position.items()]
            terms += [x * u[j] for j, x in gradient.velocity.items()]
            return se.Add(*terms, *_explicit(explicit, weights))

        blocks["positions"].append(s)
        blocks["rates"].append(u)
        blocks["accelerations"].append(a)
        blocks["multipliers"].append(multipliers)
        blocks["force"].append(tuple(map(along, found.force, partial.force)))
        blocks["rhs"].append(tuple(map(along, found.rhs, partial.rhs)))
        blocks["position"].append(
            tuple(
                se.Add(*[x * s[j] for j, x in c.row.items()], *_explicit(row, weights))
                for c, row in zip(holonomic, partial.position, strict=True)
            )
        )
        blocks["drift"].append(
            tuple(
                se.Add(*[x * s[j] for j, x in slopes.items()], *_explicit(row, weights))
                for slopes, row in zip(velocity, partial.velocity, strict=True)
            )
        )
    return VariationalEquations(**{name: tuple(rows) for name, rows in blocks.items()})


def derivatives_of(
    expressions: Sequence[Basic],
    equations: Equations,
    variations: VariationalEquations,
    directions: Sequence[Rates],
) -> tuple[tuple[Basic, ...], ...]:
    """Return the derivatives of expressions along the motion, by direction.

    Parameters
    ----------
    expressions : sequence of expressions
        In t, q, v, a, λ and parameters.
    equations, variations, directions
        Of one model; see `variational_equations`.

    Returns
    -------
    tuples of expressions, by direction
        Also in s, ṡ, s̈ and λ_θ.
    """
    eq, motion = equations, Motion.of(equations.model)
    symbols = (*eq.q, *eq.v, *eq.a, *eq.multipliers)
    found = []
    for rates, *changes in zip(
        directions,
        variations.positions,
        variations.rates,
        variations.accelerations,
        variations.multipliers,
        strict=True,
    ):
        weights = dict(zip(symbols, (x for part in changes for x in part), strict=True))
        weights |= {se.Symbol(name): rate for name, rate in rates.items()}
        found.append(
            tuple(
                se.Add(*[motion.diff(x, y) * weights[y] for y in x.free_symbols if y in weights])
                for x in expressions
            )
        )
    return tuple(found)


def _explicit(row: Row, weights: Mapping[int, Basic]) -> list[Basic]:
    """Return the terms ∂/∂p ∂p/∂θ."""
    return [x * weights[i] for i, x in row.items() if i in weights]
