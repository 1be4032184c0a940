"""Full mass matrices solved by velocities that are defined one after the other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lagcli
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate import prepared
from lagcli.engine.integrate import run as single_runs
from lagcli.engine.integrate.prices import Prices
from lagcli.engine.linear.recursion import recursive_order, unroll_recursive
from lagcli.engine.lowering.lower import lower
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation import lagrange

ROOT = Path(__file__).parents[2]
PENDULUM = ROOT / "models" / "pendulum_chain.yaml"
BEAM = ROOT / "tests" / "found" / "beam40.yaml"


@pytest.fixture
def always(monkeypatch):
    """Take the recursive form of small models, too, from the first steps on."""
    monkeypatch.setattr(lagrange, "LEAST_RECURSIVE", 1)
    monkeypatch.setattr(single_runs, "may_unroll", lambda elimination: False)
    monkeypatch.setattr(prepared, "SHORT", 0)
    monkeypatch.setattr(prepared.Prepared, "worth_unrolling", False)
    monkeypatch.setattr(Prices, "steps_to_recursion", 3)


def in_use(monkeypatch):
    """Return a list of the preparations that runs use."""
    used = []
    use = single_runs.Integration.use

    def noted(self, made):
        used.append(made)
        use(self, made)

    monkeypatch.setattr(single_runs.Integration, "use", noted)
    return used


def accelerations(system, t, q, v, p):
    """Return a by the recursive form."""
    tape = unroll_recursive(system, recursive_order(system.recursive))
    out = ScalarTape(tape)((t, *q, *v, *p, *[0.0] * len(q)))
    first = len(system.mass_pattern) + len(q) + 1
    return np.array(out[first : first + len(q)])


def pendulum(theta, rate, n, g=9.81):
    """Return θ″ of n links: M a = f written by hand, the whole of length 1 m and mass 1 kg."""
    length, mass = 1.0 / n, 1.0 / n
    outer = mass * np.minimum.outer(np.arange(n, 0, -1), np.arange(n, 0, -1))
    apart = np.subtract.outer(theta, theta)
    matrix = outer * length**2 * np.cos(apart)
    forces = -(outer * length**2 * np.sin(apart)) @ rate**2
    forces -= np.diag(outer) * length * g * np.sin(theta)
    return np.linalg.solve(matrix, forces)


@pytest.mark.parametrize("n", [3, 4, 5, 10, 20, 60])
def test_accelerations_of_a_pendulum_of_links(n, always):
    system = lower(lagrange.derive(lagcli.load(PENDULUM, set={"N": n})))
    p = {"N": n, "l": 1.0, "m": 1.0 / n, "g": 9.81, "theta_0": 0.5}
    random = np.random.default_rng(n)
    for _ in range(5):
        q, v = random.normal(size=(2, n))
        found = accelerations(system, 0.0, q, v, [p[name] for name in system.parameters])
        expected = pendulum(q, v, n)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * n * abs(expected).max())


@pytest.mark.parametrize("n", [3, 12, 20])
def test_motion_of_a_pendulum_of_links(n, always, monkeypatch):
    used = in_use(monkeypatch)
    model = lagcli.load(PENDULUM, set={"N": n, "theta_0": "80 deg"})
    run = lagcli.simulate(model, t_end=1.0, samples=11, rtol=1e-11, atol=1e-12)
    assert used[-1].recursive
    start = np.concatenate([np.full(n, np.radians(80)), np.zeros(n)])
    expected = solve_ivp(
        lambda t, y: np.concatenate([y[n:], pendulum(y[:n], y[n:], n)]),
        (0.0, 1.0),
        start,
        "DOP853",
        run.time,
        rtol=1e-12,
        atol=1e-13,
    )
    np.testing.assert_allclose(run.q, expected.y[:n].T, rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.v, expected.y[n:].T, rtol=0, atol=1e-6)


def test_energy_of_many_links(monkeypatch):
    used = in_use(monkeypatch)
    monkeypatch.setattr(Prices, "steps_to_recursion", 20)
    model = lagcli.load(PENDULUM, set={"N": 100, "theta_0": "60 deg"})
    run = lagcli.simulate(model, t_end=0.2, samples=21)
    assert [made.recursive for made in used] == [False, True]
    outer = np.minimum.outer(np.arange(100, 0, -1), np.arange(100, 0, -1)) / 100.0**3
    apart = np.cos(run.q[:, :, None] - run.q[:, None, :])
    kinetic = 0.5 * np.einsum("ti,tij,tj->t", run.v, outer * apart, run.v)
    potential = -9.81 * 100.0 * np.cos(run.q) @ np.diag(outer)
    np.testing.assert_allclose(kinetic + potential, potential[0], rtol=0, atol=1e-10)
    assert kinetic[-1] > 0.05


def random_tree(random, n):
    """Return a model of n links in a tree, with springs, a moving support and other terms."""
    before = [int(random.integers(max(0, i - 3), i)) for i in range(1, n + 1)]
    lines = ["X[0]: 0.1*sin(2*t)", "Y[0]: 0"]
    for i, k in enumerate(before, 1):
        angle = f"q[{i}] + {random.uniform(-1, 1):.3f}"
        length = f"{random.uniform(0.2, 1):.3f}"
        if i % 5 == 0:  # a slider whose length changes with another coordinate
            length = f"({length} + 0.1*q[{max(1, i - 1)}])"
        lines.append(f"X[{i}]: X[{k}] + {length}*sin({angle})")
        lines.append(f"Y[{i}]: Y[{k}] - {length}*cos({angle})")
    masses = random.uniform(0.1, 2, size=n)
    kinetic = [f"{m:.3f}/2*(X[{i}]'^2 + Y[{i}]'^2)" for i, m in enumerate(masses, 1)]
    kinetic += [f"0.05*q[{i}]'^2" for i in range(1, n + 1)]
    kinetic.append("0.1*(1 + q[1]^2)*(q[1]' + cos(q[2])*q[2]')^2")  # varying factor
    kinetic.append("0.2*(cos(q[1])*q[2]' + q[3]')^2")  # not the rate of a position
    kinetic.append("0.1*q[1]'*q[3]'*cos(q[2]) + 0.3*q[2]'")
    potential = [f"{m:.3f}*9.81*Y[{i}]" for i, m in enumerate(masses, 1)]
    potential.append("q[1]^2 + 0.3*q[2]*q[3]")
    return "\n".join(
        [
            f"coordinates: [q[1..{n}]]",
            "definitions:",
            *(f"  {line}" for line in lines),
            "T: " + " + ".join(kinetic),
            "V: " + " + ".join(potential),
            f"Q: {{q[1]: -0.1*q[1]' + sin(t), X[{n}]: 0.5, Y[1]: -q[2]'}}",
            "initial: " + f"{{q[1..{n}]: 0.1, q[1..{n}]': 0}}",
            "simulation: {t_end: 0.3, samples: 4}",
        ]
    )


@pytest.mark.parametrize("seed", range(12))
def test_random_trees(seed, always):
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


@pytest.mark.parametrize("seed", range(3))
def test_motions_of_random_trees(seed, monkeypatch, request):
    model = lagcli.load_text(random_tree(np.random.default_rng(100 + seed), 9))
    expected = lagcli.simulate(model, rtol=1e-11, atol=1e-12)
    request.getfixturevalue("always")
    used = in_use(monkeypatch)
    run = lagcli.simulate(model, rtol=1e-11, atol=1e-12)
    assert used[-1].recursive
    np.testing.assert_allclose(run.q, expected.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.v, expected.v, rtol=0, atol=1e-8)


def test_a_force_that_changes_its_law(always, monkeypatch):
    """The beam's force ends at t = π; the branches of comparisons are frozen within steps."""
    used = in_use(monkeypatch)
    monkeypatch.setattr(Prices, "steps_to_recursion", 50)
    model = lagcli.load(BEAM, set={"n": 8})
    run = lagcli.simulate(model, t_end=3.5, samples=8, rtol=1e-10, method="DOP853")
    assert used[-1].recursive
    monkeypatch.setattr(Prices, "steps_to_recursion", 10**9)
    expected = lagcli.simulate(model, t_end=3.5, samples=8, rtol=1e-10, method="DOP853")
    assert not used[-1].recursive
    np.testing.assert_allclose(run.q, expected.q, rtol=0, atol=1e-8)


def test_a_wrong_form_is_noticed_and_left(always, monkeypatch):
    used = in_use(monkeypatch)
    model = lagcli.load(PENDULUM, set={"N": 12})
    right = lagcli.simulate(model, t_end=0.3, samples=4)
    assert used[-1].recursive
    lower_recursive = lagcli.engine.lowering.lower.lower_recursive

    def wrong(equations, functions):
        first, *others = equations.recursive.velocities
        changed = first._replace(factor=1.001 * first.factor), *others
        recursive = equations.recursive._replace(velocities=changed)
        return lower_recursive(replace(equations, recursive=recursive), functions)

    monkeypatch.setattr("lagcli.engine.lowering.lower.lower_recursive", wrong)
    run = lagcli.simulate(model, t_end=0.3, samples=4)
    assert [made.recursive for made in used[-2:]] == [True, False]
    np.testing.assert_allclose(run.q, right.q, rtol=0, atol=1e-9)


def test_few_velocities_and_constraints_have_no_recursive_form():
    small = lagrange.derive(lagcli.load(PENDULUM, set={"N": lagrange.LEAST_RECURSIVE - 1}))
    assert small.recursive is None
    chain = lagrange.derive(lagcli.load(ROOT / "models" / "chain.yaml", set={"N": 40}))
    assert chain.recursive is None


def test_the_cost_of_an_evaluation_is_linear():
    sizes = []
    for n in (30, 60, 120):
        system = lower(lagrange.derive(lagcli.load(PENDULUM, set={"N": n})))
        order = recursive_order(system.recursive)
        assert order.updates < 30 * n
        sizes.append(len(unroll_recursive(system, order).code))
    assert sizes[2] - sizes[1] < 2.05 * (sizes[1] - sizes[0])
