"""Null spaces of rational matrices, against SymPy's."""

from __future__ import annotations

from fractions import Fraction

import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from lagcli.equations.symmetry.nullspace import echelon, independent, null_space, remainder

ENTRIES = st.sampled_from([0, 0, 0, 1, -1, 2, Fraction(1, 3), Fraction(-5, 7)])


def sparse(rows: list[list[Fraction]]) -> list[dict[int, Fraction]]:
    return [{j: Fraction(x) for j, x in enumerate(row) if x} for row in rows]


@settings(deadline=None)
@given(st.lists(st.lists(ENTRIES, min_size=5, max_size=5), max_size=6))
def test_the_basis_spans_the_null_space(rows: list[list[Fraction]]) -> None:
    matrix = sympy.Matrix(len(rows), 5, [sympy.Rational(str(Fraction(x))) for r in rows for x in r])
    basis = null_space(sparse(rows), 5)
    assert len(basis) == 5 - matrix.rank()
    for vector in basis:
        for row in rows:
            assert sum(Fraction(x) * vector.get(j, 0) for j, x in enumerate(row)) == 0
    # reduced: each has an entry 1 where the others have 0, its last entry
    for vector in basis:
        own = max(vector)
        assert vector[own] == 1
        assert all(own not in other for other in basis if other is not vector)


@settings(deadline=None)
@given(st.lists(st.lists(ENTRIES, min_size=4, max_size=4), max_size=6))
def test_independent_vectors_are_as_many_as_the_rank(rows: list[list[Fraction]]) -> None:
    given_rows = sparse(rows)
    kept = independent(given_rows)
    matrix = sympy.Matrix(len(rows), 4, [sympy.Rational(str(Fraction(x))) for r in rows for x in r])
    assert len(kept) == matrix.rank() == len(echelon(given_rows))
    first = next((i for i, row in enumerate(given_rows) if row), None)
    assert first is None or kept[0] == first
    # what is in their space leaves nothing
    assert all(remainder(row, echelon(given_rows)) == {} for row in given_rows)
