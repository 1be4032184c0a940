"""The static elimination against LAPACK, on random systems with the shape of [[M, Bᵀ], [B, 0]]."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lowered import Lowered

from lagcli.engine.integrate.prepared import Prepared
from lagcli.engine.linear.elimination import Elimination, NoElimination, find_order, order_at
from lagcli.engine.linear.unrolling import unroll
from lagcli.engine.program.program import assemble
from lagcli.engine.system import System
from lagcli.engine.tape.tape import Builder, Tape

binding = pytest.importorskip("lagcli.engine.core.binding")


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


def hand_written(mass: np.ndarray, jacobian: np.ndarray, rhs: np.ndarray) -> Lowered:
    """Return a System whose dynamics tape yields the given numbers."""
    nq, nc = len(mass), len(jacobian)
    m = tuple((int(i), int(j)) for i, j in np.argwhere(mass))
    b = tuple((int(i), int(j)) for i, j in np.argwhere(jacobian))
    values = [*(mass[i, j] for i, j in m), *rhs[:nq], *(jacobian[i, j] for i, j in b), *rhs[nq:], 0]
    # as inputs, not as constants: those would be folded
    builder = Builder(1 + 2 * nq + len(values), len(values))
    dynamics = builder.finish(range(1 + 2 * nq, 1 + 2 * nq + len(values)))
    empty = Tape(1 + 2 * nq, (), (), ())
    names = tuple(map(str, range(nq)))
    system = System(
        coordinates=names,
        constraints=tuple(map(str, range(nc))),
        holonomic=(),
        parameters=tuple(map(str, range(len(values)))),
        mass_pattern=m,
        jacobian_pattern=b,
        dynamics=dynamics,
        constraint=empty,
        report=empty,
    )
    return Lowered(system, tuple(map(float, values)))


def whole(mass: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
    nc = len(jacobian)
    return np.block([[mass, jacobian.T], [jacobian, np.zeros((nc, nc))]])


def eliminated(
    case: Lowered, plan: Elimination, rhs: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray]:
    """Return [a; −λ] by the unrolled tape, for another right side too, and by sparse factors; and
    the first nq unknowns for a right side without its first nq entries.
    """
    system, p = case
    nq = len(system.coordinates)
    tape = unroll(system, plan)
    inputs = [0.0] * (1 + 2 * nq) + [*p, *rhs, *rhs[nq:]]
    out = binding.run_tape(tape, inputs)
    first = len(system.dynamics.outputs)
    x = out[first : first + len(rhs)].copy()
    other = out[-len(rhs) - nq : -nq]
    x[nq:] *= -1
    other[nq:] *= -1
    places = [
        *system.mass_pattern,
        *((nq + i, j) for i, j in system.jacobian_pattern),
        *((j, nq + i) for i, j in system.jacobian_pattern),
    ]
    nm, nb = len(system.mass_pattern), len(system.jacobian_pattern)
    m, b = p[:nm], p[nm + nq : nm + nq + nb]
    looped = binding.solve_ldl(plan, places, [*m, *b, *b], rhs)
    return [x, other, looped], out[-nq:]


@settings(max_examples=300, deadline=None)
@given(matrices(), st.integers(0, 2**32 - 1))
def test_solves_what_lapack_solves(parts: tuple[np.ndarray, np.ndarray], seed: int) -> None:
    mass, jacobian = parts
    matrix = whole(mass, jacobian)
    # B's rows and the coordinates are of any magnitude: judge the matrix by its scaled form
    scale = 1 / np.sqrt(np.maximum(np.abs(matrix).max(axis=1), 1e-300))
    condition = (
        np.linalg.cond(matrix * np.outer(scale, scale)) if matrix.any(axis=1).all() else np.inf
    )
    rhs = matrix @ np.random.default_rng(seed).normal(size=len(matrix))
    case = system, p = hand_written(mass, jacobian, rhs)
    try:
        plan = order_at(
            system,
            [binding.run_tape(system.dynamics, [0.0] * (1 + 2 * len(mass)) + list(p))],
        )
    except NoElimination:
        assert condition > 1e6, "a regular matrix has an order"
        return
    assert sorted(plan.order) == list(range(len(matrix)))
    if condition > 1e8:
        return
    nq = len(mass)
    expected = np.linalg.solve(matrix, rhs)
    found, correction = eliminated(case, plan, rhs)
    for x in found:
        assert (
            np.abs((x - expected) / scale).max()
            <= 1e-12 * condition * np.abs(expected / scale).max()
        )
    expected = np.linalg.solve(matrix, np.append(np.zeros(nq), rhs[nq:]))
    assert (
        np.abs((correction - expected[:nq]) / scale[:nq]).max()
        <= 1e-12 * condition * np.abs(expected / scale).max()
    )


@settings(max_examples=100, deadline=None)
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
    states = [binding.run_tape(system.dynamics, [0.0] * (1 + 2 * len(mass)) + list(p))]
    try:
        plan = order_at(system, states)
    except NoElimination:
        return
    other = jacobian * rng.uniform(0.5, 2, jacobian.shape)
    matrix = whole(mass, other)
    rhs = matrix @ rng.normal(size=len(matrix))
    (x, *others), _ = eliminated(hand_written(mass, other, rhs), plan, rhs)
    # two codes, one elimination: equal but for rounding, whatever the pivots have become
    finite = np.isfinite(x).all() and np.abs(x).max(initial=0.0) < 1e4
    if finite and plan.smallest > 1e-3:
        for y in others:
            np.testing.assert_allclose(x, y, rtol=1e-6, atol=1e-6)


def test_a_coordinate_without_inertia_is_eliminated_with_its_constraint() -> None:
    mass, jacobian = np.diag([2.0, 0.0]), np.array([[0.0, 3.0]])
    rhs = np.array([4.0, 5.0, 6.0])
    case = hand_written(mass, jacobian, rhs)
    plan = order_at(case.system, [(2.0, 4.0, 5.0, 3.0, 6.0, 0.0)])
    assert any(plan.paired)
    for x in eliminated(case, plan, rhs)[0]:
        np.testing.assert_allclose(x, [2.0, 2.0, 5.0 / 3.0])


def test_what_touches_nothing_ends_no_long_elimination() -> None:
    """Free masses beside three with two constraints: a round of pivots without neighbours."""
    mass, jacobian = np.eye(250), np.zeros((2, 250))
    jacobian[:, :3] = [[3.0, 4.0, 5.0], [1.0, -2.0, 1.0]]
    rhs = np.arange(1.0, 253.0)
    case = system, p = hand_written(mass, jacobian, rhs)
    plan = order_at(system, [p])
    for x in eliminated(case, plan, rhs)[0]:
        np.testing.assert_allclose(x, np.linalg.solve(whole(mass, jacobian), rhs), rtol=1e-12)


def test_a_pair_that_touches_all_others_ends_no_round() -> None:
    """A pivot of order two whose neighbours are all that is left."""
    mass, jacobian = np.diag([0.01, 0.01]), np.array([[1.0, 2.0]])
    rhs = np.array([4.0, 5.0, 6.0])
    case = system, p = hand_written(mass, jacobian, rhs)
    plan = order_at(system, [p])
    for x in eliminated(case, plan, rhs)[0]:
        np.testing.assert_allclose(x, np.linalg.solve(whole(mass, jacobian), rhs), rtol=1e-12)


@pytest.mark.parametrize("n", [20, 200])
def test_a_chain_is_eliminated_from_many_places(n: int) -> None:
    """None of the pivots waits for more than a few others."""
    mass = tuple((i, i) for i in range(2 * n))  # x, y of each body
    jacobian = tuple(
        (i, 2 * j + along)
        for i in range(n)
        for j in range(max(i - 1, 0), i + 1)
        for along in (0, 1)
    )
    values = np.array([[1.0 if j // 2 == i else -1.0] for i, j in jacobian])
    plan = find_order(2 * n, n, mass, jacobian, np.ones((2 * n, 1)), values)
    depth = [1] * (3 * n)
    for k, column in enumerate(plan.columns):
        for i in column:
            depth[i] = max(depth[i], depth[k] + 1)
    assert max(depth) <= 3 + 1.5 * math.log2(n)


def test_a_singular_matrix_has_no_order() -> None:
    mass, jacobian = np.diag([2.0, 0.0]), np.array([[3.0, 0.0]])
    system = hand_written(mass, jacobian, np.zeros(3)).system
    with pytest.raises(NoElimination):
        order_at(system, [(2.0, 0.0, 0.0, 3.0, 0.0, 0.0)])


def test_a_chain_fills_in_nothing() -> None:
    n = 200
    mass = tuple((i, i) for i in range(n))
    jacobian = tuple(
        place for i in range(n) for place in ((i, max(i - 1, 0)), (i, i)) if i or place == (0, 0)
    )
    ones = np.ones((len(mass), 1))
    values = np.array([[1.0 if j == i else -1.0] for i, j in jacobian])
    plan = find_order(n, n, mass, jacobian, ones, values)
    assert sum(map(len, plan.columns)) <= 2 * 2 * n
    full = dataclasses.replace(
        plan, columns=tuple(tuple(range(k + 1, 2 * n)) for k in range(2 * n))
    )
    program = assemble(hand_written(np.eye(1), np.ones((1, 1)), np.zeros(2)).system.dynamics)
    assert Prepared(plan, program, program, None).worth_unrolling
    assert not Prepared(full, program, program, None).worth_unrolling
