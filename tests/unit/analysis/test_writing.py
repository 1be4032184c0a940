"""`lagcli.write` writes what -o of the commands writes, and functions say what they expect."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_cases import some

import lagcli
from lagcli.cli.app import run
from lagcli.errors import FileError, UsageError
from lagcli.model.model import Model
from lagcli.settings.settings import SettingsOverrides

#: Analyses of a model, and the arguments of their commands.
ANALYSES: dict[str, tuple[Callable[[Model], Any], list[str]]] = {
    "linear": (
        lambda m: lagcli.linearize(m, equilibrium=True, outputs=["x"]),
        ["linearize", "--equilibrium", "--output", "x"],
    ),
    "modes": (lambda m: lagcli.modes(m, equilibrium=True), ["modes", "--equilibrium"]),
    "equilibrium": (
        lambda m: lagcli.equilibrium(m, all=True, starts=8),
        ["equilibrium", "--all", "--starts", "8"],
    ),
    "branches": (
        lambda m: lagcli.follow_equilibria(m, "l", 1.0, 2.0),
        ["equilibrium", "--along", "l=1:2"],
    ),
    "two": (lambda m: lagcli.compare_models(m, m, SHORT), ["compare"]),
}
SHORT = SettingsOverrides(t_end=0.1, samples=3)
NAME = "pendulum_cartesian"


def by_command(name: str, path: str) -> None:
    command, *options = ANALYSES[name][1]
    target = "-o" if command in ("linearize", "compare") else "--output"
    if command == "compare":
        options += [str(Path(__file__).parents[3] / "models" / f"{NAME}.yaml"), "--samples", "3"]
        options += ["--t-end", "0.1"]
    assert run([command, NAME, *options, target, path, "--quiet"]) == 0


@pytest.mark.parametrize("name", some(ANALYSES, 3))
def test_an_analysis_is_written_as_its_command_writes_it(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = ANALYSES[name][0](lagcli.load(NAME))
    for suffix in (".json", ".h5"):
        by_command(name, f"command{suffix}")
        lagcli.write(result, f"written{suffix}")
        with pytest.raises(FileError, match="exists"):
            lagcli.write(result, f"written{suffix}")
        lagcli.write(result, f"written{suffix}", force=True)
    written, expected = (Path(f"{x}.json").read_text("utf-8") for x in ("written", "command"))
    assert written == expected
    assert lagcli.open("written.h5") == lagcli.open("command.h5") == json.loads(written)
    lagcli.report("written.h5", "report.html")
    if name not in ("linear", "equilibrium"):
        lagcli.plot("written.h5", "plot.png")


def test_matrices_and_a_comparison_of_formulations_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    model = lagcli.load(NAME)
    linear = lagcli.linearize(model, equilibrium=True)
    lagcli.write(linear, "linear.npz")
    np.testing.assert_array_equal(np.load("linear.npz")["A"], linear.A)
    lagcli.write(linear, "linear.mat")
    lagcli.write(lagcli.compare(model, SHORT, methods=["DOP853"]), "compared.h5")
    assert lagcli.open("compared.h5")["model"] == NAME
    lagcli.write(lagcli.simulate(model, t_end=0.1, samples=3), "run.csv", meta=True)
    assert lagcli.read("run.csv").model == model.text
    with pytest.raises(UsageError, match="sidecar"):
        lagcli.write(linear, "linear.json", meta=True, force=True)


def test_what_is_no_result_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    model = lagcli.load(NAME)
    summary = lagcli.sweep(model, ["m=1,2"], "sweep.h5", t_end=0.1, samples=3, jobs=1)
    with pytest.raises(UsageError, match=r"in its own file, sweep\.h5"):
        lagcli.write(summary, "written.h5")  # type: ignore[arg-type]
    for other in (model, lagcli.derive(model), lagcli.check(model), None, "run.h5"):
        with pytest.raises(UsageError, match=f"of type {type(other).__name__}; it writes runs"):
            lagcli.write(other, "written.h5")  # type: ignore[arg-type]
    for result in (ANALYSES["modes"][0](model), ANALYSES["branches"][0](model)):
        with pytest.raises(UsageError, match=r"the suffix \.csv is not a format for this"):
            lagcli.write(result, "written.csv")
    assert [x.name for x in tmp_path.iterdir()] == ["sweep.h5"]


OF_MODELS = {
    **dict.fromkeys(("simulate", "derive", "check", "linearize", "modes", "equilibrium")),
    **dict.fromkeys(("compare", "fit", "dynamics", "fmu", "live_page")),
    "follow_equilibria": ("m", 1.0, 2.0),
    "compare_models": (None,),
    "code": ("c",),
}


@pytest.mark.parametrize("function", OF_MODELS)
def test_functions_of_a_model_say_so(function: str) -> None:
    for other in ("slider_crank.yaml", None):
        message = f"lagcli.{function}: the argument is of type {type(other).__name__}, not Model;"
        with pytest.raises(UsageError, match=message):
            getattr(lagcli, function)(other, *(OF_MODELS[function] or ()))


@pytest.mark.parametrize("function", ["render", "degrees_of_freedom", "partition"])
def test_functions_of_equations_say_so(function: str) -> None:
    with pytest.raises(UsageError, match=r"of type Model, not Equations; lagcli\.derive"):
        getattr(lagcli, function)(lagcli.load(NAME))


@pytest.mark.parametrize("function", ["plot", "report", "animate"])
def test_pictures_of_what_is_no_run_say_how_to_get_one(function: str) -> None:
    for other in (ANALYSES["modes"][0](lagcli.load(NAME)), None):
        with pytest.raises(UsageError, match=f"{type(other).__name__}, neither a run nor the name"):
            getattr(lagcli, function)(other, "picture.png")
