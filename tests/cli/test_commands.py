"""The program from the shell: exit statuses, streams, files, and what is said."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from here import Here
from patience import PATIENCE
from random_cases import some

from lagcli.results import read

MODELS = Path(__file__).parents[2] / "models"
CRANK = str(MODELS / "slider_crank.yaml")
PENDULUM = str(MODELS / "pendulum_cartesian.yaml")
SHORT = ("--t-end", "0.02", "--samples", "3")
#: What a shell calls status 130; elsewhere no process ends by SIGINT.
BY_INTERRUPT = -signal.SIGINT if os.name == "posix" else 130

SUMMARY_KEYS = {
    *("status", "message", "output", "t_start", "t_end", "samples", "steps", "rejected"),
    *("evaluations", "method", "formulation", "residual_position", "residual_velocity"),
    *("energy_balance", "energy_scale", "multipliers", "parameters", "initial"),
    *("initial_correction", "coordinates", "seconds", "warnings", "rtol", "atol", "tolerances"),
    *("constraints", "rank", "degrees_of_freedom", "redundant", "conserved", "sensitivity"),
    *("events", "impulses", "nonlinear", "choice", "given"),
}


def environment(**changes: str) -> dict[str, str]:
    path = os.pathsep.join(filter(None, sys.path))
    return {**os.environ, "PYTHONPATH": path, **changes}


def lagcli(*arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run the program as the shell does."""
    settings: dict[str, Any] = {
        "capture_output": True,
        "text": True,
        "timeout": PATIENCE,
        "check": False,
    }
    settings["env"] = environment(**options.pop("env", {}))
    command = [sys.executable, "-m", "lagcli", *arguments]
    return subprocess.run(command, **{**settings, **options})


@pytest.fixture
def here(capsys: pytest.CaptureFixture[str]) -> Here:
    return Here(capsys)


# success


def test_summary_without_output(here: Here) -> None:
    assert here("simulate", CRANK, *SHORT) == 0
    assert here.out.startswith("slider_crank: completed")
    for word in (
        "adjusted to satisfy",
        "residuals",
        "energy",
        "lambda.guide",
        "nothing (-o run.h5",
    ):
        assert word in here.out
    assert here.err == ""
    assert max(map(len, here.out.splitlines())) <= 100


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_output_files(here: Here, tmp_path: Path, suffix: str) -> None:
    target = tmp_path / f"run{suffix}"
    assert here("simulate", CRANK, *SHORT, "-o", str(target)) == 0
    assert str(target) in here.out
    assert list(tmp_path.iterdir()) == [target]
    trajectory = read(target)
    assert len(trajectory.time) == 3
    assert trajectory.coordinates == ("phi", "psi")


def test_standard_output_is_a_table_and_nothing_else() -> None:
    done = lagcli("simulate", CRANK, *SHORT, "-o", "-")
    assert done.returncode == 0
    header, *rows = done.stdout.splitlines()
    assert header.startswith("t,phi,psi,phi_dot,psi_dot")
    assert len(rows) == 3
    assert all(len(row.split(",")) == len(header.split(",")) for row in rows)
    assert "completed" in done.stderr  # the summary


def test_json_keys(here: Here, tmp_path: Path) -> None:
    target = str(tmp_path / "run.h5")
    assert here("simulate", CRANK, *SHORT, "--json", "-o", target) == 0
    summary = json.loads(here.out)
    assert set(summary) == SUMMARY_KEYS
    assert summary["status"] == "completed"
    assert summary["output"] == target
    assert summary["samples"] == 3
    assert set(summary["multipliers"]) == {"guide"}
    assert {"min", "max"} <= set(summary["multipliers"]["guide"])
    assert set(summary["initial_correction"]) == {"psi", "psi'"}
    phases = {"load", "derive", "compile", "integrate", "write", "total"}
    assert set(summary["seconds"]) == phases
    assert here.err == ""


def test_quiet_is_silent(here: Here, tmp_path: Path) -> None:
    assert here("simulate", CRANK, *SHORT, "--quiet", "-o", str(tmp_path / "run.h5")) == 0
    assert (here.out, here.err) == ("", "")


def test_model_from_standard_input() -> None:
    text = Path(PENDULUM).read_text(encoding="utf-8")
    done = lagcli("simulate", "-", *SHORT, "--json", input=text)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["samples"] == 3


# the command line's own errors


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--samples", "3", "--dt", "0.1"], "contradict"),
        (["--times", "0,1", "--dt", "0.1"], "contradict"),
        (["--times", "0,1", "--samples", "3"], "contradict"),
        (["--times", "0,x"], "--times"),
        (["--times", "1,0.5"], "increase"),
        (["--times", ""], "--times"),
        (["--times", "nan"], "finite"),
        (["--dt", "0"], "dt"),
        (["--dt", "-1"], "dt"),
        (["--dt", "nan"], "dt"),
        (["--t-end", "-1"], "t_end"),
        (["--t-end", "inf"], "t_end"),
        (["--samples", "0"], "samples"),
        (["--rtol", "1e-20"], "rtol"),
        (["--max-steps", "0"], "max_steps"),
        (["--alpha", "-1"], "alpha"),
        (["--method", "Euler"], "DOP853"),
        (["--formulation", "none"], "index1"),
        (["--samples", "many"], "--samples"),
        (["--no-such-option"], "--no-such-option"),
        (["--set", "lenght=2"], "`lenght`"),
        (["--set", "l"], "NAME=VALUE"),
        (["--set", "=2"], "NAME=VALUE"),
        (["--set", "l="], "NAME=VALUE"),
        (["--set", "l=1", "--set", "l=2"], "twice"),
        (["--set", "l=long"], "long"),
        (["--set-initial", "chi=1"], "chi"),
        (["--set-initial", "phi=fast"], "fast"),
        (["-o", "run.xls"], ".xls"),
        (["-o", "run"], ".h5"),
    ],
)
def test_usage_errors(
    here: Here, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert here("simulate", CRANK, *arguments) == 2
    assert said in here.err
    assert here.out == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["run.h5", "run.csv"])
def test_a_run_that_stops_before_its_first_sample_is_written(
    here: Here, tmp_path: Path, name: str
) -> None:
    """Its file has the event; an older file of this name does not stay."""
    model, output = tmp_path / "m.yaml", tmp_path / name
    model.write_text(
        "coordinates: [x]\nparameters: {c: 0.5}\nT: x'^2/2\ninitial: {x: 0, x': 1}\n"
        "events: {end: {when: x >= c, stop: true}}\nsimulation: {t_end: 1, samples: 1}\n"
    )
    assert here("simulate", str(model), "--set", "c=2", "-o", str(output), "--meta") == 0
    assert read(output).time.tolist() == [1.0]
    assert here("simulate", str(model), "-o", str(output), "--meta", "--force") == 0
    assert re.search(r"written +.*" + name, here.out)
    run = read(output)
    assert (run.status, run.time.shape) == ("stopped-by-event", (0,))
    assert run.events is not None
    assert run.events.time.tolist() == pytest.approx([0.5])


def test_two_results_for_one_stream(here: Here) -> None:
    assert here("simulate", CRANK, "-o", "-", "--json") == 2
    assert "standard output" in here.err
    assert json.loads(here.out)["status"] == "error"


def test_no_command_and_unknown_command(here: Here) -> None:
    assert here("integrate", CRANK) == 2
    assert "integrate" in here.err
    assert here() in (0, 2)
    assert "simulate" in here.out + here.err


def test_version(here: Here) -> None:
    assert here("--version") == 0
    assert re.fullmatch(r"lagcli \d+\.\d+\.\d+\n", here.out)


def test_model_errors(here: Here, tmp_path: Path) -> None:
    model = tmp_path / "m.yaml"
    model.write_text(Path(CRANK).read_text(encoding="utf-8").replace("l*sin(psi)", "lenght"))
    assert here("simulate", str(model)) == 2
    assert f"{model}:" in here.err
    assert "error[unknown-name]" in here.err
    assert here("simulate", str(model), "--json") == 2
    found = json.loads(here.out)
    assert found["status"] == "error"
    assert found["diagnostics"][0]["kind"] == "unknown-name"
    assert here("simulate", str(tmp_path / "none.yaml")) in (2, 4)
    assert "none.yaml" in here.err


# options that change the model


def test_set_with_and_without_a_unit(here: Here, tmp_path: Path) -> None:
    target = str(tmp_path / "run.h5")
    arguments = ("--set", "l=35 cm", "--set", "m=2", "-o", target)
    assert here("simulate", CRANK, *SHORT, *arguments) == 0
    trajectory = read(target)
    assert trajectory.parameters["l"] == 0.35
    assert trajectory.parameters["m"] == 2


@pytest.mark.parametrize("form", ["phi'=3", "phi_dot=3", "phi_dot = 3 rad/s"])
def test_set_initial_velocity(here: Here, tmp_path: Path, form: str) -> None:
    target = str(tmp_path / "run.h5")
    arguments = ("--set-initial", form, "--set-initial", "phi=0.7")
    assert here("simulate", CRANK, *SHORT, *arguments, "-o", target) == 0
    trajectory = read(target)
    assert trajectory.v[0, 0] == 3
    assert trajectory.q[0, 0] == 0.7


def test_start_that_contradicts_is_a_model_error(here: Here) -> None:
    assert here("simulate", CRANK, "--set-initial", "psi=1") == 2
    assert "error[inconsistent-start]" in here.err
    assert "for instance `" in here.err


# files that cannot be written


def test_nothing_is_overwritten_without_force(here: Here, tmp_path: Path) -> None:
    target = tmp_path / "run.csv"
    target.write_text("mine")
    assert here("simulate", CRANK, *SHORT, "-o", str(target)) == 4
    assert "--force" in here.err
    assert target.read_text() == "mine"
    assert here("simulate", CRANK, *SHORT, "-o", str(target), "--force") == 0
    assert target.read_text().startswith("t,phi")


def test_missing_folder_fails_before_the_run(here: Here, tmp_path: Path) -> None:
    began = time.process_time()
    arguments = ("--t-end", "1e9", "--samples", "3")
    assert here("simulate", CRANK, *arguments, "-o", str(tmp_path / "no" / "run.h5")) == 4
    assert time.process_time() - began < 2
    assert "mkdir -p" in here.err


def test_model_is_never_the_output(here: Here, tmp_path: Path) -> None:
    model = tmp_path / "model.csv"
    model.write_text(Path(CRANK).read_text(encoding="utf-8"))
    before = model.read_text()
    assert here("simulate", str(model), *SHORT, "-o", str(model), "--force") == 2
    assert "the model itself" in here.err
    assert model.read_text() == before


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")
@pytest.mark.parametrize("command", [["simulate", CRANK, "-o", "-"], ["derive", CRANK]])
def test_full_standard_output(command: list[str]) -> None:
    with open("/dev/full", "w") as full:
        done = lagcli(*command, stdout=full, stderr=subprocess.PIPE, capture_output=False)
    assert done.returncode == 4
    assert "error" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("command", ["simulate {} -o -", "derive {}", "simulate --help"])
def test_closed_pipe_ends_quietly(command: str) -> None:
    text = f"{sys.executable} -m lagcli {command.format(CRANK)} | head -1"
    done = subprocess.run(
        text,
        shell=True,
        capture_output=True,
        text=True,
        env=environment(),
        timeout=PATIENCE,
        check=False,
    )
    assert len(done.stdout.splitlines()) == 1
    assert "Traceback" not in done.stderr
    assert "Error" not in done.stderr


def test_the_summary_states_the_postulate_that_a_run_uses(here: Here) -> None:
    assert here("simulate", "appell_hamel") == 0
    assert "\n  postulate   Chetaev's rule: the force of appell is along ∂ψ/∂q̇\n" in here.out
    assert here("simulate", "appell_hamel", "--json") == 0
    assert json.loads(here.out)["nonlinear"] == ["appell"]
    assert here("simulate", PENDULUM, *SHORT) == 0
    assert "postulate" not in here.out


def test_the_summary_says_which_contacts_hold_at_the_end(here: Here) -> None:
    assert here("simulate", "bouncing_ball") == 0
    assert "at the end: floor holds" in here.out


# runs that fail, and runs that are stopped


def test_failed_run_keeps_its_samples(here: Here, tmp_path: Path) -> None:
    target = str(tmp_path / "run.h5")
    model = str(MODELS / "parallelogram.yaml")
    assert here("simulate", model, "--set-initial", "alpha_1'=6", "-o", target) == 3
    assert "error: singular configuration" in here.err
    assert "kept 11 samples" in here.err
    trajectory = read(target)
    assert trajectory.status == "failed"
    assert "singular" in trajectory.message
    assert len(trajectory.time) == 11
    assert here("simulate", model, "--set-initial", "alpha_1'=6", "--json") == 3
    assert json.loads(here.out)["status"] == "failed"


def test_run_that_gives_up(here: Here, tmp_path: Path) -> None:
    target = str(tmp_path / "run.csv")
    assert here("simulate", CRANK, "--max-steps", "20", "-o", target, "--quiet") == 3
    assert "--max-steps" in here.err
    assert here.out == ""
    assert len(read(target).time) > 1


@pytest.mark.parametrize("meta", [(), ("--meta",)])
@pytest.mark.parametrize("name", ["run.csv.json", "run.events.csv"])
def test_a_model_is_not_overwritten_by_what_is_beside_a_result(
    here: Here,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    meta: tuple[str, ...],
) -> None:
    monkeypatch.chdir(tmp_path)
    text = Path(PENDULUM).read_text()
    Path(name).write_text(text)
    assert here("simulate", name, "-o", "run.csv", "--t-end", "0.1", "--force", *meta) == 2
    assert f"{name} is the model itself" in here.err
    assert os.listdir() == [name]
    assert Path(name).read_text() == text


def test_tables_that_are_read_are_not_overwritten(
    here: Here, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sub").mkdir()
    Path("sub/model.yaml").write_text(
        "coordinates: [x]\nparameters: {m: 1}\ninputs: {u: {file: u.csv, time: t, column: u}}\n"
        "T: m*x'^2/2\nV: -u*x\ninitial: {x: 0, x': 0}\n"
    )
    table = Path("sub/u.csv")
    table.write_text("t,u\n0,1\n1,2\n")
    Path("values.csv").write_text("m\n1\n2\n")
    before = {path: path.read_bytes() for path in (table, Path("values.csv"))}
    short = ("--t-end", "0.1", "--force")
    assert here("simulate", "sub/model.yaml", "-o", "sub/u.csv", *short) == 2
    assert "is a table of the model's inputs" in here.err
    sweep = ("sweep", "sub/model.yaml", "--vary", "@values.csv", "--measure", "final(x)")
    assert here(*sweep, "-o", "sub/u.csv", *short) == 2
    assert "is a table of the model's inputs" in here.err
    assert here(*sweep, "-o", "values.csv", *short) == 2
    assert "values.csv is the table of --vary" in here.err
    assert {path: path.read_bytes() for path in before} == before
    assert here(*sweep, "-o", "other.csv", *short) == 0


NOT_UTF8 = os.fsdecode(b"x\xff\xfe")


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are text elsewhere")
@pytest.mark.parametrize(
    "line",
    some(
        [
            "derive NAME.yaml -o NAME.tex",
            "simulate NAME.yaml -o NAME.csv --meta --t-end 0.1 --force",
            "report NAME.h5 -o NAME.html",
            "derive NAME.yaml -o NAME.md",
            "export NAME.yaml --to c -o NAME.c",
            "export NAME.yaml --to python -o NAME.py",
            "export NAME.yaml --to modelica -o NAME.mo",
            "sweep NAME.yaml --vary m=1,2 -o NAME.sweep.h5 --t-end 0.1",
            "info NAME.h5",
            "animate NAME.h5 -o NAME.anim.html",
            "animate NAME.h5 -o NAME.gif --size 100x100 --fps 5",
            "plot NAME.h5 NAME.csv x -o NAME.svg",
            "report NAME.csv --model NAME.yaml -o NAME.html",
        ],
        3,
    ),
)
def test_names_of_files_that_are_not_utf8(
    here: Here, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    monkeypatch.chdir(tmp_path)
    text = Path(PENDULUM).read_text()
    Path(f"{NOT_UTF8}.yaml").write_text(re.sub("^(name|title):.*\n", "", text, flags=re.M))
    for suffix in (".h5", ".csv"):
        output = ("-o", f"{NOT_UTF8}{suffix}", "--t-end", "0.1", "--quiet")
        assert here("simulate", f"{NOT_UTF8}.yaml", *output) == 0
    done = lagcli(*(word.replace("NAME", NOT_UTF8) for word in line.split()))
    assert done.returncode == 0, done.stderr


INTERRUPTED = """
import os, signal
import {module} as module

called = {owner}.{name}

def interrupted(*arguments, **options):
    result = called(*arguments, **options)
    if {when}:
        os.kill(os.getpid(), signal.SIGINT)
    return result

{owner}.{name} = interrupted
from lagcli.cli.app import main
main()
"""


def interrupted(*arguments: str, **place: str) -> subprocess.CompletedProcess[str]:
    """Run the program with a real SIGINT at a known place."""
    code = INTERRUPTED.format(**place)
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        capture_output=True,
        text=True,
        env=environment(),
        timeout=PATIENCE,
        check=False,
    )


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_interrupt_leaves_a_whole_file(tmp_path: Path, suffix: str) -> None:
    target = tmp_path / f"run{suffix}"
    done = interrupted(
        *("simulate", PENDULUM, "--t-end", "1e5", "--dt", "0.01", "-o", str(target), "--meta"),
        module="lagcli.cli.progress",
        owner="module.Progress",
        name="__call__",
        when="arguments[1] > 0.5",
    )
    assert done.returncode == BY_INTERRUPT
    assert "interrupted" in done.stderr
    assert "kept" in done.stderr
    assert "Traceback" not in done.stderr
    trajectory = read(target)
    assert trajectory.status == "interrupted"
    # of 10^7: what was reached when the progress was next shown
    assert 50 <= len(trajectory.time) < 10**6
    leftovers = {p.name for p in tmp_path.iterdir()} - {target.name, f"{target.name}.json"}
    assert not leftovers


def test_interrupt_before_the_run(tmp_path: Path) -> None:
    done = interrupted(
        *("simulate", PENDULUM, "-o", str(tmp_path / "run.h5")),
        module="lagcli.model.loader",
        owner="module",
        name="load",
        when="True",
    )
    assert done.returncode == BY_INTERRUPT
    assert done.stderr == "interrupted\n"
    assert list(tmp_path.iterdir()) == []


def test_interrupt_during_imports() -> None:
    code = """
import os, signal, sys

class Interrupting:
    def find_spec(self, name, *_):
        if name == "lagcli.cli.app":
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupting())
from lagcli.__main__ import main
main()
"""
    command = [sys.executable, "-c", code, "--version"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment(), check=False)
    assert (done.returncode, done.stdout, done.stderr) == (BY_INTERRUPT, "", "")


# surroundings


@pytest.mark.parametrize(
    "surroundings", [{"LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0"}, {"NO_COLOR": "1"}]
)
def test_plain_surroundings(surroundings: dict[str, str]) -> None:
    for command in (["simulate", CRANK, *SHORT], ["derive", CRANK], ["simulate", "--help"]):
        done = lagcli(*command, env=surroundings)
        assert done.returncode == 0, done.stderr
        assert "\x1b" not in done.stdout + done.stderr
        assert done.stderr == ""


@pytest.mark.parametrize(
    "view",
    [
        "{points: {P: [phi, 0], O: [0, 0]}, rods: [O-Q]}",
        "{points: {P: [phi, nothing]}}",
        "{rods: [O-P]}",
        "[P]",
        "{points: {P: [phi, 0]}, vectors: {F: {at: P, force: nothing}}}",
        "{points: {P: [" + "a + " * 60 + "phi, 0]}}",
    ],
)
def test_derive_prints_the_equations_of_a_model_whose_view_has_an_error(
    here: Here, tmp_path: Path, view: str
) -> None:
    plain = "{coordinates: [phi], T: phi'^2/2, V: phi^2/2, initial: {phi: 1, phi': 0}}"
    plain_file, drawn, wrong = (str(tmp_path / f"{x}.yaml") for x in ("plain", "drawn", "wrong"))
    Path(plain_file).write_text(plain)
    Path(drawn).write_text(f"{plain[:-1]}, name: plain, view: {view}}}")
    assert here("derive", plain_file) == 0
    expected = here.out
    assert here("derive", drawn) == 0
    assert here.out == expected
    assert "drawn.yaml:1:" in here.err
    assert "warning[" in here.err
    assert here("check", drawn) == 2
    Path(wrong).write_text(f"{plain[:-1]}, Q: {{x: 1}}, view: {view}}}")
    assert here("derive", wrong) == 2
    assert here.err.count("error[") == 1


@pytest.mark.parametrize("command", ["derive", "simulate", "play", "info"])
def test_help_shows_every_option_with_its_text(here: Here, command: str) -> None:
    from lagcli.cli import app

    assert here(command, "--help") == 0
    words = " ".join(here.out.split())
    for parameter in app.command(command).params:
        if parameter.param_type_name == "option":
            assert max(parameter.opts, key=len) in words, parameter.name
        assert parameter.help, f"{command}: {parameter.name} has no help"
        assert " ".join(parameter.help.split())[:25] in words


def test_every_command_says_what_it_does(here: Here) -> None:
    assert here("--help") == 0
    for command in ("derive", "simulate", "info"):
        assert re.search(rf"^  {command} +\S", here.out, re.MULTILINE)
    assert "Exit status" in here.out


def test_settings_that_are_printed_as_defaults_are_the_defaults(here: Here) -> None:
    from lagcli.settings.settings import DEFAULTS

    assert here("simulate", "--help") == 0
    words = " ".join(here.out.split())
    for option, expected in DEFAULTS.as_dict().items():
        flag = "--" + option.replace("_", "-")
        stated = re.search(rf"{flag} (?:(?! --).)*\[default: ([^\]]+)\]", words)
        if expected is False:
            assert not stated, option
            continue
        assert stated, option
        found = stated[1] if isinstance(expected, str) else float(stated[1])
        assert found == expected
