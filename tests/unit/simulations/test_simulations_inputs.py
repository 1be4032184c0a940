"""Tables of inputs in records of runs, and back."""

from __future__ import annotations

from pathlib import Path

import pytest

import lagcli
from lagcli.errors import ModelError
from lagcli.simulations.inputs import check_input_range, input_data, input_tables

MODEL = """
coordinates: [x]
inputs:
  u: {times: [1, 2, 3], values: [0, 100, 0], unit: cm}
  w: {file: road.csv, time: t, column: height}
T: x'^2/2
Q: {x: u + w}
initial: {x: 0, x': 0}
"""


def test_tables_come_back_as_they_were(tmp_path: Path) -> None:
    (tmp_path / "road.csv").write_text("t,height [mm]\n0,1\n4,2\n")
    model = lagcli.load_text(MODEL, str(tmp_path / "model.yaml"))
    tables = input_tables(model)
    assert tables["u"].values.tolist() == [0, 1, 0]  # SI
    assert (tables["u"].unit, tables["u"].file) == ("cm", "")
    assert tables["w"].file == "road.csv"
    again = input_data(tables)
    for name, before in model.data.items():
        after = again[name]
        assert list(after.times) == list(before.times)
        assert list(after.values) == list(before.values)
        assert (after.unit, after.file, after.sha256) == (before.unit, before.file, before.sha256)
    # by these the model needs its file no more
    (tmp_path / "road.csv").unlink()
    loaded = lagcli.model.loader.load_text(MODEL, str(tmp_path / "model.yaml"), data=again)
    assert list(loaded.data["w"].values) == [0.001, 0.002]


SHORT_TABLE = """
coordinates: [x]
inputs:
  u: {{times: [1, 2, 3], values: [0, 1, 0]{extend}}}
T: x'^2/2
Q: {{x: u}}
initial: {{x: 0, x': 0}}
"""


def model(extend: str = ""):
    return lagcli.load_text(SHORT_TABLE.format(extend=extend))


def test_runs_within_the_table() -> None:
    check_input_range(model(), 1.0, 3.0)
    check_input_range(model(), 1.0 - 1e-13, 3.0 + 1e-13)  # rounding


@pytest.mark.parametrize(
    ("start", "end", "message", "remedy"),
    [
        (0.0, 3.0, "begins at t = 1 s, after the start of the run, t = 0 s", "--t-start 1"),
        (1.0, 4.0, "ends at t = 3 s, before the end of the run, t = 4 s", "--t-end 3"),
    ],
)
def test_runs_beyond_the_table(start: float, end: float, message: str, remedy: str) -> None:
    with pytest.raises(ModelError) as error:
        check_input_range(model(), start, end)
    (found,) = error.value.diagnostics
    assert message in found.message
    assert remedy in found.help
    assert found.location.line == 4


def test_tables_that_are_extended_have_no_end() -> None:
    check_input_range(model(", extend: hold"), 0.0, 9.0)
    check_input_range(model(", extend: periodic"), 0.0, 9.0)
