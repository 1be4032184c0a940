"""Full mass matrices solved by velocities that are defined one after the other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmi import Unpacked
from scipy.integrate import solve_ivp
from trees import ROPE, pendulum, random_tree, rope
from two_routes import by_page, by_simulate, difference

import lagcli
from lagcli.engine.integrate import prepared
from lagcli.engine.integrate import run as single_runs
from lagcli.equations.derivation import lagrange
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare

ROOT = Path(__file__).parents[2]
PENDULUM = ROOT / "models" / "pendulum_chain.yaml"
BEAM = ROOT / "tests" / "found" / "beam40.yaml"


@pytest.fixture
def always(monkeypatch):
    """Take the recursive form of small models, too, from the first steps on."""
    monkeypatch.setattr(lagrange, "LEAST_RECURSIVE", 1)
    monkeypatch.setattr(single_runs, "may_unroll", lambda elimination: False)
    monkeypatch.setattr(prepared, "SHORT", 0)
    monkeypatch.setattr(prepared, "SHORTER", np.inf)
    monkeypatch.setattr(prepared.Prepared, "worth_unrolling", False)
    monkeypatch.setattr(single_runs, "PROGRAM_STEPS", 3)


def in_use(monkeypatch):
    """Return a list of the preparations that runs use."""
    used = []
    note = single_runs.Integration.note

    def noted(self, made):
        used.append(made)
        note(self, made)

    monkeypatch.setattr(single_runs.Integration, "note", noted)
    return used


def difference_of_pages(model, **settings):
    """Return what differs between a run and that of a page, bit by bit."""
    simulation = prepare(model, SettingsOverrides(method="DOP853", **settings))
    return difference(by_simulate(simulation), by_page(simulation, "DOP853"))


def integrated(acceleration, q, times):
    """Return the states by SciPy of a motion that starts from rest, (2 n, count)."""
    n = len(q)
    return solve_ivp(
        lambda t, y: np.concatenate([y[n:], acceleration(y[:n], y[n:])]),
        (times[0], times[-1]),
        np.concatenate([q, np.zeros(n)]),
        "DOP853",
        times,
        rtol=1e-12,
        atol=1e-13,
    ).y


@pytest.mark.parametrize("n", [3, 12, 20])
def test_motion_of_a_pendulum_of_links(n, always, monkeypatch):
    used = in_use(monkeypatch)
    model = lagcli.load(PENDULUM, set={"N": n, "theta_0": "80 deg"})
    run = lagcli.simulate(model, t_end=1.0, samples=11, rtol=1e-11, atol=1e-12)
    assert used[-1].recursive
    start = np.full(n, np.radians(80))
    expected = integrated(lambda q, v: pendulum(q, v, n), start, run.time)
    np.testing.assert_allclose(run.q, expected[:n].T, rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.v, expected[n:].T, rtol=0, atol=1e-6)


@pytest.mark.slow
def test_energy_of_many_links(monkeypatch):
    used = in_use(monkeypatch)
    monkeypatch.setattr(single_runs, "PROGRAM_STEPS", 20)
    model = lagcli.load(PENDULUM, set={"N": 100, "theta_0": "60 deg"})
    run = lagcli.simulate(model, t_end=0.2, samples=21)
    assert [made.recursive for made in used] == [False, True]
    outer = np.minimum.outer(np.arange(100, 0, -1), np.arange(100, 0, -1)) / 100.0**3
    apart = np.cos(run.q[:, :, None] - run.q[:, None, :])
    kinetic = 0.5 * np.einsum("ti,tij,tj->t", run.v, outer * apart, run.v)
    potential = -9.81 * 100.0 * np.cos(run.q) @ np.diag(outer)
    np.testing.assert_allclose(kinetic + potential, potential[0], rtol=0, atol=1e-10)
    assert kinetic[-1] > 0.05


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


@pytest.mark.parametrize("method", ["Radau", "Rodas5P"])
def test_implicit_methods_take_m_from_the_other_tape(method, always, monkeypatch):
    used = in_use(monkeypatch)
    model = lagcli.load(PENDULUM, set={"N": 6, "theta_0": "80 deg"})
    run = lagcli.simulate(model, t_end=0.5, samples=6, rtol=1e-9, method=method)
    assert used[-1].recursive
    start = np.full(6, np.radians(80))
    expected = integrated(lambda q, v: pendulum(q, v, 6), start, run.time)
    np.testing.assert_allclose(run.q, expected[:6].T, rtol=0, atol=1e-7)


def test_a_force_that_changes_its_law(always, monkeypatch):
    """The beam's force ends at t = π; the branches of comparisons are frozen within steps."""
    used = in_use(monkeypatch)
    monkeypatch.setattr(single_runs, "PROGRAM_STEPS", 50)
    model = lagcli.load(BEAM, set={"n": 8})
    run = lagcli.simulate(model, t_end=3.5, samples=8, rtol=1e-10, method="DOP853")
    assert used[-1].recursive
    monkeypatch.setattr(single_runs, "PROGRAM_STEPS", 10**9)
    expected = lagcli.simulate(model, t_end=3.5, samples=8, rtol=1e-10, method="DOP853")
    assert not used[-1].recursive
    np.testing.assert_allclose(run.q, expected.q, rtol=0, atol=1e-8)


@pytest.fixture
def wrong_form(monkeypatch):
    """A factor of the recursive form of systems is wrong in its fourth digit."""
    lower_recursive = lagcli.engine.lowering.lower.lower_recursive

    def wrong(equations, functions):
        first, *others = equations.recursive.velocities
        changed = first._replace(factor=1.001 * first.factor), *others
        recursive = equations.recursive._replace(velocities=changed)
        return lower_recursive(replace(equations, recursive=recursive), functions)

    monkeypatch.setattr("lagcli.engine.lowering.lower.lower_recursive", wrong)


def test_a_wrong_form_is_noticed_and_left(always, monkeypatch, request):
    used = in_use(monkeypatch)
    model = lagcli.load(PENDULUM, set={"N": 12})
    right = lagcli.simulate(model, t_end=0.3, samples=4)
    assert used[-1].recursive
    request.getfixturevalue("wrong_form")
    run = lagcli.simulate(model, t_end=0.3, samples=4)
    assert [made.recursive for made in used[-2:]] == [True, False]
    np.testing.assert_allclose(run.q, right.q, rtol=0, atol=1e-9)


@pytest.mark.bits
@pytest.mark.parametrize("form", ["always", "wrong_form"])
@pytest.mark.parametrize("text", [PENDULUM.read_text("utf-8"), ROPE], ids=["pendulum", "rope"])
def test_pages_take_the_recursive_form_and_leave_it_as_simulate_does(
    text, form, always, monkeypatch, request
):
    request.getfixturevalue(form)
    used = in_use(monkeypatch)
    assert difference_of_pages(lagcli.load_text(text, set={"N": 12}), t_end=0.3, samples=4) == ""
    assert [made.recursive for made in used[:2]] == [False, True]


@pytest.mark.parametrize("values", [{}, {"D": 0.65}], ids=["its start", "another one"])
def test_an_fmu_of_a_rope_takes_the_recursive_form(values, always, tmp_path):
    """Another start is the nearest one by M, which is that of the usual tape."""
    model = lagcli.load_text(ROPE)
    instance = Unpacked(lagcli.fmu(model, "2.0", icon=False), tmp_path).instance()
    run = lagcli.simulate(lagcli.load_text(ROPE, set=values), rtol=1e-10)
    instance.begin(0.0, values)
    assert instance.get(*run.coordinates) == pytest.approx(run.q[0].tolist(), abs=1e-9)
    for i in range(10):
        instance.step(i / 20, 0.05)
    assert instance.get(*run.coordinates) == pytest.approx(run.q[-1].tolist(), abs=1e-5)
    instance.free()


@pytest.mark.parametrize("n", [4, 12])
def test_motion_of_a_rope_between_two_points(n, always, monkeypatch):
    used = in_use(monkeypatch)
    run = lagcli.simulate(lagcli.load_text(ROPE, set={"N": n}), rtol=1e-11, atol=1e-12)
    assert used[-1].recursive
    expected = integrated(lambda q, v: rope(q, v)[0], run.q[0], run.time)
    np.testing.assert_allclose(run.q, expected[:n].T, rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.v, expected[n:].T, rtol=0, atol=1e-6)
    multipliers = [rope(y[:n], y[n:])[1] for y in expected.T]
    np.testing.assert_allclose(run.multipliers, multipliers, rtol=0, atol=1e-5)


def test_a_tractor_with_trailers(always, monkeypatch):
    """Each wheel's condition acts on all angles before it; all axles move on circles."""
    used = in_use(monkeypatch)
    n, d = 9, 0.3
    # on circles around one centre: each axle at the foot of a tangent from the one before
    radii = np.sqrt(4.0 - d**2 * np.arange(n + 1))
    turns = np.concatenate([[0.0], -np.cumsum(np.arctan2(d, radii[1:]))])
    headings = turns + np.pi / 2
    text = f"""
    coordinates: [x, y, q[0..{n}]]
    definitions:
      X[0]: x
      Y[0]: y
      X[i = 1..{n}]: X[i-1] - {d}*cos(q[i])
      Y[i = 1..{n}]: Y[i-1] - {d}*sin(q[i])
    T: sum(1/2*(X[i]'^2 + Y[i]'^2) + 0.05*q[i]'^2, i = 0..{n})
    V: 0
    constraints:
      roll[i = 0..{n}]: -sin(q[i])*X[i]' + cos(q[i])*Y[i]' = 0
    initial:
      x: {radii[0]}
      y: 0
      q[0]: {headings[0]}
      {{}}
      x': 0
      y': 1
      q[0]': {1 / radii[0]}
      q[1..{n}]': {{{{guess: 0}}}}
    simulation: {{{{t_end: 6, samples: 13}}}}
    """.format("\n      ".join(f"q[{i}]: {headings[i]}" for i in range(1, n + 1)))
    run = lagcli.simulate(lagcli.load_text(text), rtol=1e-10)
    assert used[-1].recursive
    angle = run.time / radii[0]
    np.testing.assert_allclose(run.q[:, 0], radii[0] * np.cos(angle), rtol=0, atol=1e-7)
    np.testing.assert_allclose(run.q[:, 1], radii[0] * np.sin(angle), rtol=0, atol=1e-7)
    np.testing.assert_allclose(run.q[:, 2:], headings + angle[:, None], rtol=0, atol=1e-7)


@pytest.mark.parametrize("seed", range(4))
def test_motions_of_random_trees_with_constraints(seed, monkeypatch, request):
    random = np.random.default_rng(200 + seed)
    tree = random_tree(random, 14)
    end = tree.splitlines()[-1]
    rows = "constraints:\n" + "\n".join(
        f"  c[{i}]: -sin(q[{i}])*X[{i}]' + cos(q[{i}])*Y[{i}]' = 0.2*sin(t)*q[1]'"
        for i in range(3, 12)
    )
    start = "initial: {q[1..14]: 0.1, q[1..14]': {guess: 0.2}}"
    model = lagcli.load_text(tree[: tree.index("initial:")] + f"{rows}\n{start}\n{end}")
    expected = lagcli.simulate(model, rtol=1e-11, atol=1e-12)
    request.getfixturevalue("always")
    used = in_use(monkeypatch)
    run = lagcli.simulate(model, rtol=1e-11, atol=1e-12)
    assert used[-1].recursive
    np.testing.assert_allclose(run.q, expected.q, rtol=0, atol=1e-9)
    scale = abs(expected.multipliers).max()
    np.testing.assert_allclose(run.multipliers, expected.multipliers, rtol=0, atol=1e-8 * scale)


def test_redundant_constraints_have_no_recursive_form(always, monkeypatch):
    used = in_use(monkeypatch)
    text = ROPE.replace("constraints:", "constraints:\n  again: 2*X[N] = 2*D")
    lagcli.simulate(lagcli.load_text(text), t_end=0.1)
    assert not any(made.recursive for made in used)


def test_few_velocities_have_no_recursive_form():
    small = lagrange.derive(lagcli.load(PENDULUM, set={"N": lagrange.LEAST_RECURSIVE - 1}))
    assert small.recursive is None
    chain = lagrange.derive(lagcli.load(ROOT / "models" / "chain.yaml", set={"N": 40}))
    assert chain.recursive is None
