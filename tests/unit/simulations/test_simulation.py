"""What a prepared run says before it runs, and what its record holds after."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.errors import ModelError, NumericalError, UsageError
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare, simulate

MODEL = lagcli.load_text("""
coordinates: [x, y]
parameters: {l: 2}
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {rod: x^2 + y^2 = l^2}
initial: {x: {guess: 1.9}, y: 0, x': 0, y': 0.5}
simulation: {t_end: 0.5, samples: 6, rtol: 1e-8}
""")


def test_options_go_before_settings_and_these_before_the_model() -> None:
    run = prepare(MODEL, SettingsOverrides(t_end=0.25))
    assert (run.settings.t_end, run.settings.samples, run.settings.rtol) == (0.25, 6, 1e-8)
    found = simulate(MODEL, SettingsOverrides(t_end=0.25, samples=3), samples=5)
    assert found.time.tolist() == np.linspace(0, 0.25, 5).tolist()
    with pytest.raises(UsageError, match="no setting `tend`"):
        simulate(MODEL, tend=1)


def test_a_run_starts_consistently_and_says_what_it_moved() -> None:
    run = prepare(MODEL)
    assert run.initial == pytest.approx({"x": 2, "y": 0, "x'": 0, "y'": 0.5})
    assert run.freedom.degrees == 1
    blocks: list[lagcli.Trajectory] = []
    record = run.run(blocks.append)
    assert record.status == "completed"
    assert sum(len(b.time) for b in blocks) == 6
    before, after = record.initial_correction["x"]
    assert (before, after) == (1.9, pytest.approx(2))
    assert record.model == MODEL.text
    assert record.parameters == {"l": 2}


def test_what_the_sink_raises_ends_the_run() -> None:
    class Full(Exception):
        pass

    def sink(samples: object) -> None:
        raise Full

    with pytest.raises(Full):
        prepare(MODEL).run(sink)


def test_a_run_that_needs_more_memory_than_there_is() -> None:
    prepare(MODEL).check_memory(kept=True)
    with pytest.raises(NumericalError, match="a run of 100000000 samples"):
        prepare(MODEL, SettingsOverrides(samples=10**8)).check_memory(kept=True)


def test_derivatives_are_asked_for_by_name() -> None:
    run = prepare(MODEL, SettingsOverrides(sensitivity=("l",)))
    assert run.sensitivity is not None
    assert run.sensitivity.names == ("l",)
    # x = l at the start
    assert run.sensitivity.start.q[0].tolist() == pytest.approx([2, 0])  # with respect to l / 2
    with pytest.raises(UsageError, match="no parameter or initial value"):
        prepare(MODEL, SettingsOverrides(sensitivity=("m",)))


def test_fixed_values_that_contradict_the_constraints() -> None:
    text = MODEL.text.replace("x: {guess: 1.9}", "x: 1.9")
    with pytest.raises(ModelError):
        prepare(lagcli.load_text(text))
