"""Polynomials through values at nodes: their coefficients, first changes of sign and roots."""

from __future__ import annotations

from math import comb, cos, pi

import numpy as np
import pytest
from core_parts import (
    NODES,
    bernstein_matrix,
    estimated_root,
    first_change,
    nodes,
    resolved,
)
from numpy.polynomial import Chebyshev, Polynomial

from lagcli.arrays import Array

DEGREE = NODES - 1


def bernstein(p: Polynomial) -> Array:
    """Return the coefficients of a polynomial on [0, 1], from those of its powers."""
    c = p.convert().coef
    return np.array(
        [sum(comb(i, m) / comb(DEGREE, m) * c[m] for m in range(len(c))) for i in range(NODES)]
    )


def test_the_nodes_are_those_of_chebyshev() -> None:
    expected = [(1 - cos(k * pi / DEGREE)) / 2 for k in range(NODES)]
    np.testing.assert_allclose(nodes(), expected, rtol=0, atol=2e-16)


@pytest.mark.parametrize("degree", range(NODES))
def test_coefficients_of_powers(degree: int) -> None:
    power = Polynomial.basis(degree)
    # the matrix's condition is about 1000
    np.testing.assert_allclose(bernstein_matrix() @ power(nodes()), bernstein(power), atol=1e-13)


@pytest.mark.parametrize("m", [DEGREE - 1, DEGREE])
@pytest.mark.parametrize("size", [1.0, -1e-20, 1e20])
def test_the_last_two_coefficients_show_whether_a_function_is_resolved(m: int, size: float) -> None:
    for last, expected in ((0.98e-9, True), (1.02e-9, False), (-0.98e-9, True), (-1.02e-9, False)):
        values = Chebyshev.basis(2)(2 * nodes() - 1) + last * Chebyshev.basis(m)(2 * nodes() - 1)
        # what is behind the values has no effect
        assert resolved([*size * values, 1e300]) == expected
    # those before do not matter
    for other in range(DEGREE - 1):
        assert resolved(size * Chebyshev.basis(other)(2 * nodes() - 1))
    assert resolved(np.zeros(NODES))


def test_the_largest_value_may_be_that_of_an_end() -> None:
    for end in (-1, 1):
        steep, last = Polynomial([0.5, 0.5 * end]) ** 4, Chebyshev.basis(DEGREE)
        x = 2 * nodes() - 1
        assert resolved(steep(x) + 0.98e-9 * last(x))
        assert not resolved(steep(x) + 1.02e-9 * last(x))


def falls(roots: list[float], start: float) -> float | None:
    """Return the first place from `start` on at which a polynomial with these roots, positive at 0,
    goes from + to -."""
    return next((x for k, x in enumerate(roots) if k % 2 == 0 and x > start), None)


def test_the_first_change_is_between_the_ends_of_its_bracket() -> None:
    rng = np.random.default_rng(5)
    counts = {True: 0, False: 0}
    for _ in range(400):
        roots = np.sort(rng.uniform(0.01, 1.3, rng.integers(1, DEGREE + 1)))
        if np.diff(roots).min(initial=1.0) < 0.02:
            continue
        p = Polynomial.fromroots(roots)
        p = p / p(0.0)
        start = float(rng.choice([0.0, 0.0, *rng.uniform(0, 1, 2)]))
        if np.abs(roots - start).min() < 0.01 or p(start) < 0:
            continue
        b = bernstein(p) * 10.0 ** rng.uniform(-9, 9)
        found, inside = first_change(b, start), [x for x in roots.tolist() if x < 1]
        counts[found is not None] += 1
        expected = falls(inside, start)
        if expected is None:
            assert found is None
            continue
        assert found is not None
        low, high = found
        assert start <= low <= expected <= high <= 1
        # there is no other root in the bracket
        assert sum(low <= x <= high for x in inside) == 1
        # rounding of the polynomial's powers, which cancel, over its slope
        noise = 2e-14 * np.abs(p.coef).sum() / abs(p.deriv()(expected))
        assert estimated_root(b, low, high) == pytest.approx(expected, abs=noise + 2e-15)
    assert min(counts.values()) > 30


def test_a_polynomial_that_begins_below_zero_by_rounding_counts_as_positive() -> None:
    assert first_change(bernstein(Polynomial([-1e-18, 1.0]))) is None
    found = first_change(bernstein(Polynomial([-1e-18, 1.0, -2.0])))
    assert found is not None
    assert found[0] < 0.5 < found[1]


def test_a_root_just_before_the_start_is_found_behind_it() -> None:
    """The part that ends at the start is not searched: a bracket has a length, and the search goes
    on at its end."""
    for start in (0.25, 0.5, 0.75):
        found = first_change(bernstein(Polynomial([start - 2.0**-50, -1.0])), start)
        assert found is not None
        assert start <= found[0] < found[1] < start + 1e-9


@pytest.mark.parametrize("more", [[], [1.0], [1.4], [-0.5, 1.2]])
def test_a_change_before_a_zero_at_the_end_is_found(more: list[float]) -> None:
    """The function is negative at the end of the bracket, where the polynomial's end is not."""
    for root in (0.1, 0.3, 0.45, 0.8, 0.95, 0.999):
        p = Polynomial.fromroots([root, 1.0, *more])
        b = bernstein(p / p(0.0))
        b[-1] = 0.0
        found = first_change(b)
        assert found is not None
        assert found[0] <= root <= found[1] < 1.0
        assert p(found[1]) / p(0.0) < 0.0


@pytest.mark.parametrize("touch", [0.5, 0.25, 0.75])
def test_a_change_after_a_touch_that_rounding_makes_negative_is_found(touch: float) -> None:
    """The search goes on behind the touch, where a part of the halved interval begins."""
    p = Polynomial([touch**2 - 1e-15, -2 * touch, 1.0]) * Polynomial([0.9, -1.0])
    b, start = bernstein(p), 0.0
    for _ in range(9):
        found = first_change(b, start)
        assert found is not None
        assert start <= found[0] < found[1]
        if found[0] > touch + 1e-3:
            break
        start = found[1]
    assert found[0] <= 0.9 <= found[1]


def test_two_roots_next_to_each_other_are_one_short_bracket() -> None:
    """Roots closer than 1e-10 of the interval are not separated."""
    p = Polynomial.fromroots([0.3, 0.3 + 1e-12])
    assert first_change(bernstein(p)) is None or np.ptp(first_change(bernstein(p))) < 1e-10
    p = Polynomial.fromroots([0.3, 0.3 + 1e-4])
    low, high = first_change(bernstein(p))
    assert low <= 0.3 <= high < 0.3 + 1e-4


def test_without_a_change_of_sign_the_estimate_is_the_middle() -> None:
    for coefficients in ([0.3, 0.3], [-1.0, -1.0], [-1.0, 2.0], [0.0, 1.0, -3.0], [0.5, -1.0]):
        assert estimated_root(bernstein(Polynomial(coefficients)), 0.0, 0.5) == 0.25
    assert estimated_root(bernstein(Polynomial([0.4, -1.0])), 0.0, 0.5) == pytest.approx(0.4)
