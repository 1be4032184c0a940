"""Kinetic energies whose velocities are defined one after the other.

Along a chain of links in angles, the velocity of each body is that of the body before it and a
term of its own angle. Written out, T = Σ c_k w_k²/2 has a full mass matrix. With the velocities
themselves as unknowns,

    w_k = w_p(k) + Σ_j d_kj v_j + d_k0,

M a = f is part of the sparse system

    [[M_0, 0, −dᵀ], [0, C, Dᵀ], [−d, D, 0]] [a; ẇ; −μ] = [f_0; 0; r],

in which row k of D has 1 at k and −1 at p(k), and r_k is the convective rate of the difference.
Elimination of ẇ and μ gives M = M_0 + Jᵀ C J, w = J v + …, and f.

A constraint far along the chain has a full row of B as well. With the velocities in it, the row is
Σ_k e_k w_k + Σ_j b_j v_j, of few terms; its right side is γ + Σ_k e_k ẇ_k without accelerations.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.motion import ONE, ZERO, Motion
from lagcli.equations.derivation.quadratic import AffineForm, QuadraticForms, QuadraticTerm

if TYPE_CHECKING:
    from lagcli.equations.derivation.lagrange import ConstraintEquation

#: Number of coordinates from which velocities are unknowns: fewer have a short elimination.
LEAST_RECURSIVE = 25


class Velocity(NamedTuple):
    """A velocity w_k = w_p + d.

    Parameters
    ----------
    factor : expression
        c_k.
    before : int or None
        p; None: w_k = d.
    difference : AffineForm
        d.
    row : mapping of int to expression
        The coefficients of w_k, by coordinate.
    """

    factor: Basic
    before: int | None
    difference: AffineForm
    row: Mapping[int, Basic]


class RowInVelocities(NamedTuple):
    """A row of B v as Σ_k e_k w_k + Σ_j b_j v_j.

    Parameters
    ----------
    factors : dict of int to expression
        The e_k, by velocity.
    rest : dict of int to expression
        The b_j, by coordinate.
    """

    factors: dict[int, Basic]
    rest: dict[int, Basic]


def velocities_of(
    terms: Sequence[QuadraticTerm], forms: QuadraticForms
) -> tuple[list[Velocity], list[QuadraticTerm]]:
    """Return the velocities that are defined one after the other, and the remaining terms.

    They are the w of terms c w²/2 with a constant c, each after another one with which it shares
    most coefficients.

    Parameters
    ----------
    terms : sequence of QuadraticTerm
    forms : QuadraticForms
        Recognizes their differences.
    """
    # fewer coefficients first
    order = sorted(range(len(terms)), key=lambda k: len(terms[k].first.row))
    chosen = [k for k in order if _may_follow(terms[k], forms)]
    number: dict[tuple[int, Basic], int] = {}
    bits = [
        sum(1 << number.setdefault(entry, len(number)) for entry in terms[k].first.row.items())
        for k in chosen
    ]
    before: dict[int, int] = {}
    seen = 0
    for n, own in enumerate(bits):
        least = own.bit_count()
        # of most large models, no velocity shares a coefficient with another one
        for m in reversed(range(n)) if own & seen else ():
            if (apart := (own ^ bits[m]).bit_count()) < least:
                before[n], least = m, apart
        seen |= own
    kept = sorted({*before, *before.values()})
    place = {n: k for k, n in enumerate(kept)}
    velocities = []
    for n in kept:
        whole, first = terms[chosen[n]].first, before.get(n)
        form = whole if first is None else forms.difference(whole, terms[chosen[first]].first)
        factor = 2 * terms[chosen[n]].factor
        previous = None if first is None else place[first]
        velocities.append(Velocity(factor, previous, form, whole.row))
    used = {chosen[n] for n in kept}
    return velocities, [term for k, term in enumerate(terms) if k not in used]


def _may_follow(term: QuadraticTerm, forms: QuadraticForms) -> bool:
    """Return whether a term is c w²/2 with a constant c, and ∂w/∂q − dw_q/dt is zero."""
    constant = forms.motion.occurring(term.factor).is_constant
    return term.first is term.second and constant and not term.first.curl and term.factor != ZERO


def in_velocities(
    constraints: Iterable[ConstraintEquation], velocities: Sequence[Velocity], motion: Motion
) -> list[RowInVelocities]:
    """Return the rows of B with velocities that are defined one after the other in them.

    Parameters
    ----------
    constraints : iterable of ConstraintEquation
    velocities : sequence of Velocity
    motion : Motion
    """
    introduced: dict[int, list[int]] = {}
    for k, w in enumerate(velocities):
        for j in w.difference.row:
            introduced.setdefault(j, []).append(k)
    found = []
    for constraint in constraints:
        factors: dict[int, Basic] = {}
        rest: dict[int, Basic] = {}
        for factor, row in _parts(constraint, motion):
            taken, left = _recognize(row, velocities, introduced, motion)
            for k, c in taken.items():
                factors[k] = factors.get(k, ZERO) + factor * c
            for j, x in left.items():
                rest[j] = rest.get(j, ZERO) + factor * x
        sparse = len(factors) + len(rest) < len(constraint.row)
        found.append(
            RowInVelocities(factors, rest) if sparse else RowInVelocities({}, dict(constraint.row))
        )
    return found


def _recognize(
    row: Mapping[int, Basic],
    velocities: Sequence[Velocity],
    introduced: Mapping[int, Sequence[int]],
    motion: Motion,
) -> tuple[dict[int, Basic], dict[int, Basic]]:
    """Return constant multiples of velocities that a row has, and the rest of it."""
    taken: dict[int, Basic] = {}
    rest = dict(row)
    # the last ones along the chain first
    for j in sorted(row, key=lambda j: -min(introduced.get(j, (-1,)))):
        if j not in rest:
            continue
        for k in introduced.get(j, ()):
            w = velocities[k].row
            c = rest[j] / w[j] if j in w else None
            if c is None or not motion.occurring(c).is_constant:
                continue
            both = {i: rest.get(i, ZERO) - c * w.get(i, ZERO) for i in {*rest, *w}}
            less = {i: x for i, x in both.items() if x != ZERO}
            if len(less) < len(rest):
                taken[k] = taken.get(k, ZERO) + c
                rest = less
                break
    return taken, rest


def _parts(
    constraint: ConstraintEquation, motion: Motion
) -> Iterator[tuple[Basic, Mapping[int, Basic]]]:
    """Yield factors and rows whose products add up to a row of B."""
    if constraint.position is not None:
        yield from _parts_of_rate(constraint.position, motion)
        return
    if constraint.constraint.kind == "nonlinear":
        yield ONE, constraint.row
        return
    plain: list[Basic] = []
    for term in se.Add.make_args(constraint.constraint.expression):
        moving = [x for x in se.Mul.make_args(term) if motion.occurring(x).rates]
        if len(moving) == 1 and isinstance(moving[0], se.Add):
            yield term / moving[0], motion.row(moving, motion.rate_columns)
        else:
            plain.append(term)
    yield ONE, motion.row(plain, motion.rate_columns)


def _parts_of_rate(position: Basic, motion: Motion) -> Iterator[tuple[Basic, Mapping[int, Basic]]]:
    """Yield the same of dφ/dt: sums that are factors, or their powers, have rows of their own."""
    plain: list[Basic] = []
    for term in se.Add.make_args(position):
        factors = [x for x in se.Mul.make_args(term) if motion.occurring(x).positions]
        if not any(isinstance(x.args[0] if isinstance(x, se.Pow) else x, se.Add) for x in factors):
            plain.append(term)
            continue
        for x in factors:
            inner, slope = x, ONE
            if isinstance(x, se.Pow) and motion.occurring(x.args[1]).is_constant:
                inner, slope = x.args[0], x.args[1] * x.args[0] ** (x.args[1] - ONE)
            yield term / x * slope, motion.slopes(inner).by_position
    yield ONE, motion.slopes(se.Add(*plain)).by_position
