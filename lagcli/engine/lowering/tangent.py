"""The variational equations as tapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import symengine as se

from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.lowering.lower import magnitude
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.tape import Tape
from lagcli.equations.derivation.jacobians import (
    Rates,
    derivatives_of,
    variational_equations,
)
from lagcli.equations.derivation.lagrange import Equations


@dataclass(frozen=True, eq=False)
class TangentTapes:
    """The right sides of the variational equations in n directions.

    s and ṡ of all directions are consecutive, n blocks of nq numbers.

    Parameters
    ----------
    directions : int
        n.
    dynamics : Tape
        (t, q, s, v, ṡ, a, λ, parameters) → (force, rhs) of each direction: nq + nc numbers.
    constraint : Tape
        (t, q, s, v, ṡ, parameters) → (φ_q s + φ_θ of all directions, ψ_q s + ψ_θ of all
        directions, scales of the former, scales of B ṡ + ψ_q s + ψ_θ).
    """

    directions: int
    dynamics: Tape
    constraint: Tape

    @cached_property
    def constraint_at(self) -> ScalarTape:
        """The constraint tape for single states."""
        return ScalarTape(self.constraint)


def lower_tangent(equations: Equations, directions: Sequence[Rates]) -> TangentTapes:
    """Compile the variational equations to tapes.

    Parameters
    ----------
    equations : Equations
    directions : sequence of mappings of str to expression
        ∂p/∂θ, as for `variational_equations`.

    Returns
    -------
    TangentTapes
    """
    from lagcli.model.model import TIME

    eq = equations
    variational = variational_equations(eq, directions)
    parameters = [se.Symbol(name) for name in eq.model.parameters]
    functions = input_functions(eq.model)
    state = [TIME, *eq.q, *chain(*variational.positions), *eq.v, *chain(*variational.rates)]
    velocity = [
        se.Add(*[b * u[j] for j, b in c.row.items()], drift)
        for u, drifts in zip(variational.rates, variational.drift, strict=True)
        for c, drift in zip(eq.constraints, drifts, strict=True)
    ]
    positions, drifts = [*chain(*variational.position)], [*chain(*variational.drift)]
    pairs = zip(variational.force, variational.rhs, strict=True)
    return TangentTapes(
        directions=len(directions),
        dynamics=compile_tape(
            [x for force, rhs in pairs for x in (*force, *rhs)],
            [*state, *eq.a, *eq.multipliers],
            parameters,
            functions,
        ),
        constraint=compile_tape(
            [*positions, *drifts, *map(magnitude, positions), *map(magnitude, velocity)],
            state,
            parameters,
            functions,
        ),
    )


def lower_observed(
    equations: Equations, expressions: Sequence[se.Basic], directions: Sequence[Rates]
) -> tuple[Tape, Tape]:
    """Compile expressions and their derivatives along the motion to tapes.

    Parameters
    ----------
    equations : Equations
    expressions : sequence of expressions
        In t, q, v, a, λ and parameters.
    directions : sequence of mappings of str to expression
        ∂p/∂θ, as for `variational_equations`.

    Returns
    -------
    values : Tape
        (t, q, v, a, λ, parameters) → the expressions.
    derivatives : Tape
        (t, q, v, a, λ, s, ṡ, s̈, λ_θ, parameters) → their derivatives, by direction.
    """
    from lagcli.model.model import TIME

    eq = equations
    variations = variational_equations(eq, directions)
    parameters = [se.Symbol(name) for name in eq.model.parameters]
    functions = input_functions(eq.model)
    motion = [TIME, *eq.q, *eq.v, *eq.a, *eq.multipliers]
    parts = variations.positions, variations.rates, variations.accelerations
    changes = [x for part in (*parts, variations.multipliers) for x in chain(*part)]
    slopes = chain(*derivatives_of(expressions, eq, variations, directions))
    return (
        compile_tape(expressions, motion, parameters, functions),
        compile_tape(slopes, [*motion, *changes], parameters, functions),
    )
