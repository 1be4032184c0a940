"""Measures of the logs of rows: counts, first times, impulses."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.engine.contract import Outcome
from lagcli.engine.event_entries import EventEntry
from lagcli.errors import NumericalError
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.variants import Variants
from lagcli.sweeps.columns import measure_columns
from lagcli.sweeps.rows.group import FinishedRuns, RowGroup
from tests.support.event_logs import log_of

MODEL = """\
name: ball
coordinates: {x: m, y: m}
parameters: {m: 2 kg, g: 9.81 m/s^2}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints:
  wall: x = 0
  floor: {expr: y >= 0, restitution: 0.8}
events:
  late: {when: t >= 1, set: {y': 0}}
initial: {x: 0, y: 1, x': 0, y': 0}
"""
MEASURES = (
    *("count(floor impacts)", "time_of(floor impacts)", "time_of(floor opens)", "impulse.floor"),
    *("impulse.wall", "count(late)", "impulse.floor/m + max(y)"),
)


def entry(time: float, occurrence: str, which: int, impulse: tuple[float, float]) -> EventEntry:
    v = np.zeros(2)
    return EventEntry(
        time, occurrence, which, v, v, v, np.array(impulse), 0.0, 0.0, 0.0, np.array([0])
    )


def test_measures_of_logs() -> None:
    settings = SettingsOverrides(t_end=1.0, samples=3)
    variants = Variants(lagcli.load_text(MODEL), settings)
    group = RowGroup(variants, [], [(x, x) for x in MEASURES], kept=False)
    events = [
        entry(0.2, "impact", 1, (0.5, 3.0)),
        entry(0.2, "closes", 1, (0.5, 3.0)),  # of the same impact
        entry(0.6, "impact", 1, (-0.25, 2.0)),
        entry(0.9, "event", 0, (0.0, 0.0)),
    ]
    runs = [
        Outcome("completed", events=log_of(variants.system, events), modes=(0,)),
        NumericalError("no start"),
    ]
    width = variants.system.sample_layout.size
    samples = np.zeros((2, 3, width))
    samples[:, :, 2] = [1.0, 7.0, 3.0]  # t, x, y
    p = np.array([[2.0, 9.81]] * 2)
    ended = FinishedRuns(np.arange(2), samples, runs, p, [])
    measures = group.measured(ended).measures
    assert measures[0] == pytest.approx([2, 0.2, math.nan, 5.0, 0.25, 1, 5 / 2 + 7], nan_ok=True)
    assert np.isnan(measures[1]).all()


def test_models_that_switch_are_run_one_by_one() -> None:
    variants = Variants(lagcli.load_text(MODEL), SettingsOverrides(t_end=1.0, samples=3))
    group = RowGroup(variants, [], [], kept=False)
    assert group._common(lambda: None) is None


def test_units_of_measures() -> None:
    columns = measure_columns(lagcli.load_text(MODEL), tuple((x, x) for x in MEASURES))
    assert [c.unit for c in columns[:6]] == ["1", "s", "s", "N*s", "N*s", "1"]
    assert [c.name for c in columns] == list(MEASURES)


def test_a_run_that_an_event_stops_is_measured_as_far_as_it_went(tmp_path: Path) -> None:
    """It falls from 1 m to the ground in sqrt(2/g) = 0.4515 s; the last sample is at 0.4 s."""
    text = MODEL.replace("late: {when: t >= 1, set: {y': 0}}", "ground: {when: y <= 0, stop: true}")
    model = tmp_path / "ball.yaml"
    model.write_text(text.replace("  floor: {expr: y >= 0, restitution: 0.8}\n", ""))
    measures = ("final(y)", "max(t)", "mean(t)", "at(y, 0.25)", "at(y, 0.5)", "count(ground)")
    named = {f"m{i}": x for i, x in enumerate(measures)}
    made = tmp_path / "sweep.h5"
    lagcli.sweep(model, ["g=9.81,4 m/s^2"], made, measures=named, jobs=1, t_end=1, samples=11)
    data = lagcli.open(made)
    found = np.array([data[name].values for name in named]).T
    fallen = [1 - 9.81 / 2 * 0.25**2, np.nan, 1]
    np.testing.assert_allclose(found[0], [1 - 9.81 / 2 * 0.16, 0.4, 0.2, *fallen], rtol=1e-8)
    # sqrt(2/4) = 0.7071 s
    fallen = [1 - 2 * 0.25**2, 1 - 2 * 0.25, 1]
    np.testing.assert_allclose(found[1], [1 - 2 * 0.49, 0.7, 0.35, *fallen], rtol=1e-8)
