"""Kinetic energies whose velocities are defined one after the other.

Along a chain of links in angles, the velocity of each body is that of the body before it and a
term of its own angle. Written out, T = Σ c_k w_k²/2 has a full mass matrix. With the velocities
themselves as unknowns,

    w_k = w_p(k) + Σ_j d_kj v_j + d_k0,

M a = f is part of the sparse system

    [[M_0, 0, −dᵀ], [0, C, Dᵀ], [−d, D, 0]] [a; ẇ; −μ] = [f_0; 0; r],

in which row k of D has 1 at k and −1 at p(k), and r_k is the convective rate of the difference.
Elimination of ẇ and μ gives M = M_0 + Jᵀ C J, w = J v + …, and f.
"""

from __future__ import annotations

from collections.abc import Sequence

from symengine import Basic

from lagcli.equations.derivation.motion import ZERO
from lagcli.equations.derivation.quadratic import AffineForm, QuadraticForms, QuadraticTerm
from lagcli.named_tuples import NamedTuple

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
    """

    factor: Basic
    before: int | None
    difference: AffineForm


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
        form, first = terms[chosen[n]].first, before.get(n)
        if first is not None:
            form = forms.difference(form, terms[chosen[first]].first)
        factor = 2 * terms[chosen[n]].factor
        velocities.append(Velocity(factor, None if first is None else place[first], form))
    used = {chosen[n] for n in kept}
    return velocities, [term for k, term in enumerate(terms) if k not in used]


def _may_follow(term: QuadraticTerm, forms: QuadraticForms) -> bool:
    """Return whether a term is c w²/2 with a constant c, and ∂w/∂q − dw_q/dt is zero."""
    constant = forms.motion.occurring(term.factor).is_constant
    return term.first is term.second and constant and not term.first.curl and term.factor != ZERO
