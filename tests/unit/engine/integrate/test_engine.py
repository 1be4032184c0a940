"""Integration: samples, limits, failures, singular configurations, every method."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pendulum_by_hand import G, pendulum, pendulum_system, request
from scipy.integrate import quad

import lagcli
from lagcli.engine.contract import Block, Interrupted, Outcome
from lagcli.engine.integrate.engine import integrate
from lagcli.engine.system import State
from lagcli.model.model import Model
from lagcli.settings.methods import METHOD_NAMES
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations import simulation
from lagcli.trajectory.trajectory import Trajectory

MODELS = Path(__file__).parents[4] / "models"


@pytest.fixture(params=METHOD_NAMES)
def method(request: pytest.FixtureRequest) -> str:
    """Run a test with every method."""
    return request.param


@cache
def shipped(name: str, **initial: float) -> Model:
    changed = {key.replace("_dot", "'"): value for key, value in initial.items()}
    return lagcli.load(MODELS / f"{name}.yaml", set_initial=changed)


def text_model(text: str) -> Model:
    return lagcli.load_text("name: written in a test\n" + text)


PENDULUM = text_model("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {rod: x^2 + y^2 = 1}
initial: {x: 1, y: 0, x': 0, y': 0}
""")


def completed(model: Model, **options: Any) -> Trajectory:
    trajectory = lagcli.simulate(model, **options)
    assert trajectory.status == "completed", trajectory.message
    return trajectory


def failed(model: Model, **options: Any) -> Trajectory:
    trajectory = lagcli.simulate(model, **options)
    assert trajectory.status == "failed"
    return trajectory


# methods and formulations


def test_every_method_solves_the_pendulum(method: str) -> None:
    rtol = {"Radau": 1e-6}.get(method, 1e-8)
    trajectory = completed(PENDULUM, method=method, rtol=rtol, atol=rtol, t_end=2, samples=21)
    # errors of the single steps add up and grow: a few hundred tolerances in two periods
    np.testing.assert_allclose(trajectory.q, pendulum(trajectory.time), rtol=0, atol=500 * rtol)
    assert np.abs(trajectory.residual_position).max() <= 1e-12 * trajectory.scale_position[0]
    assert np.abs(trajectory.residual_velocity).max() <= 1e-12 * trajectory.scale_velocity[0]


@pytest.mark.parametrize("rtol", [1e-4, 1e-9])
@pytest.mark.parametrize("name", ["slider_crank", "four_bar", "car_axis", "rolling_disk"])
def test_projection_keeps_the_constraints_at_every_sample(name: str, rtol: float) -> None:
    trajectory = completed(shipped(name), rtol=rtol, atol=rtol, t_end=0.5, samples=101)
    position = np.nan_to_num(trajectory.residual_position / trajectory.scale_position)
    # what results promise, whatever the tolerance
    assert np.abs(position).max() <= 1e-12
    assert np.abs(trajectory.residual_velocity / trajectory.scale_velocity).max() <= 1e-12


def test_index1_drifts() -> None:
    drift = [
        np.abs(
            completed(
                PENDULUM, formulation="index1", rtol=1e-5, atol=1e-5, t_end=t, samples=11
            ).residual_position
        ).max()
        for t in (4, 16)
    ]
    assert drift[0] > 1e-7
    assert drift[1] > 3 * drift[0]  # and it grows


@pytest.mark.parametrize(
    "damping", [{"alpha": 10.0, "beta": 10.0}, {"alpha": 10.0}, {}, {"beta": 8.0}]
)
def test_baumgarte_bounds_the_drift(damping: dict[str, float]) -> None:
    options: dict[str, Any] = {"rtol": 1e-5, "atol": 1e-5, "samples": 41}
    free = completed(PENDULUM, formulation="index1", t_end=16, **options)
    kept = [
        completed(PENDULUM, formulation="baumgarte", t_end=t, **damping, **options) for t in (4, 16)
    ]
    early, late = (np.abs(k.residual_position).max() for k in kept)
    assert late < 0.3 * np.abs(free.residual_position).max()
    assert late < 3 * early  # bounded: it does not grow with time
    assert late > 1e-12  # damped, not projected


def test_formulations_differ_in_nothing_but_the_constraints() -> None:
    runs = [
        completed(PENDULUM, formulation=f, rtol=1e-11, atol=1e-11, t_end=2, samples=21)
        for f in ("projection", "index1", "baumgarte")
    ]
    for other in runs[1:]:
        np.testing.assert_allclose(other.q, runs[0].q, rtol=0, atol=1e-8)
        np.testing.assert_allclose(other.multipliers, runs[0].multipliers, rtol=0, atol=1e-6)


def test_stiff_model() -> None:
    stiff = text_model("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y + 1e8/2*(sqrt(x^2 + y^2) - 1)^2
D: 1e5/2*(x*x' + y*y')^2
initial: {x: 1, y: 0, x': 0, y': 0}
""")
    trajectory = completed(stiff, method="Radau", t_end=0.2, samples=5, rtol=1e-6, atol=1e-6)
    # a rod in all but name: it is longer by m (g + v²)/k at most, 3e-7
    np.testing.assert_allclose(trajectory.q, pendulum(trajectory.time), rtol=0, atol=1e-5)
    assert trajectory.counts["steps"] < 300
    explicit = failed(stiff, method="DOP853", t_end=0.2, max_steps=100)
    assert "--max-steps" in explicit.message


# samples


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"samples": 5}, [0, 0.25, 0.5, 0.75, 1]),
        ({"samples": 1}, [1]),
        ({"samples": 2}, [0, 1]),
        ({"dt": 0.25}, [0, 0.25, 0.5, 0.75, 1]),
        ({"dt": 0.4}, [0, 0.4, 0.8]),
        ({"dt": 2}, [0]),
        ({"times": (0.1, 0.2, 0.95), "t_end": None}, [0.1, 0.2, 0.95]),
        ({"times": (0.0,), "t_end": None}, [0]),
        ({"times": (0.3, 1.0)}, [0.3, 1]),
    ],
)
def test_sample_times(options: dict[str, Any], expected: list[float]) -> None:
    trajectory = completed(PENDULUM, **({"t_end": 1} | options))
    np.testing.assert_allclose(trajectory.time, expected, rtol=1e-15)
    np.testing.assert_allclose(trajectory.q, pendulum(trajectory.time), rtol=0, atol=1e-8)


def test_ends_are_exact() -> None:
    trajectory = completed(PENDULUM, t_start=0.1, t_end=0.7, dt=0.1)
    assert trajectory.time[0] == 0.1
    assert trajectory.time[-1] == 0.7
    assert len(trajectory.time) == 7


@pytest.mark.parametrize("start", [-3.0, 0.7, 1000.0])
def test_start_time(start: float) -> None:
    trajectory = completed(PENDULUM, t_start=start, t_end=start + 1, samples=11)
    assert trajectory.time[0] == start
    np.testing.assert_allclose(trajectory.q, pendulum(trajectory.time - start), rtol=0, atol=1e-8)


def test_many_samples_in_few_steps() -> None:
    trajectory = completed(PENDULUM, t_end=0.1, samples=1_001, rtol=1e-8)
    assert len(trajectory.time) == 1_001
    assert trajectory.counts["steps"] < 30
    np.testing.assert_allclose(trajectory.q, pendulum(trajectory.time), rtol=0, atol=1e-6)


def test_samples_do_not_change_the_steps() -> None:
    few, many = (completed(PENDULUM, t_end=1, samples=n) for n in (2, 500))
    assert few.counts["steps"] == many.counts["steps"]
    np.testing.assert_array_equal(few.q[-1], many.q[-1])


# limits


def test_max_steps() -> None:
    trajectory = failed(PENDULUM, max_steps=7, t_end=10, samples=1001)
    assert trajectory.counts["steps"] == 7
    assert "after 7 steps" in trajectory.message
    assert "--max-steps" in trajectory.message
    assert 0 < trajectory.time[-1] < 10


def test_max_steps_that_are_just_enough() -> None:
    free = completed(PENDULUM, t_end=0.5, samples=11)
    again = completed(PENDULUM, t_end=0.5, samples=11, max_steps=free.counts["steps"])
    np.testing.assert_array_equal(again.q, free.q)


def test_timeout() -> None:
    trajectory = failed(PENDULUM, timeout=0.05, t_end=1e6, samples=10**6)
    assert "--timeout" in trajectory.message
    assert 0 < len(trajectory.time) < 10**6


def test_samples_beyond_the_end_of_a_run_cost_nothing() -> None:
    began = time.process_time()
    failed(PENDULUM, timeout=0.01, t_end=1e6, samples=10**7)
    # the times themselves are 80 MB; a list of them would take seconds
    assert time.process_time() - began < 2


def test_timeout_within_one_step() -> None:
    began = time.process_time()
    trajectory = failed(PENDULUM, timeout=0.2, t_end=0.01, samples=10**6)
    assert time.process_time() - began < 3  # all the samples would take minutes
    assert len(trajectory.time) > 1


def test_max_step() -> None:
    free, bounded = (
        completed(PENDULUM, t_end=1, samples=2, rtol=1e-3, atol=1e-3, **limit)
        for limit in ({}, {"max_step": 0.01})
    )
    assert free.counts["steps"] < 30
    assert 100 <= bounded.counts["steps"] <= 110


def test_interrupt_keeps_the_samples(method: str) -> None:
    def interrupt(t: float) -> None:
        if t > 0.5:
            raise Interrupted

    # more steps than a slice of the core has
    options = {"method": method, "rtol": 1e-5, "t_end": 9, "max_step": 0.02}
    trajectory = lagcli.simulate(PENDULUM, progress=interrupt, **options)
    assert trajectory.status == "interrupted"
    assert "interrupted" in trajectory.message
    assert 0.4 < trajectory.time[-1] < 9
    np.testing.assert_allclose(trajectory.q, pendulum(trajectory.time), rtol=0, atol=1e-2)


# what fails


@pytest.mark.parametrize(
    ("V", "expression"), [("2*x - sqrt(x)", "sqrt(x)"), ("2*x - x*log(x)", "log(x)")]
)
def test_leaving_the_domain(V: str, expression: str, method: str) -> None:
    model = text_model(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: {V}
initial: {{x: 1, x': -3, y: 0, y': 1}}
""")
    trajectory = failed(model, method=method, t_end=4, samples=401, rtol=1e-6)
    assert "no finite value" in trajectory.message
    assert f"`{expression}`" in trajectory.message
    assert "x = " in trajectory.message
    # the samples up to there are kept
    assert 0.1 < trajectory.time[-1] < 1
    assert np.isfinite(trajectory.q).all()
    assert trajectory.q[-1, 0] < 0.1


def test_constraint_leaving_its_domain() -> None:
    model = text_model("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
constraints: {c: y = sqrt(1 - x)}
initial: {x: 0, x': 1, y: {guess: 1}, y': {guess: 0}}
""")
    trajectory = failed(model, t_end=4, samples=401)
    assert trajectory.time[-1] < 2
    assert np.isfinite(trajectory.q).all()


def test_step_size_floor_names_the_fastest_coordinate() -> None:
    # x'' = x² escapes to infinity in finite time
    model = text_model("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: -x^3/3
initial: {x: 6, x': 12, y: 0, y': 1}
""")
    trajectory = failed(model, t_end=2, samples=201)
    # E = 0: x' = sqrt(2/3) x^(3/2), infinite at 2/sqrt(2/3 · 6) = 1
    stated = float(trajectory.message.split("t = ")[1].split(" s")[0])
    assert stated == pytest.approx(1, abs=1e-3)
    assert "`x`" in trajectory.message
    assert len(trajectory.time) in (100, 101)


def test_times_that_are_far_apart_are_the_cause_of_steps_that_are_too_short() -> None:
    """Doubles near 1e16 are 2 apart, and the pendulum has a period of 2 s."""
    trajectory = failed(PENDULUM, t_start=1e16, t_end=1e16 + 1000, samples=2)
    assert "where times differ by 2 s at least: let the run start nearer to t = 0" in (
        trajectory.message
    )


# redundant and contradicting constraints


def test_redundant_constraints_run() -> None:
    trajectory = completed(shipped("parallelogram"), t_end=1, samples=11)
    assert np.abs(trajectory.residual_velocity).max() < 1e-12 * trajectory.scale_velocity.max()


@pytest.mark.parametrize("other", ["x = t", "x = sin(t) + t^4/100", "x = t - t^3/6"])
def test_constraints_that_come_to_contradict_each_other(other: str) -> None:
    model = text_model(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
constraints: {{one: x = sin(t), two: {other}}}
initial: {{x: {{guess: 0}}, x': {{guess: 1}}, y: 0, y': 1}}
""")
    trajectory = failed(model, t_end=5, samples=501)
    assert "contradict" in trajectory.message
    assert "`one`" in trajectory.message or "`two`" in trajectory.message
    # what was written before is on both
    position = np.abs(trajectory.residual_position / trajectory.scale_position)
    assert position.max(initial=0) < 1e-6
    assert trajectory.time.max(initial=0) < 1


# sizes at their ends


def test_no_constraints() -> None:
    model = text_model("coordinates: [x]\nT: x'^2/2\nV: x^2/2\ninitial: {x: 1, x': 0}\n")
    trajectory = completed(model, t_end=6, samples=61)
    np.testing.assert_allclose(trajectory.q[:, 0], np.cos(trajectory.time), atol=1e-8)
    assert trajectory.multipliers.shape == (61, 0)
    assert trajectory.constraint_force.shape == (61, 1)


@pytest.mark.parametrize("formulation", ["projection", "index1", "baumgarte"])
def test_the_work_of_a_driven_constraint_is_counted_once(formulation: str) -> None:
    model = text_model("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {rod: (x - 0.3*sin(2*t))^2 + y^2 = 1}
initial: {x: 0.8, y: -0.6, x': {guess: 0.3}, y': {guess: 0.4}}
""")
    trajectory = completed(
        model, t_end=3, samples=31, formulation=formulation, rtol=1e-10, atol=1e-10
    )
    assert np.ptp(trajectory.energy_kinetic + trajectory.energy_potential) > 1  # the drive works
    assert np.abs(trajectory.energy_balance).max() < 1e-8


@pytest.mark.parametrize("formulation", ["projection", "index1", "baumgarte"])
def test_no_degrees_of_freedom(formulation: str) -> None:
    model = text_model("""
coordinates: [x]
T: x'^2/2
constraints: {drive: x = sin(3*t)}
initial: {x: {guess: 0}, x': {guess: 0}}
""")
    trajectory = completed(model, t_end=2, samples=21, formulation=formulation)
    np.testing.assert_allclose(trajectory.q[:, 0], np.sin(3 * trajectory.time), atol=1e-8)
    np.testing.assert_allclose(
        trajectory.multipliers[:, 0], -9 * np.sin(3 * trajectory.time), atol=1e-6
    )


# singular configurations


def passage_of_parallelogram() -> float:
    """Return when the cranks, started at −30° with 6 rad/s, lie flat: energy of one pendulum."""
    p = shipped("parallelogram").parameter_values
    w2 = 2 * (3 * p["m"] / 2 + p["M"]) * p["g"] / ((p["m"] + p["M"]) * p["l"])
    start = -math.pi / 6
    return quad(lambda x: 1 / math.sqrt(36 - w2 * (math.sin(x) - math.sin(start))), start, 0)[0]


CRANK = """
coordinates: [phi, psi]
T: (phi'^2 + psi'^2)/2
constraints: {guide: sin(phi) = sin(psi)}
initial: {phi: 0.5, phi': 2, psi: {guess: 0.5}, psi': {guess: 0}}
"""


@pytest.mark.parametrize("rtol", [1e-5, 1e-9, 1e-12])
@pytest.mark.parametrize(
    ("model", "instant", "names"),
    [
        (
            lambda: shipped("parallelogram", alpha_1_dot=6),
            passage_of_parallelogram,
            ("`right_x`", "`middle_x`"),
        ),
        # both angles turn at 2 rad/s, and both cosines vanish at π/2
        (lambda: text_model(CRANK), lambda: (math.pi / 2 - 0.5) / 2, ("`guide`",)),
    ],
)
def test_stops_at_a_singular_configuration(
    model: Callable[[], Model], instant: Callable[[], float], names: tuple[str, ...], rtol: float
) -> None:
    expected = instant()
    trajectory = failed(model(), t_end=3 * expected, samples=301, rtol=rtol, atol=rtol)
    assert "singular configuration" in trajectory.message
    assert "--through-singular" in trajectory.message
    assert all(name in trajectory.message for name in names)
    stated = float(trajectory.message.split("t = ")[1].split(" s")[0])
    assert stated == pytest.approx(expected, abs=max(1e-6, 10 * rtol))
    # nothing is written beyond it, and nearly everything before
    assert (np.diff(trajectory.time) > 0).all()
    assert 0.9 * expected < trajectory.time[-1] <= expected * (1 + 1e-6)


def test_passes_a_singular_configuration_on_request() -> None:
    model, t_end = text_model(CRANK), 4.0
    trajectory = completed(model, t_end=t_end, samples=401, through_singular=True, rtol=1e-10)
    expected = 0.5 + 2 * trajectory.time
    # five passages, each good to 1e-10 or so
    for angle in trajectory.q.T:
        np.testing.assert_allclose(angle, expected, rtol=0, atol=1e-8)
    assert np.abs(trajectory.residual_position).max() < 1e-9


@pytest.mark.parametrize("rtol", [1e-7, 1e-9, 1e-11])
def test_passes_keep_energy_and_branch(rtol: float) -> None:
    model = shipped("parallelogram", alpha_1_dot=12)
    trajectory = completed(model, t_end=2, samples=201, through_singular=True, rtol=rtol, atol=rtol)
    alpha = trajectory.q[:, 0]
    assert alpha[-1] > 4 * math.pi  # round and round, two passages a turn
    np.testing.assert_allclose(trajectory.q[:, 3], 0, atol=1e-7)  # the platform stays level
    np.testing.assert_allclose(trajectory.q[:, 1], alpha, atol=1e-7)
    size = np.ptp(trajectory.energy_kinetic)
    assert np.abs(trajectory.energy_balance).max() < max(100 * rtol, 1e-8) * size


@pytest.mark.parametrize("speed", [0.0, 1.0])
@pytest.mark.parametrize("through", [False, True])
def test_start_in_a_singular_configuration(speed: float, through: bool) -> None:
    model = text_model(f"""
coordinates: [phi, psi]
T: (phi'^2 + psi'^2)/2
constraints: {{guide: cos(phi) = cos(psi)}}
initial: {{phi: 0, phi': {speed}, psi: 0, psi': {speed}}}
""")
    trajectory = failed(model, t_end=1, through_singular=through)
    assert "the start is a singular configuration" in trajectory.message
    assert "`guide`" in trajectory.message
    assert "start away from it" in trajectory.message
    assert len(trajectory.time) == 0


def test_constraint_without_a_gradient_is_a_singular_start() -> None:
    trajectory = failed(lagcli.load(MODELS / "pendulum_cartesian.yaml", set={"l": 0}), t_end=1)
    assert "the start is a singular configuration" in trajectory.message
    assert "`rod`" in trajectory.message


def test_redundant_start_is_no_singular_one() -> None:
    twice = text_model("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {rod: x^2 + y^2 = 1, again: 2*x^2 + 2*y^2 = 2}
initial: {x: 1, y: 0, x': 0, y': 0}
""")
    trajectory = completed(twice, t_end=2, samples=21)
    np.testing.assert_allclose(trajectory.q, pendulum(trajectory.time), rtol=0, atol=1e-8)


def test_nearly_singular_motion_continues() -> None:
    # the crank is shorter than the rod by one part in a thousand: psi turns back at 87.4°
    model = text_model(CRANK.replace("sin(phi) =", "0.999*sin(phi) ="))
    trajectory = completed(model, t_end=3, samples=301)
    assert np.abs(trajectory.q[:, 1]).max() < math.pi / 2
    assert np.abs(trajectory.energy_balance).max() < 1e-7


# a System written by hand


def integrated(**changes: Any) -> tuple[Outcome, list[Block]]:
    blocks: list[Block] = []
    return integrate(pendulum_system(), request(**changes), blocks.append), blocks


def test_system_written_by_hand() -> None:
    run, blocks = integrated()
    assert run.status == "completed"
    assert run.undefined is None
    assert run.steps > 10
    assert run.evaluations > 10 * run.steps
    (block,) = blocks
    np.testing.assert_allclose(block.q, pendulum(block.time), rtol=0, atol=1e-8)
    # λ = −(m g cos θ + m v²/l)/(2 l), v² = 2 g (−y)
    np.testing.assert_allclose(block.multipliers[:, 0], 3 * G * block.q[:, 1] / 2, atol=1e-7)
    np.testing.assert_allclose(block.work, 0, atol=1e-9)  # like the other errors


def test_run_reports_its_progress() -> None:
    seen: list[float] = []
    integrate(pendulum_system(), request(), lambda block: None, seen.append)
    assert seen == sorted(seen)


def test_samples_are_handed_over_in_blocks() -> None:
    run, blocks = integrated(block_rows=8)
    assert run.status == "completed"
    assert [len(block.time) for block in blocks] == [8, 8, 5]
    np.testing.assert_array_equal(np.concatenate([b.time for b in blocks]), np.linspace(0, 2, 21))


def test_without_projection_the_constraint_drifts() -> None:
    drift = {}
    for formulation in ("projection", "index1"):
        _, (block,) = integrated(formulation=formulation, rtol=1e-4, atol=1e-4)
        drift[formulation] = np.abs((block.q**2).sum(axis=1) - 1).max()
    assert drift["projection"] < 1e-14
    assert drift["index1"] > 1e-6


def test_a_run_ends_at_its_limits() -> None:
    run, blocks = integrated(max_steps=5)
    assert (run.status, run.steps) == ("failed", 5)
    assert "--max-steps" in run.message
    assert len(blocks[0].time) < 21  # those reached by then


def test_exceptions_of_the_sink_propagate_to_the_caller() -> None:
    def full(block: Block) -> None:
        raise OSError("no space left")

    with pytest.raises(OSError, match="no space"):
        integrate(pendulum_system(), request(block_rows=2), full)


def test_a_start_without_finite_accelerations_is_undefined() -> None:
    start = State(0.0, np.array([1.0, 0.0]), np.zeros(2), (math.inf,))
    run, blocks = integrated(state=start)
    assert run.status == "failed"
    assert "no finite value at t = 0" in run.message
    assert run.undefined is not None
    np.testing.assert_array_equal(run.undefined.q, start.q)
    assert not blocks


def test_an_interval_of_no_length_is_its_start() -> None:
    run, (block,) = integrated(t_end=0.0, times=np.array([0.0]))
    assert (run.status, run.steps) == ("completed", 0)
    np.testing.assert_array_equal(block.q, [[1.0, 0.0]])
    np.testing.assert_allclose(block.a, [[0.0, -G]], atol=1e-15)


# Systems that switch, and others

FALL = """
coordinates: [y]
T: y'^2/2
V: 2*y
initial: {y: 1, y': 0}
"""


@pytest.mark.parametrize(("floor", "end"), [("", -3.0), ("constraints: {floor: y >= 0}", 0.0)])
def test_what_runs_a_system(floor: str, end: float) -> None:
    prepared = simulation.prepare(lagcli.load_text(FALL + floor), SettingsOverrides(t_end=2))
    blocks: list[Block] = []
    outcome = integrate(prepared.system, prepared.request, blocks.append)
    assert outcome.status == "completed"
    assert blocks[-1].q[-1] == pytest.approx([end], abs=1e-9)
    assert bool(outcome.events) == bool(floor)
