"""Accelerations by velocities that are defined one after the other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from trees import pendulum, random_tree

import lagcli
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear.recursion import recursive_order, unroll_recursive
from lagcli.engine.lowering.lower import lower
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation import lagrange

PENDULUM = Path(__file__).parents[4] / "models" / "pendulum_chain.yaml"


@pytest.fixture
def small(monkeypatch):
    """Small models have the recursive form, too."""
    monkeypatch.setattr(lagrange, "LEAST_RECURSIVE", 1)


def accelerations(system, t, q, v, p):
    """Return a by the recursive form."""
    tape = unroll_recursive(system, recursive_order(system.recursive))
    out = ScalarTape(tape)((t, *q, *v, *p, *[0.0] * len(q)))
    first = len(system.mass_pattern) + len(q) + 1
    return np.array(out[first : first + len(q)])


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


@pytest.mark.parametrize("seed", range(12))
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


def test_the_cost_of_an_evaluation_is_linear():
    sizes = []
    for n in (30, 60, 120):
        system = lower(lagrange.derive(lagcli.load(PENDULUM, set={"N": n})))
        order = recursive_order(system.recursive)
        assert order.updates < 30 * n
        sizes.append(len(unroll_recursive(system, order).code))
    assert sizes[2] - sizes[1] < 2.05 * (sizes[1] - sizes[0])
