"""Accelerations by velocities that are defined one after the other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from random_cases import seeds
from trees import ROPE, pendulum, random_constraints, random_tree, rope

import lagcli
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.layout import UnrolledLayout
from lagcli.engine.linear.recursion import recursive_order, unroll_recursive
from lagcli.engine.lowering.lower import lower
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation import lagrange

PENDULUM = Path(__file__).parents[4] / "models" / "pendulum_chain.yaml"


@pytest.fixture
def small(monkeypatch):
    """Small models have the recursive form, too."""
    monkeypatch.setattr(lagrange, "LEAST_RECURSIVE", 1)


def outputs(system, t, q, v, p, sides=None):
    """Return the outputs of the recursive form by name."""
    tape = unroll_recursive(system, recursive_order(system))
    if sides is None:
        sides = np.zeros(len(q) + 2 * len(system.constraints))
    out = ScalarTape(tape)((t, *q, *v, *p, *sides))
    return UnrolledLayout(system.counts).split(np.array(out))


def accelerations(system, t, q, v, p):
    """Return a by the recursive form."""
    return outputs(system, t, q, v, p)["solution"][: len(q)]


@pytest.mark.parametrize("n", [3, 4, 5, 10, 20, 60])
def test_accelerations_of_a_pendulum_of_links(n, small):
    system = lower(lagrange.derive(lagcli.load(PENDULUM, set={"N": n})))
    p = {"N": n, "l": 1.0, "m": 1.0 / n, "g": 9.81, "theta_0": 0.5}
    random = np.random.default_rng(n)
    for _ in range(5):
        q, v = random.normal(size=(2, n))
        found = accelerations(system, 0.0, q, v, [p[name] for name in system.parameters])
        expected = pendulum(q, v, n)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * n * abs(expected).max())


@pytest.mark.parametrize("seed", seeds(4, 12))
def test_random_trees(seed, small):
    """The same accelerations as from M and f, which the derivation builds in another way."""
    random = np.random.default_rng(seed)
    n = int(random.integers(3, 14))
    system = lower(lagrange.derive(lagcli.load_text(random_tree(random, n))))
    evaluator = Evaluator(system, ())
    for _ in range(5):
        t, (q, v) = random.uniform(0, 3), random.normal(size=(2, n))
        given = evaluator.dynamics(t, q, v)
        expected = np.linalg.solve(given.mass_matrix, given.forcing)
        found = accelerations(system, t, q, v, ())
        condition = np.linalg.cond(given.mass_matrix)
        np.testing.assert_allclose(
            found, expected, rtol=0, atol=1e-14 * condition * abs(expected).max() + 1e-12
        )


@pytest.mark.slow
def test_the_cost_of_an_evaluation_is_linear():
    sizes = []
    for n in (30, 60, 120):
        system = lower(lagrange.derive(lagcli.load(PENDULUM, set={"N": n})))
        order = recursive_order(system)
        assert order.updates < 30 * n
        sizes.append(len(unroll_recursive(system, order).code))
    assert sizes[2] - sizes[1] < 2.05 * (sizes[1] - sizes[0])


@pytest.mark.parametrize("seed", seeds(8, 30))
def test_constraints_of_random_trees(seed, small):
    """All solutions as those of the whole matrix, by M, f, B and γ."""
    random = np.random.default_rng(seed)
    n = int(random.integers(5, 20))
    nc = int(random.integers(1, 2 + n // 2))
    tree = random_tree(random, n)
    model = tree.replace("initial:", random_constraints(random, n, nc) + "\ninitial:")
    equations = lagrange.derive(lagcli.load_text(model))
    assert equations.recursive is not None
    system, solved = lower(equations), 0
    evaluator = Evaluator(system, ())
    for _ in range(4):
        t, (q, v) = random.uniform(0, 3), random.normal(size=(2, n))
        sides = random.normal(size=n + 2 * nc)
        given = evaluator.dynamics(t, q, v)
        rows, below = given.jacobian, np.zeros((nc, nc))
        matrix = np.block([[given.mass_matrix, -rows.T], [rows, below]])
        condition = np.linalg.cond(matrix)
        if condition > 1e8:
            continue
        solved += 1
        found = outputs(system, t, q, v, (), sides)
        np.testing.assert_array_equal(found["jacobian"], [rows[k] for k in system.jacobian_pattern])
        np.testing.assert_array_equal(found["rhs"], given.rhs)
        tolerance = 1e-14 * condition + 1e-12
        right = [[*given.forcing, *given.rhs], sides[: n + nc], [*np.zeros(n), *sides[n + nc :]]]
        values = [found["solution"], found["others"][: n + nc], found["others"][n + nc :]]
        for value, side in zip(values, right, strict=True):
            expected = np.linalg.solve(matrix, side)
            atol = tolerance * abs(expected).max()
            np.testing.assert_allclose(value, expected[: len(value)], rtol=0, atol=atol)
        parts = found["power"], found["solution"][n:] * (rows @ v)
        terms = sum(abs(part).sum() for part in parts)
        power = sum(part.sum() for part in parts)
        assert found["total_power"][0] == pytest.approx(power, abs=1e-14 * terms)
    assert solved


@pytest.mark.parametrize("n", [3, 6, 25, pytest.param(60, marks=pytest.mark.slow)])
def test_a_rope_between_two_points(n, small):
    system = lower(lagrange.derive(lagcli.load_text(ROPE, set={"N": n})))
    p = {"N": n, "L": 1.0, "m": 1.0, "r": 1.0, "g": 9.81, "D": 0.6}
    random = np.random.default_rng(n)
    for _ in range(4):
        q, v = random.normal(size=(2, n))
        found = outputs(system, 0.0, q, v, [p[name] for name in system.parameters])["solution"]
        a, multipliers = rope(q, v)
        np.testing.assert_allclose(found[:n], a, rtol=0, atol=1e-12 * n * abs(a).max())
        np.testing.assert_allclose(found[n:], multipliers, rtol=0, atol=1e-11 * abs(a).max())


@pytest.mark.slow
def test_the_cost_of_constraints_is_linear():
    updates = []
    for n in (30, 60, 120):
        system = lower(lagrange.derive(lagcli.load_text(ROPE, set={"N": n})))
        updates.append(recursive_order(system).updates)
    assert updates[2] < 80 * 120
    assert updates[2] - updates[1] < 2.05 * (updates[1] - updates[0])
