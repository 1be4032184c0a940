"""FMUs of many random models with events and contacts reach the states that runs reach."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
from fmi import Unpacked
from fmu_events import with_events
from fmu_states import restored_differently
from known_event_cases import EVENT_CASES
from known_events import Case
from known_force_cases import FORCE_CASES
from known_rest_cases import REST_CASES
from random_cases import FUZZ_COUNT
from stepped_inputs import STEPPED, as_parameter, difference

import lagcli

CASES = {**EVENT_CASES, **FORCE_CASES, **REST_CASES}


def simulated(case: Case) -> tuple[lagcli.Model, lagcli.Trajectory]:
    """Return the model of a case, with the settings of the case, and its run."""
    listed = ", ".join(f"{key}: {value}" for key, value in case.options.items())
    model = lagcli.load_text(f"{case.text}\nsimulation: {{{listed}}}\n")
    return model, lagcli.simulate(model)


@pytest.mark.fuzz
@pytest.mark.parametrize("kind", CASES)
def test_random_communication_points(kind: str, tmp_path: Path) -> None:
    for seed in range(FUZZ_COUNT // len(CASES) + 1):
        case = CASES[kind](seed)
        model, run = simulated(case)
        if run.status != "completed":
            continue
        instance = Unpacked(lagcli.fmu(model, icon=False), tmp_path / str(seed)).instance()
        rng, start, end = random.Random(seed), run.time[0], run.time[-1]
        count, power = rng.choice([1, 5, 60]), rng.choice([1, 3])
        points = sorted(start + (end - start) * rng.random() ** power for _ in range(count))
        names = [f"{q}{rate}" for rate in ("", "_dot") for q in model.coordinate_names]
        try:
            values = instance.simulate([start, *points, end], names)[-1]
        finally:
            instance.free()
        expected = np.concatenate([run.q[-1], run.v[-1]])
        size = np.concatenate([np.abs(run.q).max(axis=0), np.abs(run.v).max(axis=0)])
        assert (np.abs(values - expected) <= 3e-5 * np.maximum(size, 1e-4)).all(), case


@pytest.mark.fuzz
@pytest.mark.parametrize("kind", CASES)
def test_random_restored_states(kind: str, tmp_path: Path) -> None:
    for seed in range(FUZZ_COUNT // (4 * len(CASES)) + 1):
        case = CASES[kind](seed)
        model, run = simulated(case)
        if run.status != "completed":
            continue
        fmu = Unpacked(lagcli.fmu(model, icon=False), tmp_path / str(seed))
        times = np.linspace(run.time[0], run.time[-1], 41).tolist()
        assert restored_differently(fmu, times, 30, seed) == 0, case


@pytest.mark.fuzz
@pytest.mark.parametrize("kind", CASES)
def test_random_events_of_a_master(kind: str, tmp_path: Path) -> None:
    """Each event of the log is one of event mode, and the last state is that of the run.

    Event mode also reports where a force has a kink, which no log has.
    """
    for seed in range(FUZZ_COUNT // (2 * len(CASES)) + 1):
        case = CASES[kind](seed)
        model, run = simulated(case)
        if run.status != "completed":
            continue
        fmu = Unpacked(lagcli.fmu(model, version="3.0", icon=False), tmp_path / str(seed))
        random_ = random.Random(seed)
        start, end = float(run.time[0]), float(run.time[-1])
        count = random_.choice([0, 1, 20])
        points = sorted(start + (end - start) * random_.random() for _ in range(count))
        names = [f"{q}{rate}" for rate in ("", "_dot") for q in model.coordinate_names]
        found = with_events(fmu, names, [start, *points, end])
        times = np.array([instant.time for instant in found.instants])
        log = run.events
        for i, kind_ in enumerate(log.kinds if log is not None else ()):
            if kind_ not in ("rest", "redundant", "not unique") and start < log.time[i] < end:
                assert np.abs(times - log.time[i]).min(initial=np.inf) <= 1e-5 * (end - start), case
        expected = np.concatenate([run.q[-1], run.v[-1]])
        size = np.concatenate([np.abs(run.q).max(axis=0), np.abs(run.v).max(axis=0)])
        assert (np.abs(found.values - expected) <= 3e-5 * np.maximum(size, 1e-4)).all(), case


@pytest.mark.fuzz
@pytest.mark.parametrize("kind", STEPPED)
def test_random_steps_of_an_input(kind: str, tmp_path: Path) -> None:
    model = lagcli.load_text(as_parameter(kind))
    fmu = Unpacked(lagcli.fmu(model, inputs=["F"], icon=False), tmp_path)
    for seed in range(FUZZ_COUNT // len(STEPPED) + 1):
        assert difference(fmu, kind, seed) < 1e-6, seed
