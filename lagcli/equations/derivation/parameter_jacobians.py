"""Derivatives of the equations of motion with respect to parameters.

At fixed t, q, v, a and λ, parameters change G = f − M a + Bᵀλ, Γ = γ − B a, φ and ψ. Sensitivities
and continuation need these partial derivatives in addition to the `jacobians`:

    M a_p − Bᵀ λ_p = G_q q_p + G_v v_p + G_p,  B a_p = Γ_q q_p + Γ_v v_p + Γ_p,
    φ_q q_p + φ_p = 0,  ψ_q q_p + B v_p + ψ_p = 0.

Only nonzero derivatives are formed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import symengine as se

from lagcli.equations.derivation.jacobians import defects
from lagcli.equations.derivation.lagrange import Equations, Row
from lagcli.equations.derivation.motion import Motion


@dataclass(frozen=True, eq=False)
class ParameterJacobians:
    """Derivatives of the equations with respect to parameters, at fixed t, q, v, a and λ.

    k coordinates, r constraints, h of them holonomic; each row contains the nonzero derivatives by
    the number of the parameter.

    Parameters
    ----------
    parameters : tuple of str
        Names, in the order of the numbers.
    force : k rows
        ∂G/∂p of G = f − M a + Bᵀλ.
    rhs : r rows
        ∂Γ/∂p of Γ = γ − B a.
    position : h rows
        ∂φ/∂p.
    velocity : r rows
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


def differentiate_parameters(equations: Equations, parameters: Sequence[str]) -> ParameterJacobians:
    """Differentiate the equations of motion with respect to parameters.

    Parameters
    ----------
    equations : Equations
    parameters : sequence of str
        Names of the model's parameters. Parameters that depend on others count as independent: the
        caller applies the chain rule (`lagcli.simulations.directions`).

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
    force, rhs = defects(eq)
    return ParameterJacobians(
        parameters=tuple(parameters),
        force=tuple(rows(parts) for parts in force),
        rhs=tuple(rows(parts) for parts in rhs),
        position=tuple(rows([c.position]) for c in eq.constraints if c.position is not None),
        velocity=tuple(rows([c.velocity]) for c in eq.constraints),
        outputs={name: rows([x]) for name, x in eq.outputs.items()},
    )
