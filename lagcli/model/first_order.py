"""First-order coordinates: without kinetic energy, with q' given by a balance of forces."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import symengine as se
from symengine import Basic

from lagcli.model.draft import Draft
from lagcli.model.expression.algebra import is_zero, nonlinear_in
from lagcli.model.model import RATE, Constraint, Coordinate, coordinate, velocity

_ZERO = se.Integer(0)


def first_order_constraints(
    draft: Draft,
    coordinates: Iterable[Coordinate],
    lagrangian: Basic,
    dissipation: Basic | None,
    forces: Mapping[str, Basic],
    constraints: Iterable[Constraint],
) -> tuple[Constraint, ...]:
    """Return the equations of the first-order coordinates as constraints, with λ = 0.

    For a coordinate whose velocity is not in L, Lagrange's equation is the balance ψ = ∂L/∂q + Q −
    ∂D/∂q' = 0. With damping, ψ depends on q', and ψ = 0 determines it. As a constraint, ψ = 0 is
    enforced by consistent initialization and projection, and its derivative determines q''; the
    equation itself, 0 = ψ + λ ∂ψ/∂q', gives λ = 0.

    Coordinates in other constraints are not first-order: these constraints may determine them.

    Parameters
    ----------
    draft : Draft
    coordinates : iterable of Coordinate
    lagrangian : expression
        L = T − V.
    dissipation : expression or None
        D.
    forces : mapping of str to expression
        Q by coordinate.
    constraints : iterable of Constraint
    """
    constrained = set().union(*(c.expression.free_symbols for c in constraints))
    moving = lagrangian.free_symbols
    found = []
    for c in coordinates:
        q, v = coordinate(c.name), velocity(c.name)
        if v in moving or q in constrained or v in constrained:
            continue
        damping = _ZERO if dissipation is None else draft.names.slope(dissipation, v)
        balance = draft.names.slope(lagrangian, q) + forces.get(c.name, _ZERO) - damping
        if v not in balance.free_symbols or is_zero(draft.names.slope(balance, v)):
            continue
        rates = sorted((s for s in balance.free_symbols if s.name.endswith("'")), key=str)
        if any(s.name.startswith("lambda.") for s in balance.free_symbols):
            wrong, help_ = "depends on multipliers", "give the coordinate a mass"
        elif nonlinear_in(balance, rates) is not None:
            wrong = "is not linear in the velocities"
            help_ = "let D be quadratic in the velocities, or give the coordinate a mass"
        else:
            found.append(Constraint(c.name + RATE, "nonholonomic", balance, location=c.location))
            draft.names.constraints[c.name + RATE] = None
            continue
        assert c.location is not None
        draft.report.add(
            "first-order",
            f"the coordinate `{c.name}` has no kinetic energy, and the balance of forces that"
            f" determines `{c.name}'` {wrong}",
            c.location,
            help_,
        )
    return tuple(found)
