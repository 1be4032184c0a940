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
from lagcli.pictures.event_marks import draw_marks, with_jumps

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
        record=SimpleNamespace(events=log),
        coordinates=("phi", "psi"),
        constraints=("guide", "floor", "floor.slip"),
    )


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
    assert time.tolist() == [0.0, 0.1, 0.15, 0.15, 0.2, 0.3]
    assert drawn.tolist() == [2.0, 3.0, 3.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize("name", ["energy_potential", "an_output"])
def test_other_curves_stay(name: str) -> None:
    values = np.arange(4.0)
    assert with_jumps(of_log(IMPACTS), name, TIME, values) == (TIME, values)


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
    assert "note: `floor` came to rest at t = 0.25 s after 2 impacts." in text
    assert text.count("<td >impact</td>") == 3
    assert 'data-time="0.25"' in text


def test_reports_of_other_runs_have_no_such_section(result: Path, tmp_path: Path) -> None:
    plain = tmp_path / "plain.h5"
    lagcli.write(dataclasses.replace(lagcli.read(result), events=None), plain)
    page = tmp_path / "plain.html"
    assert cli(["report", str(plain), "-o", str(page), "--quiet"]) == 0
    assert "Contacts and events" not in page.read_text(encoding="utf-8")
