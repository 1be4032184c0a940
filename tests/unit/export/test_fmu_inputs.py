"""Inputs of FMUs in models that switch: their steps are those of a table."""

from __future__ import annotations

from pathlib import Path

import pytest
from random_cases import some
from stepped_inputs import STEPPED, as_parameter, difference
from test_fmu import PENDULUM, unpacked

import lagcli


@pytest.mark.parametrize("kind", some(STEPPED, 4))
def test_steps_of_an_input_are_those_of_a_table(kind: str, tmp_path: Path) -> None:
    """Contacts, friction, kinks and events answer at once; the tolerance is that of the runs."""
    model = lagcli.load_text(as_parameter(kind))
    fmu = unpacked(model, tmp_path, "3.0" if len(kind) % 2 else "2.0", inputs=["F"])
    found = [difference(fmu, kind, seed) for seed in range(4)]
    assert max(found) < 1e-7
    assert min(found) >= 0.0


def test_a_ramp_is_approached_by_steps(tmp_path: Path) -> None:
    """A force that rises from 0 to 30 N in 3 s: sliding begins within a step of its time."""
    kind = "sliding, sticking and leaving the floor"
    table = "times: [0, 3], values: [0, 30], unit: N, interpolation: linear"
    text = as_parameter(kind).replace(", F: 0 N", "") + f"inputs: {{F: {{{table}}}}}\n"
    expected = lagcli.simulate(lagcli.load_text(text)).q[-1, 0]
    fmu = unpacked(lagcli.load_text(as_parameter(kind)), tmp_path, inputs=["F"])
    errors = []
    for count in (30, 300):
        instance, h = fmu.instance(), 3.0 / count
        instance.begin(0.0)
        for i in range(count):
            instance.set({"F": 10.0 * (i + 0.5) * h})
            instance.step(i * h, h)
        errors.append(abs(instance.get("x")[0] - expected) / expected)
        instance.free()
    assert errors[0] < 0.03
    assert errors[1] < 0.2 * errors[0]


def test_an_input_can_end_the_simulation(tmp_path: Path) -> None:
    text = as_parameter("an event of the input")
    model = lagcli.load_text(text.replace("set: {s: -0.5*s}, times: 4", "stop: true"))
    instance = unpacked(model, tmp_path, inputs=["F"]).instance()
    instance.begin(0.0)
    assert not instance.step(0.0, 0.5)
    instance.set({"F": 20.0})
    x = instance.get("x")
    assert instance.step(0.5, 0.5)
    assert instance.get("x") == x
    instance.free()


def test_an_input_leaves_what_events_have_set(tmp_path: Path) -> None:
    """A change of F is not one of s, which an event has set."""
    model = lagcli.load_text(as_parameter("an event of the input"))
    instance = unpacked(model, tmp_path, inputs=["F"]).instance()
    instance.begin(0.0)
    instance.set({"F": 20.0})
    instance.step(0.0, 0.01)
    assert instance.get("s", "F") == [-0.5, 20.0]
    instance.set({"F": 3.0})
    assert instance.get("s", "F") == [-0.5, 3.0]
    instance.free()


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_an_input_does_not_move_the_state_of_model_exchange(version: str, tmp_path: Path) -> None:
    """Which the tool integrates, also off the constraints; the accelerations follow at once."""
    model = lagcli.load_text(PENDULUM)
    instance = unpacked(model, tmp_path, version, inputs=["F"]).instance(exchange=True)
    instance.begin(0.0)
    state = [0.26, -0.44, 0.3, 0.1]
    instance.move(0.0, state)
    instance.set({"F": 4.0})
    f = lagcli.dynamics(model)
    a, multipliers = f(0.0, state[:2], state[2:], f.values(F=4.0))
    found = instance.get("x_ddot", "y_ddot", "lambda.rod")
    assert found == pytest.approx([*a, *multipliers], rel=1e-12)
    assert instance.get("x", "y", "x_dot", "y_dot") == state
    instance.free()
