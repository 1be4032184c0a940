"""Derivatives of expressions in q, v and t along the motion."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Container, Iterable, Mapping
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.model import model as symbols
from lagcli.model.expression.functions import derivative, differentiated_apart
from lagcli.model.model import Model

ZERO = se.Integer(0)
ONE = se.Integer(1)
TWO = se.Integer(2)


class PartialDerivatives(NamedTuple):
    """Nonzero partial derivatives of an expression with respect to q and t.

    Parameters
    ----------
    by_position : dict of int to expression
        ∂/∂q_j, by coordinate.
    by_time : expression
        ∂/∂t.
    """

    by_position: dict[int, Basic]
    by_time: Basic


class Occurrences(NamedTuple):
    """Indices of the q and v that occur in an expression, and whether t occurs."""

    positions: tuple[int, ...]
    rates: tuple[int, ...]
    timed: bool

    @property
    def is_constant(self) -> bool:
        """Whether the expression depends on parameters only."""
        return not (self.positions or self.rates or self.timed)


class Motion:
    """The coordinates and velocities of a system.

    Parameters
    ----------
    q, v, a : tuples of nq symbols
    smooth : bool
        Whether all functions are smooth; derivatives of other functions are slower.
    """

    def __init__(
        self, q: tuple[Basic, ...], v: tuple[Basic, ...], a: tuple[Basic, ...], smooth: bool
    ):
        self.q, self.v, self.a, self.smooth = q, v, a, smooth
        self._indices = {x: (0, i) for i, x in enumerate(q)}
        self._indices.update({x: (1, i) for i, x in enumerate(v)})
        self._indices[symbols.TIME] = (2, 0)
        self._columns = {x: i for i, x in enumerate((*q, symbols.TIME))}
        #: The numbers of the velocities.
        self.rate_columns = {x: i for i, x in enumerate(v)}
        self._slopes: dict[Basic, PartialDerivatives] = {}
        self._occurring: dict[Basic, Occurrences] = {}
        self._kinked: dict[Basic, bool] = {}

    @classmethod
    def of(cls, model: Model) -> Motion:
        """Return the motion of a model."""
        names = model.coordinate_names
        return cls(
            tuple(map(symbols.coordinate, names)),
            tuple(map(symbols.velocity, names)),
            tuple(map(symbols.acceleration, names)),
            model.names.smooth,
        )

    def occurring(self, expression: Basic) -> Occurrences:
        """Return the q, v and t that occur in an expression."""
        occurrences = self._occurring.get(expression)
        if occurrences is None:
            kinds: tuple[list[int], list[int], list[int]] = ([], [], [])
            for symbol in expression.free_symbols:
                kind, i = self._indices.get(symbol, (-1, 0))
                if kind >= 0:
                    kinds[kind].append(i)
            positions, rates, times = kinds
            occurrences = Occurrences(tuple(sorted(positions)), tuple(sorted(rates)), bool(times))
            self._occurring[expression] = occurrences
        return occurrences

    def diff(self, expression: Basic, symbol: Basic) -> Basic:
        """Return ∂expression/∂symbol."""
        if self.smooth:
            return expression.diff(symbol)
        kinked = self._kinked.get(expression)
        if kinked is None:
            kinked = self._kinked[expression] = bool(differentiated_apart(expression))
        return derivative(expression, symbol) if kinked else expression.diff(symbol)

    def sum_diff(self, terms: Iterable[Basic], symbol: Basic) -> Basic:
        """Return ∂/∂symbol of a sum of terms."""
        return se.Add(*[self.diff(term, symbol) for term in terms])

    def slopes(self, expression: Basic) -> PartialDerivatives:
        """Return the partial derivatives with respect to q and t."""
        partials = self._slopes.get(expression)
        if partials is None:
            row = self.row([expression], self._columns)
            explicit = row.pop(len(self.q), ZERO)
            partials = self._slopes[expression] = PartialDerivatives(row, explicit)
        return partials

    def convective(self, expression: Basic) -> Basic:
        """Return (∂/∂q) v + ∂/∂t of an expression: its time derivative without accelerations."""
        slopes = self.slopes(expression)
        terms = [x * self.v[j] for j, x in slopes.by_position.items()]
        return se.Add(*terms, slopes.by_time)

    def row(self, parts: Iterable[Basic], columns: Mapping[Basic, int]) -> dict[int, Basic]:
        """Return the nonzero derivatives of a sum with respect to symbols, by their columns."""
        terms = self.by_symbol((term for part in parts for term in addends(part)), columns)
        slopes = {columns[x]: self.sum_diff(of, x) for x, of in terms.items()}
        return {i: x for i, x in sorted(slopes.items()) if x != ZERO}

    def by_symbol(
        self, terms: Iterable[Basic], among: Container[Basic] | None = None
    ) -> dict[Basic, list[Basic]]:
        """Return the terms in which each of some symbols occurs; by default each q, v and t."""
        known = self._indices if among is None else among
        terms_of: dict[Basic, list[Basic]] = defaultdict(list)
        for term in terms:
            for symbol in term.free_symbols:
                if symbol in known:
                    terms_of[symbol].append(term)
        return terms_of


def addends(expression: Basic, least: int = 3) -> tuple[Basic, ...]:
    """Return the terms of a sum; products with one sum are distributed, one level deep.

    Parameters
    ----------
    expression : expression
    least : int
        The least number of terms of a sum that is distributed.
    """
    parts = expression.args if isinstance(expression, se.Add) else (expression,)
    terms: list[Basic] = []
    for part in parts:
        if isinstance(part, se.Mul):
            factors = part.args
            sums = [i for i, x in enumerate(factors) if isinstance(x, se.Add)]
            if len(sums) == 1 and len(factors[sums[0]].args) >= least:
                rest = se.Mul(*(x for i, x in enumerate(factors) if i != sums[0]))
                terms.extend(rest * x for x in factors[sums[0]].args)
                continue
        terms.append(part)
    return tuple(terms)
