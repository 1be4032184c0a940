"""Integrability of nonholonomic constraints by Frobenius' theorem."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import ConstraintEquation, Equations
from lagcli.equations.derivation.motion import ONE, ZERO
from lagcli.model.expression.algebra import cancel, is_zero, kinked_in
from lagcli.model.expression.functions import derivative
from lagcli.model.model import TIME

MAX_VARIABLES = 14  # the test loops over triples
POINTS = 3
TOLERANCE = 1e-9  # tolerance of a sum relative to its terms; rounding is about 1e-15


def integrable(c: ConstraintEquation, equations: Equations) -> bool | None:
    """Test ω∧dω = 0 for ω = Σ b_i dq_i + b_0 dt (Frobenius).

    If it holds, an integrating factor exists and the constraint also restricts the positions.

    Parameters
    ----------
    c : ConstraintEquation
        A nonholonomic constraint.
    equations : Equations

    Returns
    -------
    bool or None
        None if the constraint has too many variables for the test, or if it holds beside the ends
        of branches that may contradict it.

    Notes
    -----
    Each constraint is tested separately; several may be integrable together although none is by
    itself. Coefficients that do not vanish symbolically are tested at random points, with the
    model's parameter values.
    """
    form, variables = form_of(c, equations), (*equations.q, TIME)
    free = set().union(*(b.free_symbols for b in form.values()))
    present = [x for x in variables if x in free or x in form]
    if len(present) > MAX_VARIABLES:
        return None
    # ω∧dω contains the value of a coefficient of dx that depends on x alone, not its derivative
    alone = [x for x, b in form.items() if kinked_in(b, variables) and not _varies(b, x, present)]
    form |= {x: se.Symbol(f"\ufdd0{x}") for x in alone}
    values = {se.Symbol(n): se.RealDouble(x) for n, x in equations.model.parameter_values.items()}
    points = [values | point for point in _points([*present, *(form[x] for x in alone)])]
    if not all(_vanishes(list(terms), points) for terms in _coefficients(form, present)):
        return False
    return None if has_branches(c, equations) else True


def has_branches(c: ConstraintEquation, equations: Equations) -> bool:
    """Whether a coefficient of ω has branches and depends on variables besides its own.

    ω∧dω may vanish on one branch and not on others, or at their ends.
    """
    variables = (*equations.q, TIME)
    return any(
        kinked_in(b, variables) is not None and _varies(b, x, variables)
        for x, b in form_of(c, equations).items()
    )


def form_of(c: ConstraintEquation, equations: Equations) -> dict[Basic, Basic]:
    """Return the coefficients of ω by variable."""
    form = {equations.q[j]: b for j, b in c.row.items()}
    return form | {TIME: c.drift} if c.drift != 0 else form


def _varies(coefficient: Basic, own: Basic, variables: Sequence[Basic]) -> bool:
    """Whether a coefficient depends on variables besides its own."""
    return any(x != own for x in variables if x in coefficient.free_symbols)


def _coefficients(form: dict[Basic, Basic], variables: list[Basic]) -> Iterator[list[Basic]]:
    """Yield the coefficients of ω∧dω, each as a list of terms."""
    zero = se.Integer(0)
    for x, y, z in combinations(variables, 3):
        a, b, c = (form.get(s, zero) for s in (x, y, z))
        yield [
            *(a * derivative(c, y), -a * derivative(b, z)),
            *(b * derivative(a, z), -b * derivative(c, x)),
            *(c * derivative(b, x), -c * derivative(a, y)),
        ]


def _points(variables: list[Basic]) -> list[dict[Basic, Basic]]:
    source = random.Random(8)  # reproducible
    return [{x: se.RealDouble(source.uniform(0.3, 1.7)) for x in variables} for _ in range(POINTS)]


def _vanishes(terms: list[Basic], points: list[dict[Basic, Basic]]) -> bool:
    terms = [t for t in terms if t != 0]
    if not terms or se.expand(se.Add(*terms)) == 0:
        return True
    for point in points:
        try:
            values = [float(t.xreplace(point).n(53, real=True)) for t in terms]
        except RuntimeError:  # not real here
            continue
        if not cancel(values, TOLERANCE):
            return False
    return True


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


def first_integral(
    form: dict[Basic, Basic], variables: Sequence[Basic], divisors: Sequence[Basic] = ()
) -> FirstIntegral | None:
    """Search for an integral of a form that is integrable by itself.

    Simple integrating factors are tried: 1, and reciprocals of one coefficient, of its square and
    of products of two.

    Parameters
    ----------
    form : dict of symbol to expression
        The coefficients of ω = Σ b_i dq_i + b_0 dt, without zeros.
    variables : sequence of symbols
        Those of q and t that are not constant on the motions in question.
    divisors : sequence of expressions
        Reciprocals of other factors to try.

    Returns
    -------
    FirstIntegral or None
        None if none was found; one may still exist.
    """
    if sum(se.count_ops(b) for b in form.values()) > _LARGEST:
        return None
    for factor in _factors(form, divisors):
        scaled = {x: se.expand(b * factor) for x, b in form.items()}
        if _closed(scaled, variables):
            potential = _potential(scaled)
            if potential is not None:
                return FirstIntegral(potential, factor)
    return None


def _factors(form: dict[Basic, Basic], divisors: Sequence[Basic]) -> Iterator[Basic]:
    yield ONE
    yield from (ONE / x for x in divisors)
    coefficients = [b for b in dict.fromkeys(form.values()) if b.free_symbols]
    yield from (ONE / b for b in coefficients)
    yield from (ONE / b**2 for b in coefficients)
    yield from (ONE / (a * b) for a, b in combinations(coefficients, 2))


def _closed(form: dict[Basic, Basic], variables: Sequence[Basic]) -> bool:
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

    antiderivative = sympy.Integer(0)
    for x, b in form.items():
        symbol = x._sympy_()
        rest = sympy.simplify(b._sympy_() - sympy.diff(antiderivative, symbol))
        part = sympy.integrate(rest, symbol)
        if part.has(sympy.Integral):
            return None
        antiderivative += part
    potential = sympy2symengine(sympy.simplify(antiderivative))
    if all(is_zero(derivative(potential, x) - b) for x, b in form.items()):
        return potential
    return None
