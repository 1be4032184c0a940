"""The variational equations as tapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import symengine as se

from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.lowering.lower import magnitude
from lagcli.engine.lowering.right_sides import long_constraints, residuals, rows_of, sources_of
from lagcli.engine.tape.differentiation import DerivativeBuilder
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.tape import Tape
from lagcli.equations.derivation.jacobians import (
    Rates,
    derivatives_of,
    variational_equations,
    variations_of,
)
from lagcli.equations.derivation.lagrange import ConstraintEquation, Equations


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

    eq, long = equations, long_constraints(equations)
    variations = variations_of(eq, len(directions))
    variational = variational_equations(eq, variations, directions, without=long)
    parameters = [se.Symbol(name) for name in eq.model.parameters]
    functions = input_functions(eq.model)
    state = [TIME, *eq.q, *chain(*variations.positions), *eq.v, *chain(*variations.rates)]
    velocity = [
        se.Add(*[b * u[j] for j, b in c.row.items()], drift)
        for u, drifts in zip(variations.rates, variational.drift, strict=True)
        for c, drift in zip(eq.constraints, drifts, strict=True)
    ]
    positions, drifts = [*chain(*variational.position)], [*chain(*variational.drift)]
    pairs = zip(variational.force, variational.rhs, strict=True)
    changes = [x for rates in directions for x in rates.values()] if long else []
    dynamics = compile_tape(
        [
            *(x for force, rhs in pairs for x in (*force, *rhs)),
            *sources_of(long),
            *rows_of(long),
            *changes,
        ],
        [*state, *eq.a, *eq.multipliers],
        parameters,
        functions,
    )
    return TangentTapes(
        directions=len(directions),
        dynamics=_with_derivatives(eq, dynamics, directions, long) if long else dynamics,
        constraint=compile_tape(
            [*positions, *drifts, *map(magnitude, positions), *map(magnitude, velocity)],
            state,
            parameters,
            functions,
        ),
    )


def _with_derivatives(
    eq: Equations,
    tape: Tape,
    directions: Sequence[Rates],
    long: Mapping[int, ConstraintEquation],
) -> Tape:
    """Return the tape of the right sides with those of constraints with a long γ.

    Parameters
    ----------
    eq : Equations
    tape : Tape
        Of the right sides, `sources_of` and `rows_of` these constraints, and all ∂p/∂θ.
    directions : sequence of mappings of str to expression
    long : mapping of int to ConstraintEquation
    """
    nq, nc, n = len(eq.q), len(eq.constraints), len(directions)
    builder, outputs = DerivativeBuilder.of(tape)
    right = n * (nq + nc)
    registers = iter(outputs[right:])
    q = range(1, 1 + nq)
    v = range(q.stop + n * nq, q.stop + n * nq + nq)
    a = range(v.stop + n * nq, v.stop + n * nq + nq)
    found = residuals(builder, long, registers, v, a)
    place = {name: i for i, name in enumerate(eq.model.parameters, a.stop + nc)}
    for k, rates in enumerate(directions):
        along = {place[name]: next(registers) for name in rates}
        for x in (*q, *v):
            along[x] = x + (1 + k) * nq  # s and ṡ follow q and v
        for i, register in zip(long, builder.along(found, along), strict=True):
            outputs[k * (nq + nc) + nq + i] = register
    return builder.finish(outputs).selected(range(right))


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
    variations = variations_of(eq, len(directions))
    parameters = [se.Symbol(name) for name in eq.model.parameters]
    functions = input_functions(eq.model)
    motion = [TIME, *eq.q, *eq.v, *eq.a, *eq.multipliers]
    changes = [x for part in variations for x in chain(*part)]
    slopes = chain(*derivatives_of(expressions, eq, variations, directions))
    return (
        compile_tape(expressions, motion, parameters, functions),
        compile_tape(slopes, [*motion, *changes], parameters, functions),
    )
