"""States of FMUs that are saved, serialized and restored, in this instance and in others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmi import FmuError, Unpacked
from fmu_states import restored_differently
from random_cases import some
from shipped import PATHS, every_model
from test_fmu import PENDULUM, unpacked

import lagcli

#: Words of the header: what they are, the number of words, the FMU, a checksum.
HEADER = 4


def times_of(model: lagcli.Model, count: int) -> list[float]:
    run = lagcli.simulate(model)
    return np.linspace(run.time[0], run.time[-1], count + 1).tolist()


@pytest.mark.parametrize("name", every_model())
def test_restored_runs_are_those_without_interruption(name: str, tmp_path: Path) -> None:
    """To the last bit: contacts, friction, events, clocks and tables go on as they were."""
    model = lagcli.load(str(PATHS[name]))
    fmu = unpacked(model, tmp_path, "3.0" if len(name) % 2 else "2.0")
    assert restored_differently(fmu, times_of(model, 40), 100, seed=1) == 0


@pytest.mark.parametrize("method", ["Radau", "Rodas5P", "Taylor"])
def test_methods_go_on_as_they_were(method: str, tmp_path: Path) -> None:
    """Implicit methods keep their Jacobians and the orders of their pivots."""
    model = lagcli.load_text(PENDULUM.replace("t_end: 2 s", f"t_end: 2 s, method: {method}"))
    fmu = unpacked(model, tmp_path)
    assert restored_differently(fmu, times_of(model, 40), 30, seed=2) == 0


SPRING_WITH_PLAY = """
coordinates: [x]
T: x'^2/2
Q: {x: "-558*(max(x - 0.11, 0) + min(x + 0.11, 0))"}
initial: {x: 0, x': 0.82}
simulation: {method: Radau, t_end: 2.3 s, rtol: 1e-9}
"""


def test_what_rounding_errors_need_of_tolerances_is_part_of_a_state(tmp_path: Path) -> None:
    """The tolerance of Radau's error estimate is not that of the step."""
    model = lagcli.load_text(SPRING_WITH_PLAY)
    fmu = unpacked(model, tmp_path)
    assert restored_differently(fmu, times_of(model, 40), 30, seed=2) == 0


SLIDER = """
coordinates: [x, y]
T: (x'^2 + y'^2)/2
Q: {y: "sin(7*t)*(1 + 0.3*sin(x))", x: "-0.2*min(abs(lambda.guide), 0.5)*x"}
constraints: {guide: y = 0, rubs: {expr: "x' = 0", limit: 0.1*abs(lambda.guide)}}
initial: {x: 0, y: 0, x': 3, y': 0}
simulation: {t_end: 5 s}
"""


def test_signs_of_multipliers_are_part_of_a_state(tmp_path: Path) -> None:
    """Friction goes on with the sign of |λ| that the interrupted step had."""
    model = lagcli.load_text(SLIDER)
    fmu = unpacked(model, tmp_path)
    assert restored_differently(fmu, times_of(model, 40), 60, seed=3) == 0


BALL = """
coordinates: {x: m, y: m}
parameters: {m: 1 kg, g: 9.81 m/s^2, F: 0 N, u: 0.3 N, k: 0 N/m}
T: m/2*(x'^2 + y'^2)
V: m*g*y
Q: {x: F + u - k*x}
constraints: {floor: {expr: y >= 0, friction: 0.4, slip: x', restitution: 0.6}}
events: {sample: {every: 0.1 s, set: {u: -0.9*u}}, band: {when: x >= 0.5, set: {k: k + 2}}}
initial: {x: 0, y: 1, x': 1, y': 0}
simulation: {t_end: 3 s}
"""


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_inputs_are_part_of_a_state(version: str, tmp_path: Path) -> None:
    """Also one that was set, and acts only from the next step on."""
    fmu = unpacked(lagcli.load_text(BALL), tmp_path, version, inputs=["F"])
    one, other = fmu.instance(), fmu.instance()
    one.begin(0.0, {"F": 2.0})
    one.step(0.0, 1.0)
    one.set({"F": -3.0})
    state = one.save()
    other.restore_from(one.serialize(state))
    one.forget(state)
    for instance in (one, other):
        instance.step(1.0, 1.5)
    assert one.get(*fmu.variables) == other.get(*fmu.variables)
    assert one.get("F") == [-3.0]
    one.free()
    other.free()


def test_a_reset_forgets_the_time_and_what_was_set(tmp_path: Path) -> None:
    fmu = unpacked(lagcli.load_text(BALL), tmp_path, inputs=["F"])
    one, other = fmu.instance(), fmu.instance()
    one.begin(0.0, {"m": 3.0, "y": 2.0, "F": 1.0})
    one.step(0.0, 0.7)
    one.call("Reset")
    for instance in (one, other):
        instance.begin(0.0)
        instance.step(0.0, 0.5)
    assert one.get(*fmu.variables) == other.get(*fmu.variables)
    one.free()
    other.free()


@pytest.fixture
def ball(tmp_path: Path) -> Unpacked:
    return unpacked(lagcli.load_text(BALL), tmp_path, inputs=["F"])


def saved(fmu: Unpacked) -> bytes:
    instance = fmu.instance()
    instance.begin(0.0)
    instance.step(0.0, 0.75)
    state = instance.save()
    content = instance.serialize(state)
    instance.forget(state)
    instance.free()
    return content


def checked(words: Any) -> bytes:
    """Return words with the checksum that they need."""
    total = 0xCBF29CE484222325
    for byte in words[HEADER:].tobytes():
        total = (total ^ byte) * 0x100000001B3 % 2**64
    words[3] = np.uint64(total)
    return words.tobytes()


def is_refused(fmu: Unpacked, words: Any) -> bool:
    """Return whether a state of these words is damaged; otherwise a step from it ends."""
    instance, refused = fmu.instance(), False
    try:
        instance.restore_from(checked(words))
        instance.step(0.75, 0.01)
    except FmuError as error:
        refused = "damaged" in str(error)
    instance.free()
    return refused


def test_bytes_that_are_no_state_are_refused(ball: Unpacked, tmp_path: Path) -> None:
    content = saved(ball)
    instance = ball.instance()
    other = unpacked(lagcli.load("pendulum_cartesian"), tmp_path / "other")
    for wrong, message in (
        (b"", "no state"),
        (b"abc", "no state"),
        (content[:-8], "no state"),
        (content + bytes(8), "no state"),
        (content[:200] + b"\xff" * 8 + content[208:], "damaged"),
        (saved(other), "that of another FMU"),
    ):
        with pytest.raises(FmuError, match=message):
            instance.restore_from(wrong)
    instance.restore_from(content)  # none of them has spoiled the instance
    instance.step(0.75, 0.5)
    instance.free()


def test_a_simulation_that_has_ended_without_a_reason_is_refused(ball: Unpacked) -> None:
    """Its steps would return at once, and never arrive."""
    content = saved(ball)
    words = np.frombuffer(content, np.uint64)
    # after what was set: the phase of the simulation, 1, and its status, 0
    places = np.flatnonzero((words[:-1] == 1) & (words[1:] == 0))
    refused = 0
    for place in places[places > HEADER + 8]:
        changed = words.copy()
        changed[place] = 4
        refused += is_refused(ball, changed)
    assert refused > 0


def test_a_clock_that_is_late_is_refused(ball: Unpacked) -> None:
    """Steps would go back in time to its next tick."""
    content = saved(ball)
    places = np.flatnonzero(np.abs(np.frombuffer(content, float) - 0.8) < 1e-12)
    refused = 0
    for place in places[places >= HEADER]:
        for past in (-1e300, 0.1, np.nan):
            words = np.frombuffer(content, np.uint64).copy()
            words[place] = np.float64(past).view(np.uint64)
            refused += is_refused(ball, words)
    assert refused >= 3


@pytest.mark.parametrize("count", some([60, 200], 1))
def test_hostile_bytes_end_with_a_status(ball: Unpacked, count: int) -> None:
    """Any words, with a checksum: the state is refused, or simulates to some end."""
    content, rng = saved(ball), np.random.default_rng(4)
    outcomes = set()
    for _ in range(count):
        words = np.frombuffer(content, np.uint64).copy()
        for place in rng.integers(HEADER, len(words), int(rng.integers(1, 4))):
            words[place] = rng.choice(
                [
                    np.int64(rng.integers(-9, 9)).view(np.uint64),
                    np.int64(rng.integers(-(2**62), 2**62)).view(np.uint64),
                    np.float64(rng.normal() * 10.0 ** rng.integers(-9, 9)).view(np.uint64),
                    np.float64(rng.choice([np.nan, np.inf, -1e300, 5e-324])).view(np.uint64),
                ]
            )
        instance = ball.instance()
        try:
            instance.restore_from(checked(words))
            instance.get(*ball.variables)
            instance.step(0.75, 0.01)
            outcomes.add("simulates")
        except FmuError as error:
            outcomes.add("refused" if "damaged" in str(error) else "fails")
        instance.free()
    assert outcomes == {"simulates", "refused", "fails"}
