"""Grouping of the terms of a sum of monomials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from lagcli.equations.simplification.factors import common_part
from lagcli.equations.simplification.monomials import (
    Class,
    Exact,
    Monomial,
    MonomialExpansion,
    Polynomial,
    add_to,
    times,
)

MOVING = ("multiplier", "acceleration", "velocity")


@dataclass(frozen=True)
class Pair:
    """A sum of functions of position times a sum of motion variables."""

    functions: Polynomial
    motion: Polynomial
    motion_class: int  # 0: with accelerations, 1: with velocities, 2: neither
    complexity: int  # number of factors of the simplest function


@dataclass(frozen=True)
class TermGroup:
    """A sum of parameter monomials times a sum of the remaining factors."""

    parameters: Polynomial
    rest: Polynomial


def groups(terms: Polynomial, expansion: MonomialExpansion) -> list[TermGroup]:
    """Collect terms by parameters, and merge groups whose remaining factors are equal.

    m₁ l² θ̈ + m₂ l² θ̈ becomes (m₁ l² + m₂ l²) · θ̈.
    """
    found: dict[Monomial, Polynomial] = {}
    for monomial, c in terms.items():
        outer, inner = _split(monomial, expansion, ("parameter",))
        add_to(found.setdefault(outer, {}), inner, c)
    return [TermGroup(a, b) for a, b in _merged(found, expansion)]


def pairs(terms: Polynomial, expansion: MonomialExpansion) -> list[Pair]:
    """Collect terms by functions of position, and merge groups with the same motion."""
    found: dict[Monomial, Polynomial] = {}
    for monomial, c in terms.items():
        motion, function = _split(monomial, expansion, MOVING)
        add_to(found.setdefault(function, {}), motion, c)
    return [
        Pair(a, b, _motion_class(b, expansion), min(_complexity(m, expansion) for m in a))
        for a, b in _merged(found, expansion)
    ]


def shared_by(parts: list[Pair], expansion: MonomialExpansion) -> Monomial:
    """Return the common factor of terms: common symbols, and functions with equal exponents.

    sin² φ and sin φ cos φ keep their sines, as in the textbook.
    """
    functions = [m for p in parts for m in p.functions]
    motions = [m for p in parts for m in p.motion]
    common = []
    for g, n in common_part(functions):
        is_symbol = expansion.generators[g].head == "symbol"
        if is_symbol or all(dict(m).get(g) == n for m in functions):
            common.append((g, n))
    return times(tuple(common), common_part(motions))


def _split(
    monomial: Monomial, expansion: MonomialExpansion, classes: tuple[Class | str, ...]
) -> tuple[Monomial, Monomial]:
    inside = tuple(x for x in monomial if expansion.classes[x[0]] in classes)
    outside = tuple(x for x in monomial if expansion.classes[x[0]] not in classes)
    return inside, outside


def _merged(
    found: Mapping[Monomial, Polynomial], expansion: MonomialExpansion
) -> list[tuple[Polynomial, Polynomial]]:
    """Merge the monomials whose sums are proportional."""
    joined: dict[frozenset[tuple[Monomial, Exact]], tuple[Polynomial, Polynomial]] = {}
    for outer, inner in found.items():
        if not inner:
            continue
        scale = Fraction(inner[min(inner, key=expansion.order)])
        normal: Polynomial = inner if scale == 1 else {m: c / scale for m, c in inner.items()}
        signature = frozenset(normal.items())
        outers, _ = joined.setdefault(signature, ({}, normal))
        add_to(outers, outer, scale)
    return list(joined.values())


def _motion_class(motion: Polynomial, expansion: MonomialExpansion) -> int:
    kinds = {expansion.classes[g] for m in motion for g, _ in m}
    return 0 if "acceleration" in kinds else 1 if "velocity" in kinds else 2


def _complexity(monomial: Monomial, expansion: MonomialExpansion) -> int:
    return sum(abs(n) for g, n in monomial if expansion.generators[g].head != "symbol")
