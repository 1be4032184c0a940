"""`lagcli fit` and `simulate --sensitivity`: files, JSON by its schema, errors and statuses."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from documented_schemas import schema

import lagcli
from lagcli.cli.app import run

ROOT = Path(__file__).parents[2]
SLIDER_CRANK = ROOT / "models" / "slider_crank.yaml"

MODEL = """
name: spring
coordinates: {x: m}
parameters: {m: 1 kg, k: {value: 10, unit: N/m, description: the spring}, c: 0.1}
T: m*x'^2/2
V: k*x^2/2      # the energy of the spring
Q: {x: -c*x'}
initial: {x: 10 cm, x': 0}
fit:
  data: {file: run.csv}
  observe: {x: {column: ruler, sigma: 0.1}}
  parameters: {k: {min: 1}, c: {min: 0}, x: }
"""


class Done(NamedTuple):
    """What a command has said, and its exit status."""

    returncode: int
    stdout: str
    stderr: str


Command = Callable[..., Done]


@pytest.fixture
def command(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Command:
    """Run the program in the folder, in this process."""
    monkeypatch.chdir(folder)

    def call(*words: str) -> Done:
        capsys.readouterr()
        return Done(run(list(words)), *capsys.readouterr())

    return call


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fit")
    (folder / "spring.yaml").write_text(MODEL)
    truth = lagcli.load(folder / "spring.yaml", set={"k": 12, "c": 0.3})
    motion = lagcli.simulate(truth, t_end=3, samples=61)
    x = 1000 * motion.q[:, 0] + 0.1 * np.random.default_rng(4).normal(size=61)
    lines = [f"{t},{y}" for t, y in zip(motion.time.tolist(), x.tolist(), strict=True)]
    (folder / "run.csv").write_text("t,ruler [mm]\n" + "\n".join(lines) + "\n")
    return folder


def test_text_files_and_the_fitted_model(folder: Path, command: Command) -> None:
    done = command(*("fit", "spring.yaml", "-o", "fit.h5", "--write", "fitted.yaml", "--force"))
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == "spring: 3 quantities from 61 measured values in 1 file, fitted"
    assert max(map(len, lines)) <= 80
    assert any(line.startswith("  k [N/m]") for line in lines)
    fitted = lagcli.load(folder / "fitted.yaml")
    assert fitted.parameters["k"].value == pytest.approx(12, abs=0.1)
    assert fitted.initial["x"].unit == "cm"
    # everything else stands as it was
    text = (folder / "fitted.yaml").read_text()
    assert "# the energy of the spring" in text
    assert len(text.splitlines()) == len(MODEL.splitlines())

    shown = command("info", "fit.h5")
    assert shown.returncode == 0, shown.stderr
    assert shown.stdout.splitlines()[0] == lines[0]
    described = json.loads(command("info", "fit.h5", "--json").stdout)
    assert described["command"] == "fit"
    assert described["parameters"]["k"]["value"] == pytest.approx(fitted.parameters["k"].value)
    drawn = command("plot", "fit.h5", "-o", "fit.svg", "--force")
    assert drawn.returncode == 0, drawn.stderr
    assert "residual" in (folder / "fit.svg").read_text()
    again = command("fit", "spring.yaml", "-o", "fit.h5")
    assert again.returncode == 4
    assert "--force" in again.stderr


def test_json_is_as_its_schema_says(folder: Path, command: Command) -> None:
    done = command("fit", "spring.yaml", "--json", "--starts", "2", "--set", "c=0.2")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert list(found)[:2] == ["command", "model"]
    schema("fit")(found)
    assert found["parameters"]["c"]["start"] == 0.2
    assert len(found["starts"]) == 2


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (("fit", "spring.yaml", "-o", "fit.csv"), 2, "a fit is written as HDF5"),
        (("fit", "spring.yaml", "--write", "out.txt"), 2, "a model is written as YAML"),
        (("fit", "spring.yaml", "--write", "spring.yaml", "--force"), 2, "the model itself"),
        (("fit", "spring.yaml", "--starts", "0"), 2, "starts must be at least 1"),
        (("fit", str(SLIDER_CRANK)), 2, "has no `fit` block"),
        (("fit", "broken.yaml"), 4, "bad.csv:3:3: error[bad-data]"),
        (("simulate", "spring.yaml", "--sensitivity", "kk"), 2, "did you mean `k`?"),
        (("simulate", "spring.yaml", "--sensitivity", "k,k"), 2, "names `k` twice"),
        (("plot", "run.h5", "--band", "k=1", "-o", "a.svg"), 2, "simulate with --sensitivity k"),
    ],
)
def test_mistakes(
    folder: Path, command: Command, words: tuple[str, ...], status: int, said: str
) -> None:
    (folder / "broken.yaml").write_text(MODEL.replace("run.csv", "bad.csv"))
    (folder / "bad.csv").write_text("t,ruler [mm]\n0,1\n1,2O\n")
    if not (folder / "run.h5").exists():
        lagcli.write(lagcli.simulate(lagcli.load(folder / "spring.yaml")), folder / "run.h5")
    done = command(*words)
    assert done.returncode == status, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("suffix", ["h5", "csv"])
def test_derivatives_in_result_files(folder: Path, command: Command, suffix: str) -> None:
    path = folder / f"sensitivity.{suffix}"
    words = ("simulate", str(SLIDER_CRANK), "--sensitivity", "l, phi_dot", "--samples", "5")
    done = command(*words, "-o", path.name, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["sensitivity"] == ["l", "phi'"]
    found = lagcli.read(path)
    assert found.sensitivity == ("l", "phi'")
    model = lagcli.load(SLIDER_CRANK)
    expected = lagcli.simulate(model, samples=5, sensitivity=["l", "phi'"])
    for name in ("dq", "dv", "dmultipliers"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    description = json.loads(command("info", path.name, "--json").stdout)
    assert description["sensitivity"] == ["l", "phi'"]
    if suffix == "csv":
        header = path.read_text().splitlines()[0].split(",")
        assert header[-2:] == ["dlambda.guide/dl", "dlambda.guide/dphi'"]
        return
    import h5py

    with h5py.File(path) as file:
        dimensions = [next(iter(d.keys())) for d in file["dq"].dims]
        assert dimensions == ["time", "coordinate", "parameter"]
        assert file["dq"].dims[2][0][()].tolist() == [b"l", b"phi'"]


def test_the_model_file_can_require_derivatives(folder: Path, command: Command) -> None:
    text = MODEL.replace("fit:\n", "simulation: {sensitivity: [k, c], t_end: 1}\nfit:\n")
    found = lagcli.simulate(lagcli.load_text(text))
    assert found.sensitivity == ("k", "c")
    assert found.dq is not None
    assert found.dq.shape == (1001, 1, 2)
    plotted = folder / "both.h5"
    lagcli.write(found, plotted, force=True)
    drawn = command(*("plot", "both.h5", "x", "dx/dk", "--band", "k=5%", "-o", "b.svg", "--force"))
    assert drawn.returncode == 0, drawn.stderr


def test_derivatives_through_impacts(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", "bouncing_ball", "--t-end", "0.2", "--sensitivity", "h"]) == 0
    printed = capsys.readouterr()
    assert "note" not in printed.err
    assert "derivatives of q, v, λ and times of events with respect to h" in printed.out
