"""Partial derivatives of sums, touching only the terms in which a symbol occurs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

import symengine as se
from symengine import Basic

from lagcli.model.functions import settled


def terms_of(expression: Basic) -> tuple[Basic, ...]:
    """Return the terms of a sum; a constant times a sum is written out, one level deep."""
    parts = expression.args if isinstance(expression, se.Add) else (expression,)
    terms: list[Basic] = []
    for part in parts:
        if isinstance(part, se.Mul):
            factors = part.args
            sums = [i for i, x in enumerate(factors) if isinstance(x, se.Add)]
            if len(sums) == 1 and len(factors[sums[0]].args) > 2:
                rest = se.Mul(*(x for i, x in enumerate(factors) if i != sums[0]))
                terms.extend(rest * x for x in factors[sums[0]].args)
                continue
        terms.append(part)
    return tuple(terms)


def by_symbol(terms: Iterable[Basic]) -> dict[Basic, list[Basic]]:
    """Return the terms in which each symbol occurs."""
    found: dict[Basic, list[Basic]] = defaultdict(list)
    for term in terms:
        for symbol in term.free_symbols:
            found[symbol].append(term)
    return found


def partial(terms: Iterable[Basic], symbol: Basic) -> Basic:
    """Return ∂/∂symbol of a sum of terms."""
    return settled(se.Add(*[term.diff(symbol) for term in terms]), symbol)
