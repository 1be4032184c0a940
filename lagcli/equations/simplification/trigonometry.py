"""Identities that shorten sums of monomials: sin² + cos² = 1 and the addition theorems."""

from __future__ import annotations

import symengine as se

from lagcli.equations.simplification.monomials import (
    Exact,
    Generator,
    Monomial,
    MonomialExpansion,
    Polynomial,
    add_to,
    times,
)


def shorten(terms: Polynomial, expansion: MonomialExpansion) -> Polynomial:
    """Return an equal sum, shortened by

    sin² a + cos² a = 1, cos a cos b ± sin a sin b = cos(a ∓ b),
    sin a cos b ± cos a sin b = sin(a ± b).
    """
    work: Polynomial = dict(terms)
    while _squares(work, expansion) or _products(work, expansion):
        pass
    return work


def _circular(
    monomial: Monomial, expansion: MonomialExpansion
) -> list[tuple[str, se.Basic, int, int]]:
    """Return (name, angle, generator, exponent) of the sines and cosines in a monomial."""
    found = []
    for g, exponent in monomial:
        generator = expansion.generators[g]
        if generator.name in ("sin", "cos") and generator.head == "function" and exponent > 0:
            found.append((generator.name, generator.arguments[0], g, exponent))
    return found


def _circle(expansion: MonomialExpansion, name: str, angle: se.Basic) -> int:
    return expansion.index(Generator("function", name, (angle,)))


def _squares(terms: Polynomial, expansion: MonomialExpansion) -> bool:
    changed = False
    for monomial in list(terms):
        for name, angle, g, exponent in _circular(monomial, expansion):
            if exponent < 2 or monomial not in terms:
                continue
            other = _circle(expansion, "sin" if name == "cos" else "cos", angle)
            base = times(monomial, ((g, -2),))
            partner = times(base, ((other, 2),))
            here: Exact = terms[monomial]
            there: Exact = terms.get(partner, 0)
            if here * there > 0:
                common: Exact = here if here / there <= 1 else there  # the smaller one
                for m in (monomial, partner):
                    add_to(terms, m, -common)
                add_to(terms, base, common)
                changed = True
            elif terms.get(base) == -here:
                del terms[base], terms[monomial]
                add_to(terms, partner, -here)
                changed = True
    return changed


def _products(terms: Polynomial, expansion: MonomialExpansion) -> bool:
    changed = False
    for monomial in list(terms):
        circular = _circular(monomial, expansion)
        for i, (name_a, a, g, _) in enumerate(circular):
            for name_b, b, h, _ in circular[i + 1 :]:
                if monomial in terms and a != b:
                    changed |= _addition(terms, expansion, monomial, (name_a, a, g), (name_b, b, h))
    return changed


def _addition(
    terms: Polynomial,
    expansion: MonomialExpansion,
    monomial: Monomial,
    first: tuple[str, se.Basic, int],
    second: tuple[str, se.Basic, int],
) -> bool:
    (name_a, a, g), (name_b, b, h) = first, second
    swapped = {"sin": "cos", "cos": "sin"}
    base = times(monomial, ((g, -1), (h, -1)) if g < h else ((h, -1), (g, -1)))
    p, r = _circle(expansion, swapped[name_a], a), _circle(expansion, swapped[name_b], b)
    partner = times(base, times(((p, 1),), ((r, 1),)))
    here, there = terms.get(monomial, 0), terms.get(partner, 0)
    if not here or abs(here) != abs(there):
        return False
    same = here == there
    if name_a == name_b:  # cos a cos b ± sin a sin b
        value = se.cos(se.expand(a - b) if same else se.expand(a + b))
        coefficient = here if same or name_a == "cos" else there
    else:  # sin a cos b ± cos a sin b
        if name_a == "cos":
            a, b = b, a
        value = se.sin(se.expand(a + b) if same else se.expand(a - b))
        coefficient = here
    del terms[monomial], terms[partner]
    for m, c in expansion.polynomial(value).items():
        add_to(terms, times(base, m), coefficient * c)
    return True
