"""Single runs: elimination, refinement, samples, redundant constraints, and an oracle."""

from __future__ import annotations

import math
import re
import time
from pathlib import Path

import numpy as np
import pytest
from oracle import motion
from shipped import every_model

import lagcli
from lagcli.engine.integrate import run as single_runs
from lagcli.engine.integrate.run import Integration
from lagcli.errors import UsageError
from lagcli.simulations.simulation import prepare as prepare_simulation

FOUND = Path(__file__).parents[3] / "found"
MODELS = sorted((Path(__file__).parents[4] / "models").glob("*.yaml"))
PENDULUM = lagcli.load_text("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {rod: x^2 + y^2 = 1}
initial: {x: 1, y: 0, x': 0, y': 0}
""")


@pytest.mark.parametrize("name", every_model(smooth=True))
def test_every_shipped_model_moves_as_by_the_oracle(name):
    model = lagcli.load(name)
    # a tenth of the model's own time: what differs is the error of the tolerance, not its growth
    options = {"t_end": 0.1 * model.settings.t_end, "samples": 21}
    run = lagcli.simulate(model, rtol=1e-11, atol=1e-12, **options)
    assert run.status == "completed"
    expected = motion(model, **options)
    for name in ("q", "v", "a", "multipliers"):
        one, other = getattr(run, name), getattr(expected, name)
        size = np.abs(other).max(axis=0, initial=0.0).max(initial=0.0)
        # 1e-11 per step, over some hundred steps, and once more in λ and a
        np.testing.assert_allclose(one, other, rtol=0, atol=3e-8 * (size + 1e-3), err_msg=name)
    for name in ("residual_position", "residual_velocity"):
        scale = getattr(run, name.replace("residual", "scale"))
        relative = np.abs(getattr(run, name)) / scale
        assert np.nanmax(relative, initial=0.0) <= 1e-12


@pytest.mark.parametrize("beside", [1e-6, 1e-8])
def test_sizes_of_accelerations_next_to_a_singular_configuration_do_not_last(beside):
    """They are large, as are their rounding errors, and are found again as the run moves away."""
    angle = math.pi / 2 + beside
    model = lagcli.load_text(f"""
coordinates: [a, b, x]
T: (1.3*(a'^2 + b'^2) + 0.7*x'^2)/2
constraints: {{crank: a^2 + b^2 = 1, rod: (x - a)^2 + b^2 = 1}}
initial:
  a: {math.cos(angle)!r}
  b: {math.sin(angle)!r}
  x: {2 * math.cos(angle)!r}
  a': {-4 * math.sin(angle)!r}
  b': {4 * math.cos(angle)!r}
  x': {-8 * math.sin(angle)!r}
""")

    run = lagcli.simulate(model, t_end=0.3, samples=31, rtol=1e-10, method="Taylor")
    assert run.status == "completed"
    for i, name in enumerate(run.coordinates):
        assert run.tolerances[name + "'"] < 2 * 0.1 * 1e-10 * np.abs(run.v[:, i]).max()


def only_densely(monkeypatch):
    """Let no system have an order of elimination."""
    from lagcli.engine.constraints import initial
    from lagcli.engine.integrate import prepared
    from lagcli.engine.linear import elimination

    def none(*_):
        raise elimination.NoElimination

    for module in (initial, prepared):
        monkeypatch.setattr(module, "order_at", none)


@pytest.mark.parametrize("name", every_model(smooth=True))
def test_ways_to_eliminate_agree(name, monkeypatch):
    """Unrolled into the tape, in a loop on the same order, and densely."""
    from lagcli.engine.integrate import prepared

    model = lagcli.load(name)
    options = {"t_end": 0.05 * model.settings.t_end, "samples": 6, "rtol": 1e-11, "atol": 1e-12}
    monkeypatch.setattr(prepared, "SHORT", math.inf)
    runs = [lagcli.simulate(model, **options)]
    monkeypatch.setattr(prepared, "MOST_UNROLLED", -1)
    runs.append(lagcli.simulate(model, **options))
    only_densely(monkeypatch)
    runs.append(lagcli.simulate(model, **options))
    for other in runs[1:]:
        assert other.status == "completed", other.message
        for name in ("q", "v", "multipliers"):
            one, two = getattr(runs[0], name), getattr(other, name)
            size = np.abs(one).max(initial=0.0)
            np.testing.assert_allclose(two, one, rtol=0, atol=3e-8 * (size + 1e-3), err_msg=name)


@pytest.mark.parametrize("entry", [0.0, 1e-14])
def test_an_order_that_does_not_suit_is_replaced(entry, monkeypatch):
    """An order that begins with a multiplier, whose pivot is zero or nearly so."""
    from lagcli.engine.integrate import prepared
    from lagcli.engine.linear import elimination

    asked = []
    find = prepared.order_at

    def unsuitable(system, states, rows=None):
        asked.append(len(states))
        if len(asked) > 1:
            return find(system, states, rows)
        return elimination.Elimination(
            order=(0, 1, 2), paired=(False,) * 3, columns=((1, 2), (2,), ()), smallest=1.0
        )

    # z has next to no inertia, and is eliminated first
    model = lagcli.load_text(f"""
coordinates: [z, x]
T: (x'^2 + {entry!r}*z'^2)/2
V: 9.81*z
constraints: {{rod: x^2 + z^2 = 1}}
initial: {{x: 0.6, z: -0.8, x': 0, z': 0}}
""")
    expected = motion(model, t_end=1, samples=5)
    monkeypatch.setattr(prepared, "order_at", unsuitable)
    found = lagcli.simulate(model, t_end=1, samples=5, rtol=1e-11)
    assert found.status == "completed", found.message
    assert len(asked) > 1
    np.testing.assert_allclose(found.q, expected.q, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.multipliers, expected.multipliers, rtol=1e-6)


@pytest.fixture
def counted(count_calls):
    """Count the searches for an order, the orders written out, and the programs assembled."""
    from lagcli.engine.constraints import initial
    from lagcli.engine.integrate import prepared

    return count_calls(
        (initial, "order_at"),
        (prepared, "order_at"),
        (prepared, "unroll"),
        (prepared, "assemble"),
    )


def test_what_a_long_elimination_lacks_is_refined(counted):
    """Rounding in a chain of 150 masses is more than a tight tolerance allows."""
    chain = next(p for p in MODELS if p.stem == "chain")
    model = lagcli.load(chain, set={"N": 150})
    options = {"t_end": 0.01, "samples": 3, "method": "DOP853"}
    tight = lagcli.simulate(model, rtol=1e-12, atol=1e-13, **options)
    assert counted["order_at"] == 1  # refined, not in a new order
    usual = lagcli.simulate(model, **options)
    assert tight.status == "completed", tight.message
    np.testing.assert_allclose(tight.q, usual.q, rtol=0, atol=1e-10)
    size = np.abs(tight.constraint_force).max()
    assert tight.residual_equation.max() <= 1e-12 * size


def test_errors_of_solutions_do_not_limit_steps(tmp_path):
    """A spinning top with its centre of mass at rest: its velocities are zero but for rounding."""
    path = tmp_path / "top.yaml"
    path.write_text("""\
coordinates: {r: point, e: quaternion}
parameters:
  {m: 0.2 kg, A: 8 kg*cm^2, C: 12 kg*cm^2, l: 50 mm, g: 9.81 m/s^2, th: 0.5 rad, w: 250 rad/s,
   precession: (C*w - sqrt((C*w)^2 - 4*A*cos(th)*m*g*l))/(2*A*cos(th))}
definitions: {tip: "r - e*[0, 0, l]"}
T: body(m, diag(A, A, C), r, e)
V: m*g*r.z
constraints: {table: tip.z = 0}
initial: {r: [0, 0, l*cos(th)], e: rot_x(th), r': 0, e': [0, precession*sin(th), w]}
outputs: {upright: "e[3,3]"}
simulation: {t_end: 0.2, samples: 21, max_steps: 3000}
""")
    run = lagcli.simulate(lagcli.load(path))
    assert run.status == "completed", run.message
    np.testing.assert_allclose(run.outputs["upright"], np.cos(0.5), rtol=1e-8)
    np.testing.assert_allclose(run.multipliers[:, 0], 0.2 * 9.81, rtol=1e-5)


def test_a_net_of_rods_keeps_its_order(counted, monkeypatch):
    """An order found for a flat net loses digits where it is folded: refinement regains them."""
    model = lagcli.load(FOUND / "net_rods.yaml", set={"N": 3})
    found = lagcli.simulate(model)
    assert found.status == "completed", found.message
    assert counted == {"order_at": 1, "assemble": 1, "unroll": 1}
    only_densely(monkeypatch)
    expected = lagcli.simulate(model, rtol=1e-10)
    np.testing.assert_allclose(found.q, expected.q, rtol=0, atol=1e-7)
    size = np.abs(expected.multipliers).max()
    np.testing.assert_allclose(found.multipliers, expected.multipliers, rtol=0, atol=1e-5 * size)


def test_a_long_run_unrolls_its_elimination(counted, monkeypatch):
    from lagcli.engine.integrate import prepared

    monkeypatch.setattr(prepared, "SHORT", 0)
    model = lagcli.load(MODELS[0].parent / "andrews_squeezer.yaml")
    looped = lagcli.simulate(model, method="DOP853", samples=11)
    assert not counted["unroll"]
    monkeypatch.setattr(single_runs, "PROGRAM_STEPS", 10)
    changed = [lagcli.simulate(model, method="DOP853", samples=11) for _ in range(2)]
    assert counted["unroll"] == 2
    np.testing.assert_allclose(changed[0].q, looped.q, rtol=0, atol=1e-7)
    # it is a number of steps that decides, not a time
    np.testing.assert_array_equal(changed[0].multipliers, changed[1].multipliers)


def test_when_an_elimination_is_unrolled_depends_on_the_model():
    def unrolling(path: Path, **values: str) -> float:
        simulation = prepare_simulation(lagcli.load(path, set=values))
        run = Integration(simulation.system, simulation.request, lambda block: None, None)
        return run.unroll_at

    chain = MODELS[0].parent / "chain.yaml"
    steps = unrolling(chain, N="100")
    assert steps == single_runs.PROGRAM_STEPS
    assert unrolling(chain) == math.inf  # unrolled from the start
    assert unrolling(FOUND / "door_two_hinges.yaml") == math.inf  # solved densely


def test_a_new_order_takes_over_the_other_programs(counted):
    from lagcli.engine.integrate.prepared import prepare

    chain = next(p for p in MODELS if p.stem == "chain")
    simulation = prepare_simulation(lagcli.load(chain, set={"N": 60}))
    order = simulation.start.elimination
    first = prepare(simulation.system, order)
    again = prepare(simulation.system, order._replace(order=order.order[::-1]), first)
    assert not again.unrolled
    assert again.dynamics is first.dynamics
    assert again.constraint is first.constraint


def test_samples_come_in_blocks():
    dense = lagcli.simulate(PENDULUM, t_end=3, samples=30001)
    sparse = lagcli.simulate(PENDULUM, t_end=3, samples=31)
    np.testing.assert_array_equal(dense.time, np.linspace(0, 3, 30001))
    # the steps do not depend on the samples: what differs is the rounding of the sample times
    np.testing.assert_allclose(dense.q[::1000], sparse.q, rtol=0, atol=1e-14)


def test_ten_to_the_fifth_samples_take_moments():
    began = time.process_time()
    trajectory = lagcli.simulate(PENDULUM, t_end=10, samples=100_001)
    assert len(trajectory.time) == 100_001
    assert time.process_time() - began < 20  # ten times what a slow machine takes


def test_redundant_constraints_get_the_least_multipliers():
    twice = lagcli.load_text("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {rod: x^2 + y^2 = 1, again: 3*(x^2 + y^2) = 3}
initial: {x: 1, y: 0, x': 0, y': 0}
""")
    one = lagcli.simulate(PENDULUM, t_end=2)
    two = lagcli.simulate(twice, t_end=2)
    np.testing.assert_allclose(two.q, one.q, atol=1e-8)
    rod = one.multipliers[:, 0]
    # λ₁ + 3 λ₂ = λ with λ₁² + λ₂² least: λ₁ = λ/10, λ₂ = 3 λ/10
    np.testing.assert_allclose(two.multipliers, np.outer(rod, [0.1, 0.3]), atol=1e-6)
    np.testing.assert_allclose(two.constraint_force, one.constraint_force, atol=1e-6)


def test_unknown_settings_and_methods_are_named_with_those_that_there_are():
    with pytest.raises(UsageError, match="no method `BDF`; known are auto, DOP853, Taylor"):
        lagcli.simulate(PENDULUM, method="BDF")
    with pytest.raises(UsageError, match="no setting `engine`; known are t_start, t_end"):
        lagcli.simulate(PENDULUM, engine="scipy")


def test_a_given_beta_is_used_when_alpha_comes_from_the_step():
    options = {"t_end": 1, "samples": 11, "formulation": "baumgarte"}
    followed = lagcli.simulate(PENDULUM, **options)
    given = lagcli.simulate(PENDULUM, **options, beta=50.0)
    assert not np.array_equal(followed.q, given.q)


def test_damping_from_the_step_leaves_the_motion():
    options = {"t_end": 2, "samples": 21}
    run = lagcli.simulate(PENDULUM, beta=20.0, formulation="baumgarte", rtol=1e-10, **options)
    # up to the drift that damping leaves
    np.testing.assert_allclose(run.q, motion(PENDULUM, **options).q, rtol=0, atol=1e-7)


@pytest.mark.parametrize("method", ["Taylor", "Rodas5P", "Radau"])
def test_methods_say_which_formulation_they_lack(method):
    with pytest.raises(UsageError, match=f"{method} has no Baumgarte stab.*--method DOP853"):
        lagcli.simulate(PENDULUM, method=method, formulation="baumgarte")


CRANKS = """
coordinates: [a[1..N], b[1..N]]
parameters: {N: 22, l: 1}
T: sum((1 + 0.1*i)/2*a[i]'^2 + b[i]'^2/3, i = 1..N)
V: 0
constraints:
  first: sin(a[1]) = l*sin(b[1])
  crank[i = 2..N]: sin(a[i]) = 3*sin(b[i])
initial:
  a[i = 1..N]: 0.3
  b[1..N]: {guess: 0.1}
  a[i = 1..N]': 1 + 0.01*i
  b[1..N]': {guess: 0.1}
simulation: {t_end: 2, samples: 201}
"""


@pytest.mark.parametrize("length", [1, 1.05])
def test_a_large_dense_system_is_watched_by_its_factors(length, monkeypatch):
    """With l = 1, the first crank's constraint loses its gradient where a = b = pi/2."""
    model = lagcli.load_text(CRANKS, set={"l": length})
    sparse = lagcli.simulate(model)
    only_densely(monkeypatch)
    dense = lagcli.simulate(model)
    assert dense.status == sparse.status
    if length == 1:
        stated = float(re.search(r"configuration at t = ([0-9.]+) s", dense.message)[1])
        assert stated == pytest.approx((np.pi / 2 - 0.3) / 1.01, abs=1e-6)
    else:
        assert dense.status == "completed"
        np.testing.assert_allclose(dense.q, sparse.q, rtol=0, atol=1e-9)
