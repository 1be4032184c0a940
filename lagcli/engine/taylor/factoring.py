"""Factoring of sums of products of series: common factors are multiplied once.

A convolution costs several times as much as a sum, and formulas are often expanded because that is
shorter to write or because elements are combined: f a + f b becomes f (a + b).
"""

from __future__ import annotations

from collections.abc import Sequence

from lagcli.engine.taylor.expansion import SeriesExpansion
from lagcli.engine.taylor.forms import Form
from lagcli.engine.taylor.series_nodes import (
    Delayed,
    Name,
    SeriesNode,
    SeriesOp,
    UnnamedSeries,
)

#: Operations with one term or two.
_SUMS = SeriesOp.SUM, SeriesOp.SCALE


def factored(expansion: SeriesExpansion, results: Sequence[Name]) -> list[SeriesNode]:
    """Return the operations that results need, with common factors of sums factored out."""
    return _Factoring(expansion, results).nodes()


class _Factoring:
    """Rewrites the sums of an expansion, each including nested sums that are used once."""

    def __init__(self, expansion: SeriesExpansion, results: Sequence[Name]):
        self.expansion, self.results = expansion, results
        self.given = {to: node for node in expansion.wanted(results) for to in node[1]}
        self.uses: dict[Name, int] = dict.fromkeys(results, 2)
        self.named = set(results)  # used outside of sums
        self.inside: set[Name] = set()  # sums that are parts of others
        self.multiples: dict[Name, Form] = {}  # sums reduced to one term
        for op, _, operands in self.given.values():
            for i, x in enumerate(operands):
                if i not in op.numbers:
                    x = x.series if isinstance(x, Delayed) else x
                    self.uses[x] = self.uses.get(x, 0) + 1
                    if op not in _SUMS:
                        self.named.add(x)

    def nodes(self) -> list[SeriesNode]:
        """Rewrite all sums."""
        sums = [(to, _terms(node)) for to, node in self.given.items() if node[0] in _SUMS]
        for to, terms in reversed(sums):
            if to not in self.inside:
                self.flat(terms)
        for to, terms in sums:
            if to not in self.inside:
                terms = self.taken_out(self.flat(terms))
                if len(terms) == 1 and to not in self.named:
                    self.multiples[to] = terms[0]
                else:
                    self.expansion.add(terms, to)
        return self.expansion.wanted(self.results)

    def alone(self, x: Name, *ops: SeriesOp) -> SeriesNode | None:
        """Return an operation of some kinds whose result is used once."""
        node = self.given.get(x)
        return node if node and node[0] in ops and self.uses[x] == 1 else None

    def flat(self, terms: Sequence[Form]) -> list[Form]:
        """Return terms with nested sums flattened."""
        found: list[Form] = []
        waiting = [*reversed(terms)]
        times = self.expansion.builder.times
        while waiting:
            number, x = waiting.pop()
            node = self.alone(x, *_SUMS)
            if node:
                self.inside.add(x)
                waiting += [(times(number, s), a) for s, a in reversed(_terms(node))]
            elif x in self.multiples:
                s, a = self.multiples[x]
                found.append((times(number, s), a))
            else:
                found.append((number, x))
        return found

    def taken_out(self, terms: list[Form]) -> list[Form]:
        """Return terms with common factors of products factored out, the most common first."""
        expansion = self.expansion
        while True:
            members: dict[Name, list[int]] = {}
            for i, (_, x) in enumerate(terms):
                node = self.alone(x, SeriesOp.MUL)
                for factor in set(node[2] if node else ()):
                    members.setdefault(factor, []).append(i)
            factor, which = max(members.items(), key=lambda x: len(x[1]), default=(0, []))
            if len(which) < 2:
                return terms
            others: list[Form] = []
            for i in which:
                number, x = terms[i]
                a, b = self.given[x][2]
                others.append((number, b if a == factor else a))
            others.sort(key=_in_order)  # including those of other sums, in canonical order
            number, rest = expansion.bracket(others, lambda x: self.taken_out(self.flat(x)))
            product = number, expansion.multiply(factor, rest)
            terms = [x for i, x in enumerate(terms) if i not in which[1:]]
            terms[which[0]] = product


def _in_order(term: Form) -> tuple[bool, Name]:
    """Return the sort key of terms: series with registers come first."""
    return isinstance(term[1], UnnamedSeries), term[1]


def _terms(node: SeriesNode) -> list[Form]:
    """Return the terms of a sum."""
    _, _, operands = node
    return list(zip(operands[::2], operands[1::2], strict=True))
