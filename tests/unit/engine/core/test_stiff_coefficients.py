"""The coefficients of the stiff methods: order conditions, stability at infinity."""

from __future__ import annotations

import math
from functools import cache
from itertools import combinations_with_replacement

import numpy as np
import pytest
from core_parts import radau5_coefficients, rodas5p_coefficients

Tree = tuple  # of its branches; a leaf has none
# the coefficients were published with sixteen digits, and are multiplied by some hundred
ROUNDING = 1e-12


@cache
def trees(order: int) -> tuple[Tree, ...]:
    """Return the rooted trees with a number of vertices."""
    if order == 1:
        return ((),)
    found = set()
    for sizes in partitions(order - 1, order - 1):
        groups: list[list[tuple[Tree, ...]]] = []
        for size in sorted(set(sizes)):
            groups.append(list(combinations_with_replacement(trees(size), sizes.count(size))))
        chosen: list[tuple[Tree, ...]] = [()]
        for group in groups:
            chosen = [a + b for a in chosen for b in group]
        found.update(tuple(sorted(c, key=repr)) for c in chosen)
    return tuple(sorted(found, key=repr))


def partitions(total: int, largest: int) -> list[list[int]]:
    if total == 0:
        return [[]]
    return [
        [k, *rest] for k in range(min(total, largest), 0, -1) for rest in partitions(total - k, k)
    ]


def size(tree: Tree) -> int:
    return 1 + sum(map(size, tree))


def density(tree: Tree) -> int:
    return size(tree) * math.prod(map(density, tree))


class Rosenbrock:
    """Rodas5P in the form of Hairer & Wanner IV.7: k_i with α, Γ and b."""

    def __init__(self) -> None:
        self.gamma, self.c, self.d, a, C, self.h = rodas5p_coefficients()
        s = len(self.c)
        square = np.zeros((s, s))
        square[:, :-1] = a
        below = np.zeros((s, s))
        below[:, :-1] = C
        self.Gamma = np.linalg.inv(np.eye(s) / self.gamma - below)
        self.alpha = square @ self.Gamma
        self.m = np.append(a[-1], 1.0)
        self.b = self.m @ self.Gamma
        self.embedded = np.append(a[-1], 0.0) @ self.Gamma

    def weight(self, tree: Tree) -> np.ndarray:
        """Return the tree's elementary weight at each stage."""
        if not tree:
            return np.ones(len(self.c))
        if len(tree) == 1:
            return (self.alpha + self.Gamma) @ self.weight(tree[0])
        return math.prod(self.alpha @ self.weight(branch) for branch in tree)

    def dense(self, x: float) -> np.ndarray:
        h2, h3, h4 = self.h
        return (x * self.m + x * (1 - x) * (h2 + x * (h3 + x * h4))) @ self.Gamma


@pytest.fixture(scope="module")
def rodas() -> Rosenbrock:
    return Rosenbrock()


def test_number_of_trees() -> None:
    assert [len(trees(n)) for n in range(1, 6)] == [1, 1, 2, 4, 9]


def test_rodas5p_is_consistent(rodas: Rosenbrock) -> None:
    np.testing.assert_allclose(rodas.alpha.sum(axis=1), rodas.c, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(rodas.Gamma.sum(axis=1), rodas.d, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("order", range(1, 6))
def test_rodas5p_has_order_5_and_its_estimate_order_4(rodas: Rosenbrock, order: int) -> None:
    for tree in trees(order):
        expected = 1 / density(tree)
        assert rodas.b @ rodas.weight(tree) == pytest.approx(expected, abs=ROUNDING)
        if order < 5:
            assert rodas.embedded @ rodas.weight(tree) == pytest.approx(expected, abs=ROUNDING)


def test_the_estimate_sees_an_error_of_order_5(rodas: Rosenbrock) -> None:
    defects = [abs(rodas.embedded @ rodas.weight(t) - 1 / density(t)) for t in trees(5)]
    assert max(defects) > 1e-4


@pytest.mark.parametrize("x", [0.0, 0.21, 0.5, 0.83, 1.0])
def test_rodas5p_dense_output_has_order_4(rodas: Rosenbrock, x: float) -> None:
    for order in range(1, 5):
        for tree in trees(order):
            expected = x**order / density(tree)
            assert rodas.dense(x) @ rodas.weight(tree) == pytest.approx(expected, abs=ROUNDING)


def test_rodas5p_damps_what_is_infinitely_stiff(rodas: Rosenbrock) -> None:
    one = np.ones(len(rodas.c))
    beta = rodas.alpha + rodas.Gamma
    for b in (rodas.b, rodas.embedded):
        assert 1 - b @ np.linalg.solve(beta, one) == pytest.approx(0, abs=ROUNDING)
    # and A-stability, where it could fail: on the imaginary axis
    for z in 1j * np.logspace(-2, 4, 200):
        r = 1 + z * rodas.b @ np.linalg.solve(np.eye(len(one)) - z * beta, one)
        assert abs(r) <= 1 + 1e-9


def radau_matrix(c: np.ndarray) -> np.ndarray:
    """Return A of the collocation method with nodes c: Σ a_ij c_j^(k−1) = c_i^k / k."""
    powers = np.vander(c, increasing=True)
    integrals = np.array([[x ** (k + 1) / (k + 1) for k in range(len(c))] for x in c])
    return integrals @ np.linalg.inv(powers)


def test_radau_is_the_collocation_method_of_order_5() -> None:
    c, t, inverse, (real, pair), _, _ = radau5_coefficients()
    # the nodes are the zeros of d²/dx² (x² (x − 1)³)
    polynomial = np.polynomial.Polynomial([0, 0, 1]) * np.polynomial.Polynomial([-1, 1]) ** 3
    np.testing.assert_allclose(c, sorted(polynomial.deriv(2).roots().real), atol=1e-14)
    A = radau_matrix(c)
    b = A[-1]  # stiffly accurate
    for k in range(1, 6):  # B(5)
        assert b @ c ** (k - 1) == pytest.approx(1 / k, abs=1e-14)
    assert abs(b @ c**5 - 1 / 6) > 1e-4
    np.testing.assert_allclose(t @ inverse, np.eye(3), atol=1e-14)
    blocks = np.array([[real, 0, 0], [0, pair.real, -pair.imag], [0, pair.imag, pair.real]])
    np.testing.assert_allclose(t @ blocks @ inverse, np.linalg.inv(A), atol=1e-13)
    # R(∞) = 1 − b A⁻¹ 1
    assert 1 - b @ np.linalg.solve(A, np.ones(3)) == pytest.approx(0, abs=1e-14)


def test_the_estimate_of_radau_has_order_3() -> None:
    c, _, _, (real, _), weights, _ = radau5_coefficients()
    A = radau_matrix(c)
    # y0' + Σ w_i z_i / h vanishes for solutions of degree 3, z_i = h Σ a_ij y'(c_j)
    for k in range(3):
        assert 0.0**k + weights @ A @ c**k == pytest.approx(0, abs=1e-13)
    assert abs(weights @ A @ c**3) > 1e-2
    assert real == pytest.approx(1 / np.linalg.eigvals(A).real.max(), rel=1e-13)


def test_radaus_dense_output_integrates_the_defect() -> None:
    c, _, _, (real, _), _, (factor, zero) = radau5_coefficients()
    x = np.polynomial.Polynomial([0, 1])
    defect = (x - c[0]) * (x - c[1]) * (x - c[2])
    integral = real * (defect / defect(0.0)).integ()
    np.testing.assert_allclose(
        integral.coef, (factor * x * (x - 1) ** 2 * (x - zero)).coef, atol=1e-14
    )
