"""Integrals of integrable velocity constraints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import ConstraintEquation, Equations
from lagcli.equations.derivation.motion import ONE, ZERO
from lagcli.model.expression.algebra import is_zero
from lagcli.model.expression.functions import derivative
from lagcli.model.model import TIME

#: Largest number of operations of a form that is integrated; longer ones may take minutes.
_LARGEST = 200


@dataclass(frozen=True)
class FirstIntegral:
    """A function Φ(q, t) with dΦ/dt = μ ψ, which is constant on ψ = 0.

    Parameters
    ----------
    expression, factor : expressions
        Φ and the integrating factor μ.
    """

    expression: Basic
    factor: Basic


def first_integral(c: ConstraintEquation, equations: Equations) -> FirstIntegral | None:
    """Search for an integral of a velocity constraint that is integrable by itself.

    Simple integrating factors are tried: 1, and reciprocals of one coefficient, of its square and
    of products of two.

    Parameters
    ----------
    c : ConstraintEquation
    equations : Equations

    Returns
    -------
    FirstIntegral or None
        None if none was found; one may still exist.
    """
    form = {equations.q[j]: b for j, b in c.row.items()}
    if c.drift != 0:
        form[TIME] = c.drift
    if sum(se.count_ops(b) for b in form.values()) > _LARGEST:
        return None
    variables = (*equations.q, TIME)
    for factor in _factors(form):
        scaled = {x: se.expand(b * factor) for x, b in form.items()}
        if _closed(scaled, variables):
            potential = _potential(scaled)
            if potential is not None:
                return FirstIntegral(potential, factor)
    return None


def _factors(form: dict[Basic, Basic]) -> Iterator[Basic]:
    yield ONE
    coefficients = [b for b in dict.fromkeys(form.values()) if b.free_symbols]
    yield from (ONE / b for b in coefficients)
    yield from (ONE / b**2 for b in coefficients)
    yield from (ONE / (a * b) for a, b in combinations(coefficients, 2))


def _closed(form: dict[Basic, Basic], variables: tuple[Basic, ...]) -> bool:
    """Whether dω = 0."""
    inside = {s for b in form.values() for s in b.free_symbols}
    occurring = [x for x in variables if x in form or x in inside]
    return all(
        is_zero(derivative(form.get(x, ZERO), y) - derivative(form.get(y, ZERO), x))
        for x, y in combinations(occurring, 2)
    )


def _potential(form: dict[Basic, Basic]) -> Basic | None:
    """Return Φ with ∂Φ/∂x = ω_x, by integrating one variable after the other."""
    import sympy
    from symengine.lib.symengine_wrapper import sympy2symengine

    found = sympy.Integer(0)
    for x, b in form.items():
        symbol = x._sympy_()
        rest = sympy.simplify(b._sympy_() - sympy.diff(found, symbol))
        part = sympy.integrate(rest, symbol)
        if part.has(sympy.Integral):
            return None
        found += part
    potential = sympy2symengine(sympy.simplify(found))
    if all(is_zero(derivative(potential, x) - b) for x, b in form.items()):
        return potential
    return None
