"""Event mode, early return and intermediate updates of FMUs of FMI 3.0, by a master in ctypes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fmi import FmuError, Instance, Unpacked
from fmu_events import with_events
from shipped import PATHS, REPRESENTATIVES
from stepped_inputs import as_parameter
from test_fmu import unpacked

import lagcli

SWITCHING = [
    pytest.param(name, marks=[] if name in REPRESENTATIVES else [pytest.mark.slow])
    for name, path in PATHS.items()
    if path.parent.name == "contact" and name != "appell_hamel"
]
CLOCK = """
coordinates: {x: m}
parameters: {m: 1 kg, F: 0 N, held: 0 N}
T: m/2*x'^2
V: 0
Q: {x: held}
events: {hold: {every: 0.1 s, set: {held: F}}}
initial: {x: 0, x': 0}
simulation: {t_end: 1}
"""


def state_names(model: lagcli.Model) -> list[str]:
    return [f"{q}{rate}" for rate in ("", "_dot") for q in model.coordinate_names]


def communication_points(run: lagcli.Trajectory, end: float, seed: int) -> list[float]:
    """Return the start, few or many points, some at events or within rounding of them, the end."""
    random, start, log = np.random.default_rng(seed), run.time[0], run.events
    assert log is not None
    count, power = random.choice([0, 4, 30]), random.choice([1, 4])
    points = start + (end - start) * random.random(count) ** power
    near = random.choice([0.0, 1e-15, -1e-15, 1e-12, -1e-9], 3)
    points = np.append(points, random.choice(np.append(log.time, end), 3) * (1 + near))
    return [start, *np.unique(points[(points > start) & (points < end)]).tolist(), end]


@pytest.mark.parametrize("name", SWITCHING)
def test_events_are_those_of_simulate(name: str, tmp_path: Path) -> None:
    """Times, velocities before and after, and the last state; see docs/decisions for the errors."""
    model = lagcli.load(name)
    run = lagcli.simulate(model)
    log, nq, end = run.events, len(model.coordinate_names), float(model.settings.t_end or 0.0)
    assert log is not None
    listed = [i for i, kind in enumerate(log.kinds) if kind != "rest" and log.time[i] > run.time[0]]
    assert listed
    fmu, names = unpacked(model, tmp_path, "3.0"), state_names(model)
    size = np.maximum(np.abs(np.hstack([run.q, run.v])).max(axis=0), 1e-4)
    for points in ([run.time[0], end], communication_points(run, end, seed=1)):
        found = with_events(fmu, names, points)
        times = np.array([instant.time for instant in found.instants])
        for i in listed:
            nearest = int(np.abs(times - log.time[i]).argmin())
            assert abs(times[nearest] - log.time[i]) <= 1e-8
            own = [k for k in listed if abs(log.time[k] - log.time[i]) <= 1e-8]
            before = found.instants[nearest].before[nq:], log.before[own[0]]
            assert (np.abs(before[0] - before[1]) <= 1e-7 * size[nq:]).all()
            if "rest" not in log.kinds:
                after = found.instants[nearest].after[nq:], log.after[own[-1]]
                assert (np.abs(after[0] - after[1]) <= 1e-7 * size[nq:]).all()
        # nothing else is reported
        assert all(np.abs(log.time[listed] - t).min() <= 1e-8 for t in times)
        assert found.terminated == (run.status == "stopped-by-event")
        if not found.terminated:
            last = np.concatenate([run.q[-1], run.v[-1]])
            assert (np.abs(found.values - last) <= 1e-7 * size).all()


@pytest.mark.parametrize("name", ["woodpecker", "stick_slip_belt"])
def test_a_state_before_an_event_is_restored_to_the_last_bit(name: str, tmp_path: Path) -> None:
    model = lagcli.load(name)
    run = lagcli.simulate(model)
    fmu = unpacked(model, tmp_path, "3.0")
    names, random = list(fmu.variables), np.random.default_rng(5)
    points = communication_points(run, float(run.time[-1]), seed=4)

    def elsewhere(one: Instance) -> Instance:
        how = random.random()
        state = one.save()
        content = one.serialize(state)
        one.forget(state)
        if how < 0.4:
            return one
        if how < 0.7:
            one.call("Reset")
        else:
            one.free()
            one = fmu.instance(events=True, early=True)
        one.restore_from(content)
        return one

    plain, restored = with_events(fmu, names, points), with_events(fmu, names, points, elsewhere)
    assert restored.time == plain.time
    assert np.array_equal(restored.values, plain.values, equal_nan=True)
    for own, expected in zip(restored.instants, plain.instants, strict=True):
        assert own.time == expected.time
        assert np.array_equal(own.before, expected.before, equal_nan=True)
        assert np.array_equal(own.after, expected.after, equal_nan=True)


def test_an_event_that_is_not_handled_happens_with_the_next_step(tmp_path: Path) -> None:
    fmu, names = unpacked(lagcli.load("bouncing_ball"), tmp_path, "3.0"), ["y", "y_dot"]
    one, handled = fmu.instance(events=True, early=True), with_events(fmu, names, [0.0, 1.5])
    one.begin(0.0)
    t = 0.0
    while t < 1.5:
        t = one.step3(t, 1.5 - t).time
    assert one.get(*names) == handled.values.tolist()
    one.free()


def test_without_early_return_only_events_at_the_end_are_reported(tmp_path: Path) -> None:
    """The others happen within the step, as they do without event mode."""
    fmu, names = unpacked(lagcli.load("bouncing_ball"), tmp_path, "3.0"), ["y", "y_dot"]
    one, without = fmu.instance(events=True), fmu.instance()
    for instance in (one, without):
        instance.begin(0.0)
        step = instance.step3(0.0, 1.5)
        assert step == (False, False, False, 1.5)
    assert one.get(*names) == without.get(*names)
    one.free()
    without.free()
    ticks = unpacked(lagcli.load_text(CLOCK), tmp_path / "ticks", "3.0", inputs=["F"])
    one = ticks.instance(events=True)
    one.begin(0.0)
    assert one.step3(0.0, 0.25) == (False, False, False, 0.25)
    assert one.step3(0.25, 0.3 - 0.25) == (True, False, False, 0.3)
    one.free()


def test_the_next_tick_is_announced_and_sees_what_is_set_in_event_mode(tmp_path: Path) -> None:
    """Without event mode, a tick at a communication point sees the input before it."""
    fmu = unpacked(lagcli.load_text(CLOCK), tmp_path, "3.0", inputs=["F"])
    one = fmu.instance(events=True, early=True)
    one.begin(0.0)
    _, following = one.happen()
    assert following == 0.1
    step = one.step3(0.0, 1.0)
    assert step == (True, False, True, 0.1)
    one.set({"F": 3.0})
    assert one.happen() == (False, 0.2)
    assert one.get("held", "F") == [3.0, 3.0]
    assert one.step3(0.1, 0.1).event
    one.free()
    one = fmu.instance()
    one.begin(0.0)
    one.step(0.0, 0.1)
    one.set({"F": 3.0})
    assert one.get("held") == [0.0]
    one.free()


def test_an_input_is_an_event_of_its_own(tmp_path: Path) -> None:
    kind = "an event of the input"
    fmu = unpacked(lagcli.load_text(as_parameter(kind)), tmp_path, "3.0", inputs=["F"])
    one, plain = fmu.instance(events=True, early=True), fmu.instance()
    one.begin(0.0)
    one.happen()
    plain.begin(0.0)
    for instance in (one, plain):
        instance.step(0.0, 0.5)
        instance.set({"F": 20.0})
    one.happen()
    assert one.get("s", "x", "x_dot") == plain.get("s", "x", "x_dot")
    one.free()
    plain.free()


def test_an_event_that_stops_ends_the_simulation_once_it_is_handled(tmp_path: Path) -> None:
    model = lagcli.load("particle_on_sphere")
    run = with_events(unpacked(model, tmp_path, "3.0"), [], [0.0, 5.0])
    assert run.terminated
    log = lagcli.simulate(model).events
    assert log is not None
    assert run.time == pytest.approx(log.time[-1], abs=1e-9)


@pytest.mark.parametrize("name", ["slider_crank", "bouncing_ball"])
def test_steps_within_are_reported_and_may_be_the_last(name: str, tmp_path: Path) -> None:
    """The values are those of a simulation with a communication point there."""
    fmu = unpacked(lagcli.load(name), tmp_path, "3.0")
    names, seen = list(fmu.variables), list[tuple[float, list[float]]]()
    end = 0.23

    def update(t: float) -> float | None:
        seen.append((t, one.get(*names)))
        return end if t > 0.1 else None

    one = fmu.instance(early=True, update=update)
    one.begin(0.0)
    step = one.step3(0.0, 0.5)
    times = [t for t, _ in seen]
    assert times == sorted(times)
    assert len(times) > 2
    assert step == (False, False, True, end)
    assert times[-1] == end
    other = fmu.instance()
    other.begin(0.0)
    other.step(0.0, end)
    expected = np.array(other.get(*names))
    assert np.allclose(seen[-1][1], expected, rtol=1e-8, atol=1e-10)
    assert np.allclose(one.get(*names), expected, rtol=1e-8, atol=1e-10)
    one.free()
    other.free()
    if name == "slider_crank":  # not allowed: the wish has no effect
        seen.clear()
        one = fmu.instance(update=update)
        one.begin(0.0)
        assert one.step3(0.0, 0.5) == (False, False, False, 0.5)
        one.free()


def test_an_instance_begins_again_with_its_events_and_says_when_it_has_none(
    tmp_path: Path,
) -> None:
    fmu, times = unpacked(lagcli.load("bouncing_ball"), tmp_path, "3.0"), []
    one = fmu.instance(events=True, early=True)
    with pytest.raises(FmuError, match="has not begun"):
        one.happen()
    for _ in range(2):
        one.begin(0.0)
        one.happen()
        times.append(one.step3(0.0, 2.0))
        one.call("Reset")
    assert times[0] == times[1]
    assert times[0].event
    one.free()


def test_smooth_models_have_no_events(tmp_path: Path) -> None:
    fmu = unpacked(lagcli.load("slider_crank"), tmp_path, "3.0")
    run = with_events(fmu, ["phi"], [0.0, 0.1, 0.5])
    assert not run.instants
    one = fmu.instance()
    one.begin(0.0)
    one.step(0.0, 0.1)
    one.step(0.1, 0.4)
    assert one.get("phi") == run.values.tolist()
    one.free()


def test_the_description_says_what_there_is(tmp_path: Path) -> None:
    for version in ("2.0", "3.0"):
        fmu: Unpacked = unpacked(lagcli.load("bouncing_ball"), tmp_path / version, version)
        kind = fmu.description.find("CoSimulation")
        assert kind is not None
        new = ("hasEventMode", "mightReturnEarlyFromDoStep", "providesIntermediateUpdate")
        for attribute in (*new, "canReturnEarlyAfterIntermediateUpdate"):
            assert kind.get(attribute) == (None if version == "2.0" else "true")


@pytest.mark.parametrize(
    ("name", "law"),
    [
        ("corner_rest_fails", "newton"),
        ("free_body_fails_newton", "newton"),
        ("closed_but_separating", "poisson"),
        ("funnel_poisson_fails", "poisson"),
    ],
)
def test_impacts_at_the_start_are_those_of_simulate(name: str, law: str, tmp_path: Path) -> None:
    """Also where there are hundreds of them."""
    text = (Path(__file__).parents[2] / "found" / f"{name}.yaml").read_text()
    model = lagcli.load_text(f"{text}\nsimulation: {{t_end: 3, samples: 7, impacts: {law}}}\n")
    run = lagcli.simulate(model)
    fmu, names = unpacked(model, tmp_path, "3.0"), state_names(model)
    found = with_events(fmu, names, [0.0, 3.0])
    size = np.abs(run.v).max() + 1e-9
    assert found.values == pytest.approx(np.concatenate([run.q[-1], run.v[-1]]), abs=1e-7 * size)
