"""Contacts and events in pictures: marks, jumps, and the table of a report."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from trajectories import make_log

import lagcli
from lagcli.cli.app import run as cli
from lagcli.model.result_units import result_display
from lagcli.pictures.curves import Catalogue
from lagcli.pictures.jumps import Jumps, marks
from lagcli.pictures.plots.run_plot import draw_marks
from lagcli.pictures.run_file import RunFile

MODEL = Path(__file__).parents[2] / "models" / "slider_crank.yaml"


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file of a run with a made-up log."""
    run = lagcli.simulate(lagcli.load(MODEL), samples=21, t_end=0.5)
    log = make_log(run.coordinates, run.constraints)
    path = tmp_path_factory.mktemp("events") / "run.h5"
    lagcli.write(dataclasses.replace(run, events=log), path)
    return path


def of_log(entries: tuple[tuple[float, str, str], ...], **changes: Any) -> Any:
    log = dataclasses.replace(make_log(entries=entries), **changes)
    return SimpleNamespace(
        record=SimpleNamespace(events=log, display={}),
        coordinates=("phi", "psi"),
        constraints=("guide", "floor", "floor.slip"),
    )


def with_jumps(run: Any, name: str, time: Any, values: Any) -> Any:
    return Jumps(run).drawn(name, time, values)


TIME = np.array([0.0, 0.1, 0.2, 0.3])
IMPACTS = ((0.15, "floor", "impact"), (0.2, "floor", "impact"))


def test_velocities_jump_by_what_the_log_says() -> None:
    run = of_log(
        IMPACTS,
        before=np.array([[-1.0, 0.0], [-0.5, 0.0]]),
        after=np.array([[0.8, 0.0], [0.4, 0.0]]),
    )
    time, v = with_jumps(run, "phi_dot", TIME, np.array([-0.9, -0.95, 0.4, 0.3]))
    assert time.tolist() == [0.0, 0.1, 0.15, 0.15, 0.2, 0.2, 0.2, 0.3]
    assert v.tolist() == [-0.9, -0.95, -1.0, 0.8, -0.5, 0.4, 0.4, 0.3]


def test_coordinates_pass_through_their_value_at_the_instant() -> None:
    run = of_log(IMPACTS[:1], q=np.array([[7.0, 0.0]]))
    time, q = with_jumps(run, "phi", TIME, np.array([3.0, 5.0, 5.0, 3.0]))
    assert time.tolist() == [0.0, 0.1, 0.15, 0.15, 0.2, 0.3]
    assert q.tolist() == [3.0, 5.0, 7.0, 7.0, 5.0, 3.0]


def test_forces_hold_their_values_beside_the_instant() -> None:
    run = of_log(((0.12, "floor", "impact"), (0.15, "floor", "opens")))
    force = np.array([2.0, 3.0, 0.0, 0.0])
    time, drawn = with_jumps(run, "lambda.floor", TIME, force)
    assert time.tolist() == [0.0, 0.1, 0.12, 0.12, 0.15, 0.15, 0.2, 0.3]
    assert drawn.tolist() == [2.0, 3.0, 3.0, 3.0, 3.0, 0.0, 0.0, 0.0]


def test_forces_continue_to_the_instant_as_they_do_before() -> None:
    run = of_log(((0.35, "floor", "opens"),))
    time = np.linspace(0.0, 0.8, 9)
    force = np.where(time < 0.35, 9 - 10 * time, 2 * time)
    at, drawn = with_jumps(run, "lambda.floor", time, force)
    assert drawn[at == 0.35] == pytest.approx([5.5, 0.7])
    # a curve that turns, and one of a single sample, are held
    force[:4] = [0.0, 1.0, 4.0, 4.1]
    _, drawn = with_jumps(run, "lambda.floor", time, force)
    assert drawn[at == 0.35] == pytest.approx([4.1, 0.7])
    run = of_log(((0.25, "floor", "closes"), (0.35, "floor", "opens")))
    at, drawn = with_jumps(run, "lambda.floor", time, np.where(time < 0.35, 9 - 10 * time, 0))
    assert drawn[at == 0.35] == pytest.approx([6, 0])
    run = of_log(((0.15, "floor", "closes"), (0.35, "floor", "opens")))
    at, drawn = with_jumps(run, "lambda.floor", time, np.where(time < 0.35, 9 - 10 * time, 0))
    assert drawn[at == 0.35] == pytest.approx([5.5, 0])


def test_the_force_on_a_sphere_is_zero_where_the_particle_leaves_it() -> None:
    """λ = m g (3 cos θ − 2) reaches 0 where the contact opens, between two samples."""
    source = lagcli.simulate(lagcli.load("particle_on_sphere"))
    jumps = Jumps(RunFile(source))
    time, force = jumps.drawn("lambda.surface", source.time, source.multipliers[:, 0])
    sides = force[:-1][np.diff(time) == 0], force[1:][np.diff(time) == 0]
    assert sides[0] == pytest.approx([0], abs=4e-3)
    assert sides[1].tolist() == [0]


def test_recorded_limits_are_drawn() -> None:
    """The clutch engages at rest of the difference; both limits of λ are in the log."""
    source = lagcli.simulate(lagcli.load("clutch"), samples=8)
    run, log = RunFile(source), source.events
    assert log is not None
    time, force = Jumps(run).drawn("lambda.clutch", source.time, source.multipliers[:, 0])
    before, after = log.recorded("lambda.clutch")
    for entry in log.records.entry:
        both = force[time == log.time[entry]]
        assert both[:2].tolist() == [before[entry], after[entry]]


def test_outputs_of_forces_jump_and_those_of_the_configuration_do_not() -> None:
    model = lagcli.load_text("""
coordinates: {x: m}
parameters: {m: 1 kg, k: 4 N/m, a: 1 m/s}
T: m/2*x'^2
V: k/2*x^2
constraints: {floor: x >= 0}
events: {stiffer: {when: t >= 0.3, set: {k: 2*k}}}
outputs: {place: x + a*t, load: lambda.floor, speed: x', spring: k*x, pull: m*x''}
initial: {x: 1, x': 0}
""")
    assert result_display(model)["jumping"] == ["load", "speed", "spring", "pull"]
    source = lagcli.simulate(model, t_end=0.5, samples=11)
    run = RunFile(source)
    time, spring = Jumps(run).drawn("spring", source.time, source.outputs["spring"])
    assert np.ptp(spring[time == time[np.flatnonzero(np.diff(time) == 0)[0]]]) > 3
    time, _ = Jumps(run).drawn("place", source.time, source.outputs["place"])
    assert len(time) == 11


def test_other_curves_stay() -> None:
    values = np.arange(4.0)
    assert with_jumps(of_log(IMPACTS), "an_output", TIME, values) == (TIME, values)


def test_energies_jump_by_what_impacts_take() -> None:
    """A ball keeps m g h e^(2n) between its impacts, and T is that at each, V is 0."""
    run = RunFile(lagcli.simulate(lagcli.load("bouncing_ball"), t_end=2, samples=400))
    source = lagcli.simulate(lagcli.load("bouncing_ball"), t_end=2, samples=400)
    time, total = with_jumps(run, "energy_total", source.time, source.energy_total)
    assert source.events is not None
    bounces = np.searchsorted(source.events.time, time, side="right")
    before = np.append(np.diff(time) == 0, False)  # the first of the two values at an instant
    np.testing.assert_allclose(total, 19.62 * 0.64 ** (bounces - before), rtol=1e-9)
    _, kinetic = with_jumps(run, "energy_kinetic", source.time, source.energy_kinetic)
    after = np.append(False, np.diff(time) == 0)
    # T is straight between samples, which are 5 ms apart: m g v dt
    np.testing.assert_allclose(kinetic[before], 19.62 * 0.64 ** np.arange(before.sum()), atol=0.3)
    drop = 0.36 * 19.62 * 0.64 ** np.arange(before.sum())
    np.testing.assert_allclose(kinetic[before] - kinetic[after], drop, rtol=1e-9)
    _, potential = with_jumps(run, "energy_potential", source.time, source.energy_potential)
    assert np.array_equal(potential[before], potential[after])


def test_work_of_an_event_changes_the_energy_that_it_moves() -> None:
    """Two springs instead of one: V jumps. A stop: T does."""
    model = lagcli.load_text("""
coordinates: {x: m}
parameters: {m: 1 kg, k: 4 N/m}
T: m/2*x'^2
V: k/2*x^2
events:
  stiffer: {when: t >= 0.3, set: {k: 2*k}}
  halt: {when: t >= 0.6, set: {x': 0}}
initial: {x: 1, x': 0}
simulation: {t_end: 1, samples: 1001}
""")
    made = lagcli.simulate(model)
    run = RunFile(made)
    jumps = {}
    for name in ("energy_kinetic", "energy_potential"):
        time, values = with_jumps(run, name, made.time, getattr(made, name))
        both = np.flatnonzero(np.diff(time) == 0)
        jumps[name] = [
            sum(values[i + 1] - values[i] for i in both if time[i] == pytest.approx(t))
            for t in (0.3, 0.6)
        ]
    log = made.events
    assert log is not None
    assert jumps["energy_potential"] == pytest.approx([log.work[0], 0], abs=1e-12)
    assert jumps["energy_kinetic"] == pytest.approx([0, log.work[1]], abs=1e-12)
    assert log.work[0] == pytest.approx(2 * np.cos(0.6) ** 2)


def test_pages_insert_each_instant_once_for_all_curves() -> None:
    run = of_log(IMPACTS, q=np.array([[7.0, 0.0], [8.0, 0.0]]))
    jumps = Jumps(run)
    time, values = jumps.inserted(
        TIME, ["phi", "an_output"], np.column_stack([np.arange(4.0), 10 * TIME])
    )
    assert time.tolist() == [0.0, 0.1, 0.15, 0.15, 0.2, 0.2, 0.2, 0.3]
    assert values[:, 0].tolist() == [0, 1, 7, 7, 8, 8, 2, 3]
    np.testing.assert_allclose(values[:, 1], 10 * time)
    assert marks(run.record.events).tolist() == [0.15, 0.2]
    assert not len(marks(None))


def test_a_report_in_blocks_has_the_jumps_of_one_in_one_piece(
    result: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from lagcli.pictures.report.run_plots import Plot, gather

    def gathered() -> Plot:
        run = RunFile(result)
        catalogue = Catalogue(run)
        plot = Plot("", "", [catalogue.of("v")[0], *catalogue.of("energy_total")])
        gather(run, [plot], {})
        return plot

    whole = gathered()
    monkeypatch.setattr("lagcli.results.hdf5.trajectories._SLAB", 1)
    pieces = gathered()
    assert np.array_equal(whole.time, pieces.time)
    assert len(whole.time) > 21
    np.testing.assert_allclose(whole.values[:, 0], pieces.values[:, 0], rtol=1e-12)


def test_marks_are_as_many_as_can_be_told_apart() -> None:
    figure = pytest.importorskip("matplotlib.figure").Figure()
    few, many, none = figure.subplots(3)
    draw_marks(few, of_log(IMPACTS), (0.0, 0.3), 600)
    assert [x for ((x, _), _) in few.collections[0].get_segments()] == [0.15, 0.2]
    entries = tuple((t, "floor", "impact") for t in np.linspace(0.0, 1.0, 5000))
    draw_marks(many, of_log(entries), (0.0, 1.0), 600)
    assert 150 <= len(many.collections[0].get_segments()) <= 201
    draw_marks(none, of_log(IMPACTS), (0.5, 0.6), 600)
    assert not none.collections


@pytest.mark.parametrize("suffix", ["svg", "png"])
def test_plot(result: Path, tmp_path: Path, suffix: str) -> None:
    target = tmp_path / f"run.{suffix}"
    assert cli(["plot", str(result), "-o", str(target)]) == 0
    assert target.stat().st_size > 5000


def test_report(result: Path, tmp_path: Path) -> None:
    page = tmp_path / "run.html"
    assert cli(["report", str(result), "-o", str(page), "--quiet"]) == 0
    text = page.read_text(encoding="utf-8")
    assert '<a href="#events">Contacts and events</a>' in text
    assert "note: <code>floor</code> came to rest at t = 0.25 s after 2 impacts." in text
    assert text.count("<td >impact</td>") == 3
    assert 'data-time="0.25"' in text


def test_reports_of_other_runs_have_no_such_section(result: Path, tmp_path: Path) -> None:
    plain = tmp_path / "plain.h5"
    lagcli.write(dataclasses.replace(lagcli.read(result), events=None), plain)
    page = tmp_path / "plain.html"
    assert cli(["report", str(plain), "-o", str(page), "--quiet"]) == 0
    assert "Contacts and events" not in page.read_text(encoding="utf-8")
