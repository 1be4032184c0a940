"""Tables of inputs in records of runs, and back."""

from __future__ import annotations

from pathlib import Path

import lagcli
from lagcli.simulations.inputs.input_tables import input_data, input_tables

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
