"""Linear systems of expressions."""

from __future__ import annotations

import random
from itertools import chain

import pytest
import symengine as se

from lagcli.equations.reduction.small_systems import (
    cancelled,
    determinant,
    shared_factor,
    solutions,
)

x, y, z = map(se.Symbol, "xyz")


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5])
def test_solutions(size: int) -> None:
    source = random.Random(size)
    symbols = [[se.Symbol(f"a_{i}_{j}") for j in range(size)] for i in range(size)]
    right = [se.Symbol(f"b_{i}") for i in range(size)]
    at = {s: se.RealDouble(source.uniform(-1, 1)) for s in (*right, *chain(*symbols))}
    (found,), below = solutions(symbols, [right], lambda e: float(e.xreplace(at)))
    values = [float((n / below).xreplace(at)) for n in found]
    for row, b in zip(symbols, right, strict=True):
        left = sum(float(a.xreplace(at)) * v for a, v in zip(row, values, strict=True))
        assert left == pytest.approx(float(b.xreplace(at)), abs=1e-10)


def test_determinant() -> None:
    assert determinant([]) == 1
    assert se.expand(determinant([[x, y], [z, x]]) - x**2 + y * z) == 0


def test_shared_factor() -> None:
    assert shared_factor([2 * x * y, 4 * x**2]) == 2 * x
    assert shared_factor([x, 1 / y]) == 1 / y  # dividing by it leaves no denominators
    assert shared_factor([x, y]) == 1


def test_fractions_lose_what_all_terms_share() -> None:
    (above,), below = cancelled([2 * x * y + 2 * x * z], 4 * x)
    assert (se.expand(above - y - z), below) == (0, 2)
