"""Files of analyses contain the tables of inputs: other or missing CSV files do not change them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.analysis.fit.file import read_fit
from lagcli.analysis.output.files import stored_model
from lagcli.cli.app import run

MODEL = """
coordinates: [x]
parameters: {m: 1, k: 20, c: 0.5}
inputs:
  u: {file: road.csv, time: t, column: h, interpolation: cubic}
T: m/2*x'^2
V: k/2*(x - u)^2
Q: {x: -c*x'}
initial: {x: 0.1, x': 0}
simulation: {t_end: 4, samples: 41}
view: {points: {P: "[x, u]", O: "[0, u]"}, rods: {r: O-P}}
fit:
  data: {file: data.csv, time: t}
  observe: {x: {column: x, sigma: 1e-3}}
  parameters: {k: {min: 5, max: 60}}
"""
TABLE = "t,h\n0,0\n1,0.2\n2,-0.1\n3,0.3\n4,0\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the working directory, with the model and its table."""
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(MODEL)
    Path("road.csv").write_text(TABLE)
    return tmp_path


@pytest.mark.parametrize("later", ["missing", "another"])
def test_tables_are_those_of_the_analysis(folder: Path, later: str) -> None:
    assert run(["modes", "m.yaml", "-o", "modes.h5", "-q"]) == 0
    assert run(["simulate", "m.yaml", "-o", "data.csv", "-q"]) == 0
    assert run(["fit", "m.yaml", "--set", "k=15", "-o", "fit.h5", "-q"]) == 0
    lagcli.report("modes.h5", "before.html")
    lagcli.report("fit.h5", "fitted.html")
    if later == "missing":
        Path("road.csv").unlink()
    else:
        Path("road.csv").write_text(TABLE.replace("0.2", "5"))
    known = stored_model("modes.h5").data["u"]
    np.testing.assert_array_equal(known.values, [0.0, 0.2, -0.1, 0.3, 0.0])
    np.testing.assert_array_equal(read_fit("fit.h5").inputs["u"].values, known.values)
    lagcli.report("modes.h5", "after.html")
    lagcli.report("fit.h5", "fitted_again.html")
    for one, other in (("before.html", "after.html"), ("fitted.html", "fitted_again.html")):
        assert Path(one).read_text() == Path(other).read_text()
