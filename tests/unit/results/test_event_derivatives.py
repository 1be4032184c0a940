"""Derivatives of the times of events in result files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.errors import FileError

BALL = """
coordinates: [y]
parameters: {g: 10, e: 0.5}
T: y'^2/2
V: g*y
constraints: {floor: {expr: y >= 0, restitution: e}}
events: {low: {when: y <= 0.5, record: [y']}}
initial: {y: 1, y': 0}
"""


@pytest.mark.parametrize("name", ["run.h5", "run.csv"])
def test_they_are_read_as_they_were_written(tmp_path: Path, name: str) -> None:
    run = lagcli.simulate(
        lagcli.load_text(BALL), t_end=1.0, samples=5, sensitivity=("e", "g", "y'")
    )
    lagcli.write(run, tmp_path / name)
    found = lagcli.read(tmp_path / name).events
    assert run.events is not None
    assert found is not None
    assert found.parameters == ("e", "g", "y'")
    assert found.dtime.shape == (len(run.events), 3)
    assert found.dtime.any(axis=0).all()
    np.testing.assert_array_equal(found.dtime, run.events.dtime)
    assert found.recorded("y_dot")[0][0] == run.events.recorded("y_dot")[0][0]


def test_xarray_has_them(tmp_path: Path) -> None:
    run = lagcli.simulate(lagcli.load_text(BALL), t_end=0.8, samples=5, sensitivity=("g",))
    dataset = run.to_xarray()
    assert dataset.event_dtime.dims == ("event", "parameter")
    assert run.events is not None
    np.testing.assert_array_equal(dataset.event_dtime, run.events.dtime)


def test_runs_without_derivatives_have_none(tmp_path: Path) -> None:
    run = lagcli.simulate(lagcli.load_text(BALL), t_end=0.8, samples=5)
    lagcli.write(run, tmp_path / "run.csv")
    assert "dt/d" not in (tmp_path / "run.events.csv").read_text()
    found = lagcli.read(tmp_path / "run.csv").events
    assert found is not None
    assert found.parameters == ()


def test_columns_in_another_order_are_rejected(tmp_path: Path) -> None:
    run = lagcli.simulate(lagcli.load_text(BALL), t_end=0.8, samples=5, sensitivity=("e", "g"))
    lagcli.write(run, tmp_path / "run.csv")
    table = tmp_path / "run.events.csv"
    header, *lines = table.read_text().splitlines(keepends=True)
    before = header.replace(",dt/de", "").replace(",modes", ",dt/de,modes")
    table.write_text("".join([before, *lines]))
    with pytest.raises(FileError, match="its columns are not those of this model"):
        lagcli.read(tmp_path / "run.csv")
