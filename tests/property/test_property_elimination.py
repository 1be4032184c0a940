"""The static elimination against LAPACK, on random systems with the shape of [[M, Bᵀ], [B, 0]]."""

from __future__ import annotations

import numpy as np
from core_parts import run_tape
from hypothesis import given, settings
from hypothesis import strategies as st
from kkt_systems import eliminated, hand_written, whole

from lagcli.engine.linear.elimination import NoElimination, order_at
from lagcli.engine.scales import coordinate_sizes


@st.composite
def matrices(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Return a sparse symmetric M ≥ 0, some of it without inertia, and a sparse B."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    nq, nc = draw(st.integers(1, 12)), draw(st.integers(0, 6))
    nc = min(nc, nq)
    terms = rng.normal(size=(nq + 2, nq)) * (rng.random((nq + 2, nq)) < draw(st.floats(0.1, 1)))
    scale = 10.0 ** rng.uniform(-3, 3, nq) if draw(st.booleans()) else np.ones(nq)
    inertia = np.ones(nq)
    inertia[: draw(st.integers(0, nc))] = 0.0  # without inertia: constraints must hold them
    mass = (terms.T @ terms + np.eye(nq) * 0.1) * np.outer(scale * inertia, scale * inertia)
    jacobian = rng.normal(size=(nc, nq)) * (rng.random((nc, nq)) < draw(st.floats(0.3, 1)))
    return mass, jacobian


@settings(max_examples=60, deadline=None)
@given(matrices(), st.integers(0, 2**32 - 1))
def test_solves_what_lapack_solves(parts: tuple[np.ndarray, np.ndarray], seed: int) -> None:
    mass, jacobian = parts
    matrix = whole(mass, jacobian)
    # B's rows and the coordinates are of any magnitude: judge the matrix by its scaled form
    sizes = coordinate_sizes(np.diag(mass), jacobian)
    largest = np.abs(jacobian * sizes).max(axis=1, initial=0.0)
    scale = np.append(sizes, 1 / np.maximum(largest, 1e-300))
    regular = matrix.any(axis=1).all()
    scaled = matrix * np.outer(scale, scale) if regular else np.eye(len(matrix))
    condition = np.linalg.cond(scaled) if regular else np.inf
    rhs = matrix @ np.random.default_rng(seed).normal(size=len(matrix))
    case = system, p = hand_written(mass, jacobian, rhs)
    try:
        plan = order_at(
            system,
            [run_tape(system.dynamics, [0.0] * (1 + 2 * len(mass)) + list(p))],
        )
    except NoElimination:
        assert condition > 1e6, "a regular matrix has an order"
        return
    assert sorted(plan.order) == list(range(len(matrix)))
    if condition > 1e8:
        return
    nq = len(mass)
    # LAPACK's own error in the unscaled matrix is up to a thousand times as large
    expected = scale * np.linalg.solve(scaled, scale * rhs)
    found, correction = eliminated(case, plan, rhs)
    for x in found:
        assert (
            np.abs((x - expected) / scale).max()
            <= 1e-12 * condition * np.abs(expected / scale).max()
        )
    # a step of Newton's method, which is repeated: its error grows with the inverse of the pivot,
    # by up to 6e-15 over the pivot in 13,800 random matrices
    growth = max(1.0, 0.1 / plan.smallest)
    expected = scale * np.linalg.solve(scaled, scale * np.append(np.zeros(nq), rhs[nq:]))
    assert (
        np.abs((correction - expected[:nq]) / scale[:nq]).max()
        <= 1e-12 * growth * condition * np.abs(expected / scale).max()
    )


@settings(max_examples=50, deadline=None)
@given(matrices(), st.integers(0, 2**32 - 1))
def test_an_order_serves_other_numbers_in_the_same_places(
    parts: tuple[np.ndarray, np.ndarray], seed: int
) -> None:
    """Also numbers that the order was not found from: that is what it is for."""
    mass, jacobian = parts
    matrix = whole(mass, jacobian)
    rng = np.random.default_rng(seed)
    if not matrix.any(axis=1).all():
        return
    system, p = hand_written(mass, jacobian, rng.normal(size=len(matrix)))
    states = [run_tape(system.dynamics, [0.0] * (1 + 2 * len(mass)) + list(p))]
    try:
        plan = order_at(system, states)
    except NoElimination:
        return
    other = jacobian * rng.uniform(0.5, 2, jacobian.shape)
    matrix = whole(mass, other)
    rhs = matrix @ rng.normal(size=len(matrix))
    (x, *others), _ = eliminated(hand_written(mass, other, rhs), plan, rhs)
    # two codes, one elimination: equal except for rounding, whatever the pivots have become
    finite = np.isfinite(x).all() and np.abs(x).max(initial=0.0) < 1e4
    if finite and plan.smallest > 1e-3:
        for y in others:
            np.testing.assert_allclose(x, y, rtol=1e-6, atol=1e-6)
