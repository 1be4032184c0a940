"""Jacobians of the equations of motion, for implicit methods.

Along the motion, G = f − M a + Bᵀλ and Γ = γ − B a vanish. Their derivatives with respect to q, v
and t at fixed a and λ determine the derivatives of a and λ:

    M δa − Bᵀ δλ = G_q δq + G_v δv + G_t δt,  B δa = Γ_q δq + Γ_v δv + Γ_t δt.

Only nonzero derivatives are formed, so that the cost is linear in the number of bodies.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import symengine as se
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

    nq coordinates, nc constraints; in q, v, a, t, multipliers and parameters.

    Parameters
    ----------
    force : nq Gradients
        Gradients of G = f − M a + Bᵀλ.
    rhs : nc Gradients
        Gradients of Γ = γ − B a.
    power : Gradient
        Gradient of the power of all forces, Q·v − ∂L/∂t + λ·(B v).
    """

    force: tuple[Gradient, ...]
    rhs: tuple[Gradient, ...]
    power: Gradient


def differentiate(equations: Equations, without: Container[int] = ()) -> Jacobians:
    """Differentiate the equations of motion.

    Parameters
    ----------
    equations : Equations
    without : container of int, optional
        Constraints whose Γ is not differentiated: its gradient is left empty.

    Returns
    -------
    Jacobians
    """
    eq = equations
    force, rhs = residual_terms(eq)
    power = [q * v for q, v in zip(eq.applied_forces, eq.v, strict=True)]
    power += [v * x for v, reaction in zip(eq.v, _reactions(eq), strict=True) for x in reaction]
    columns = {x: i for i, x in enumerate((*eq.q, *eq.v, TIME))}
    differ = partial(_gradient, Motion.of(eq.model), columns)
    return Jacobians(
        force=tuple(differ(parts) for parts in force),
        rhs=tuple(differ([] if i in without else parts) for i, parts in enumerate(rhs)),
        power=differ([*power, eq.time_power]),
    )


def residual_terms(equations: Equations) -> tuple[list[list[Basic]], list[list[Basic]]]:
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


@dataclass(frozen=True, eq=False)
class ParameterJacobians:
    """Derivatives of the equations with respect to parameters, at fixed t, q, v, a and λ.

    nq coordinates, nc constraints, nh of them holonomic. Each row contains the nonzero derivatives
    by the number of the parameter.

    Parameters
    ----------
    parameters : tuple of str
        Names, in the order of the numbers.
    force : nq rows
        ∂G/∂p of G = f − M a + Bᵀλ.
    rhs : nc rows
        ∂Γ/∂p of Γ = γ − B a.
    position : nh rows
        ∂φ/∂p.
    velocity : nc rows
        ∂ψ/∂p.
    outputs : mapping of str to row
        Derivatives of the model's outputs.
    """

    parameters: tuple[str, ...]
    force: tuple[Row, ...]
    rhs: tuple[Row, ...]
    position: tuple[Row, ...]
    velocity: tuple[Row, ...]
    outputs: dict[str, Row]


def differentiate_parameters(
    equations: Equations, parameters: Sequence[str], without: Container[int] = ()
) -> ParameterJacobians:
    """Differentiate the equations of motion with respect to parameters.

    Parameters
    ----------
    equations : Equations
    parameters : sequence of str
        Names of the model's parameters. Parameters that depend on others count as independent: the
        caller applies the chain rule (`lagcli.simulations.directions`).
    without : container of int, optional
        Constraints whose Γ is not differentiated: its row is left empty.

    Returns
    -------
    ParameterJacobians

    Raises
    ------
    KeyError
        The model has no such parameter.
    """
    for name in parameters:
        if name not in equations.model.parameters:
            raise KeyError(name)
    eq = equations
    columns = {se.Symbol(name): i for i, name in enumerate(parameters)}
    rows = partial(Motion.of(eq.model).row, columns=columns)
    force, rhs = residual_terms(eq)
    return ParameterJacobians(
        parameters=tuple(parameters),
        force=tuple(rows(parts) for parts in force),
        rhs=tuple(rows([] if i in without else parts) for i, parts in enumerate(rhs)),
        position=tuple(rows([c.position]) for c in eq.constraints if c.position is not None),
        velocity=tuple(rows([c.velocity]) for c in eq.constraints),
        outputs={name: rows([x]) for name, x in eq.outputs.items()},
    )


Rates = Mapping[str, Basic]  # ∂p/∂θ by parameter, in symbols of parameters


class Variations(NamedTuple):
    """The symbols of the derivatives of the motion, for each direction.

    Parameters
    ----------
    positions, rates, accelerations : tuples of nq symbols, by direction
        s, ṡ and s̈.
    multipliers : tuples of nc symbols, by direction
        λ_θ.
    """

    positions: tuple[tuple[Basic, ...], ...]
    rates: tuple[tuple[Basic, ...], ...]
    accelerations: tuple[tuple[Basic, ...], ...]
    multipliers: tuple[tuple[Basic, ...], ...]


def variations_of(equations: Equations, directions: int) -> Variations:
    """Return the symbols of the derivatives in so many directions."""
    eq = equations
    return Variations(
        *(
            tuple(
                tuple(se.Symbol(f"d{x.name}/d{number}") for x in symbols)
                for number in range(directions)
            )
            for symbols in (eq.q, eq.v, eq.a, eq.multipliers)
        )
    )


@dataclass(frozen=True, eq=False)
class VariationalEquations:
    """The right sides of the variational equations, for each direction.

    nq coordinates, nc constraints, nh of them holonomic.

    Parameters
    ----------
    force : tuples of nq expressions, by direction
        G_q s + G_v ṡ + G_θ.
    rhs : tuples of nc expressions, by direction
        Γ_q s + Γ_v ṡ + Γ_θ.
    position : tuples of nh expressions, by direction
        φ_q s + φ_θ.
    drift : tuples of nc expressions, by direction
        ψ_q s + ψ_θ.
    """

    force: tuple[tuple[Basic, ...], ...]
    rhs: tuple[tuple[Basic, ...], ...]
    position: tuple[tuple[Basic, ...], ...]
    drift: tuple[tuple[Basic, ...], ...]


def variational_equations(
    equations: Equations,
    variations: Variations,
    directions: Sequence[Rates],
    without: Container[int] = (),
) -> VariationalEquations:
    """Derive the variational equations.

    Parameters
    ----------
    equations : Equations
    variations : Variations
        The symbols in all directions.
    directions : sequence of mappings of str to expression
        ∂p/∂θ of the parameters that each direction changes.
    without : container of int, optional
        Constraints whose Γ is not differentiated: 0 stands in its place.

    Returns
    -------
    VariationalEquations
    """
    eq, motion = equations, Motion.of(equations.model)
    changed = [p for p in eq.model.parameters if any(p in rates for rates in directions)]
    partial = differentiate_parameters(eq, changed, without)
    jacobians = differentiate(eq, without)
    velocity = [motion.slopes(c.velocity).by_position for c in eq.constraints]
    holonomic = [c for c in eq.constraints if c.position is not None]
    blocks: dict[str, list[tuple[Basic, ...]]] = {
        name: [] for name in VariationalEquations.__dataclass_fields__
    }
    for s, u, rates in zip(variations.positions, variations.rates, directions, strict=True):
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

        blocks["force"].append(tuple(map(along, jacobians.force, partial.force)))
        blocks["rhs"].append(tuple(map(along, jacobians.rhs, partial.rhs)))
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
    variations: Variations,
    directions: Sequence[Rates],
) -> tuple[tuple[Basic, ...], ...]:
    """Return the derivatives of expressions along the motion, by direction.

    Parameters
    ----------
    expressions : sequence of expressions
        In t, q, v, a, λ and parameters.
    equations, variations, directions
        Of one model; see `variations_of` and `variational_equations`.

    Returns
    -------
    tuples of expressions, by direction
        Also in s, ṡ, s̈ and λ_θ.
    """
    eq, motion = equations, Motion.of(equations.model)
    symbols = (*eq.q, *eq.v, *eq.a, *eq.multipliers)
    slopes = []
    for rates, *changes in zip(directions, *variations, strict=True):
        weights = dict(zip(symbols, (x for part in changes for x in part), strict=True))
        weights |= {se.Symbol(name): rate for name, rate in rates.items()}
        slopes.append(
            tuple(
                se.Add(*[motion.diff(x, y) * weights[y] for y in x.free_symbols if y in weights])
                for x in expressions
            )
        )
    return tuple(slopes)


def _explicit(row: Row, weights: Mapping[int, Basic]) -> list[Basic]:
    """Return the terms ∂/∂p ∂p/∂θ."""
    return [x * weights[i] for i, x in row.items() if i in weights]
