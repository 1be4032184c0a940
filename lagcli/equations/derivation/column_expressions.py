"""The columns of results as expressions in t, q, v, a and λ."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import symengine as se
from symengine import Basic

from lagcli.columns import SCALARS
from lagcli.equations.derivation.lagrange import Equations
from lagcli.model.expression.functions import apply
from lagcli.model.model import multiplier

#: Symbols for the work of the powers since the first sample, and for the total energy there.
WORK, ENERGY_BEFORE = se.Symbol("#work"), se.Symbol("#before")

#: Columns that `lagcli.simulations.derived` computes from the entries of M and B.
FROM_ENTRIES = ("power_constraint", "power_friction", "energy_balance", "residual_equation")
#: Columns computed by the engine, in the order of its tape.
REPORTED = tuple(q.name for q in SCALARS if q.name not in FROM_ENTRIES)


def column_expression(equations: Equations, name: str) -> Basic:
    """Return the expression of a column with one number per sample.

    Parameters
    ----------
    equations : Equations
    name : str
        One of `lagcli.columns.SCALARS`.

    Returns
    -------
    expression
        Expression in t, q, v, a, λ, the parameters, and for the energy balance `WORK` and
        `ENERGY_BEFORE`.
    """
    return _EXPRESSIONS[name](equations)


def reported(equations: Equations) -> list[Basic]:
    """Return the expressions of the columns `REPORTED`."""
    return [column_expression(equations, name) for name in REPORTED]


def largest(values: Sequence[Basic]) -> Basic:
    """Return the largest magnitude; 0 for an empty sequence."""
    if not values:
        return se.Integer(0)
    return apply("max", *[apply("abs", x) for x in values])


def power_applied(eq: Equations) -> Basic:
    """Return Q·v."""
    return se.Add(*[q * v for q, v in zip(eq.applied_forces, eq.v, strict=True)])


def power_free(eq: Equations) -> Basic:
    """Return the part of Q·v that does not depend on multipliers."""
    return se.Add(*[q * v for q, v in zip(eq.free_forces, eq.v, strict=True)])


def _power_constraint(eq: Equations) -> Basic:
    forces = ((multiplier(c.constraint.name), c.row) for c in eq.constraints)
    power = se.Add(*[force * b * eq.v[j] for force, row in forces for j, b in row.items()])
    return power - _power_friction(eq)


def _power_friction(eq: Equations) -> Basic:
    limited = (c for c in eq.constraints if c.constraint.limit is not None)
    return se.Add(*[multiplier(c.constraint.name) * c.velocity for c in limited])


def _residual_equation(eq: Equations) -> Basic:
    rows = [
        [m * eq.a[j] for j, m in row.items()] + [-f, -own]
        for row, f, own in zip(eq.mass_matrix, eq.forcing, eq.reactive_forces, strict=True)
    ]
    for c in eq.constraints:
        for j, b in c.row.items():
            rows[j].append(-multiplier(c.constraint.name) * b)
    return largest([se.Add(*row) for row in rows])


_EXPRESSIONS: Mapping[str, Callable[[Equations], Basic]] = {
    "energy_kinetic": lambda eq: eq.kinetic,
    "energy_potential": lambda eq: eq.potential,
    "energy_total": lambda eq: eq.energy,
    "power_applied": power_applied,
    "power_constraint": _power_constraint,
    "power_friction": _power_friction,
    "power_time": lambda eq: eq.time_power,
    "energy_balance": lambda eq: eq.energy - WORK - ENERGY_BEFORE,
    "residual_equation": _residual_equation,
}
