"""Runs in a loop of the shell: names from values, many processes in one folder, Ctrl-C."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from patience import PATIENCE, wait_until

from lagcli.cli.app import run as run_here
from lagcli.results import read

MODELS = Path(__file__).parents[2] / "models"
CRANK = str(MODELS / "slider_crank.yaml")
CHAIN = str(MODELS / "chain.yaml")
PENDULUM = str(MODELS / "pendulum_cartesian.yaml")
SHORT = ("--t-end", "0.02", "--samples", "3")
PROGRAM = shlex.join([sys.executable, "-m", "lagcli"])

Here = Callable[..., tuple[int, str, str]]


@pytest.fixture
def here(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Here:
    """Run the program in this process, in an empty folder; return status and both streams."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> tuple[int, str, str]:
        status = run_here(list(arguments))
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        return status, out, err

    return call


def environment() -> dict[str, str]:
    # as installed: with the bytecode that the first run writes
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


# names


@pytest.mark.parametrize(
    ("template", "options", "name"),
    [
        ("run_{m}_{l}.h5", ["--set", "m=2.0", "--set", "l=30 cm"], "run_2_0.3.h5"),
        ("run_{m}.csv", ["--set", "m=1/3"], "run_0.3333333333333333.csv"),
        ("{m:.3f}_{m:.1e}_{m:07.2f}.csv", ["--set", "m=2.5"], "2.500_2.5e+00_0002.50.csv"),
        ("run_{ m :03d}.csv", ["--set", "m=7"], "run_007.csv"),
        ("{m:+.1f}{m:}.csv", [], "+1.01.csv"),
        ("{phi}_{phi_dot}_{phi'}.csv", ["--set-initial", "phi_dot=3"], "0.5_3_3.csv"),
        ("{psi}.csv", [], "0.1.csv"),  # as given: the start is moved to 0.1605
        ("a{{b}}_{{m}}.csv", [], "a{b}_{m}.csv"),
        ("{{{m}}}.csv", [], "{1}.csv"),
        ("plain.csv", [], "plain.csv"),
    ],
)
def test_names_hold_values(
    here: Here, tmp_path: Path, template: str, options: list[str], name: str
) -> None:
    status, out, _ = here("simulate", CRANK, *SHORT, *options, "-o", template)
    assert status == 0
    assert os.listdir(tmp_path) == [name]
    assert f"written     {name}\n" in out


def test_names_hold_members_of_families(here: Here, tmp_path: Path) -> None:
    template = "{N:d}_{m[2]}_{x[1]:.2f}_{x_dot[1]}_{x[1]'}.csv"
    options = ("--set", "N=2", "--set", "m[2]=3")
    assert here("simulate", CHAIN, *SHORT, *options, "-o", template)[0] == 0
    assert os.listdir(tmp_path) == ["2_3_0.25_0_0.csv"]


def test_different_values_have_different_names(here: Here, tmp_path: Path) -> None:
    for c in ("0.1", "0.10000000000000002", "1e-20", "1.5e-7", "0"):
        assert here("simulate", CRANK, *SHORT, "--set", f"c={c}", "-o", "{c}.csv")[0] == 0
    found = {float(p.stem) for p in tmp_path.iterdir()}
    assert found == {0.1, 0.10000000000000002, 1e-20, 1.5e-7, 0}


def test_the_name_that_is_shown_is_the_files(here: Here, tmp_path: Path) -> None:
    _, out, _ = here("simulate", CRANK, *SHORT, "-o", "r_{m}.csv", "--meta", "--json")
    assert json.loads(out)["output"] == "r_1.csv"
    assert sorted(os.listdir(tmp_path)) == ["r_1.csv", "r_1.csv.json"]
    status, _, err = here("simulate", CRANK, *SHORT, "-o", "r_{m}.csv")
    assert (status, "r_1.csv exists already" in err) == (4, True)
    status, _, err = here("simulate", CRANK, "--max-steps", "5", "-o", "f_{m}.csv", "-q")
    assert status == 3
    assert "samples in f_1.csv" in err


@pytest.mark.parametrize(
    ("template", "said"),
    [
        ("{mm}.h5", "`mm` is neither a parameter nor an initial value of the model; did you mean"),
        ("{phi_dott}.h5", "did you mean `phi_dot`"),
        ("{zeta}.h5", "there are m, r, l, g, tau, c, phi, psi, phi_dot, psi_dot"),
        ("{guide}.h5", "neither a parameter nor an initial value"),
        ("{}.h5", "no name between the braces"),
        ("{m.h5", "`{` at character 1 has no matching brace; write {{"),
        ("m}.h5", "`}` at character 2 has no matching brace; write }}"),
        ("{m{l}}.h5", "`{` at character 1 has no matching brace"),
        ("{r:d}.h5", "r = 0.1 is not whole"),
        ("{m:/>9}.h5", "`/>9` is not a number format"),
        ("{m:9.2f}.h5", "`9.2f` is not a number format"),
        ("{m:.2d}.h5", "`.2d` is not a number format"),
        ("{m:0999d}.h5", "`0999d` is not a number format"),
        ("{m.__class__}.h5", "neither a parameter nor an initial value"),
        ("{m!r}.h5", "neither a parameter nor an initial value"),
        ("{m}.xls", "the suffix .xls"),
        ("{m:.99f}{m:.99f}{m:.99f}.h5", "name is too long"),
        ("no/{m}.h5", "there is no folder no;"),
    ],
)
def test_wrong_names(here: Here, tmp_path: Path, template: str, said: str) -> None:
    status, out, err = here("simulate", CRANK, *SHORT, "-o", template)
    assert status == (4 if said.startswith(("name is", "there is no folder")) else 2)
    assert said in err
    assert out == ""
    assert os.listdir(tmp_path) == []


def test_a_name_can_lead_to_a_folder_but_no_value_can(here: Here, tmp_path: Path) -> None:
    (tmp_path / "runs").mkdir()
    assert here("simulate", CRANK, *SHORT, "-o", "runs/{m}.csv")[0] == 0
    assert os.listdir(tmp_path / "runs") == ["1.csv"]


# the summary as a row


def test_json_is_one_line_with_what_was_varied(here: Here) -> None:
    _, out, _ = here(
        *("simulate", CRANK, *SHORT, "--set", "l=35 cm", "--set-initial", "phi'=3", "--json")
    )
    assert out.count("\n") == 1
    summary = json.loads(out)
    assert summary["parameters"]["l"] == 0.35
    assert list(summary["initial"]) == ["phi", "psi", "phi'", "psi'"]
    assert summary["initial"]["phi'"] == 3
    assert summary["initial"]["psi"] == summary["initial_correction"]["psi"][1]


# many processes


def test_six_processes_in_one_folder(tmp_path: Path) -> None:
    """Three write their own names, three the same one: one of these wins."""
    names = ["run_{m}.h5"] * 3 + ["same.h5"] * 3
    began = [
        subprocess.Popen(
            [
                *(sys.executable, "-m", "lagcli", "simulate", PENDULUM, "--set", f"m={i}"),
                *("-o", name, "--t-end", "0.1", "--samples", "20", "--quiet"),
            ],
            cwd=tmp_path,
            env=environment(),
            stderr=subprocess.PIPE,
            text=True,
        )
        for i, name in enumerate(names, start=1)
    ]
    said = [process.communicate(timeout=PATIENCE)[1] for process in began]
    statuses = [process.returncode for process in began]
    assert statuses[:3] == [0] * 3, said
    assert sorted(statuses[3:]) == [0] + [4] * 2, said
    for status, text in zip(statuses[3:], said[3:], strict=True):
        assert ("same.h5 exists already" in text) == (status == 4)
    assert {p.name for p in tmp_path.iterdir()} == {
        "same.h5",
        *(f"run_{i}.h5" for i in range(1, 4)),
    }
    for i in range(1, 4):
        run = read(tmp_path / f"run_{i}.h5")
        assert (run.status, run.parameters["m"], len(run.time)) == ("completed", i, 20)
    winner = 4 + statuses[3:].index(0)
    assert read(tmp_path / "same.h5").parameters["m"] == winner


def shell(script: str, folder: Path, **options: object) -> subprocess.Popen[str]:
    settings = {"cwd": folder, "env": environment(), "text": True, "start_new_session": True}
    return subprocess.Popen(["sh", "-c", script], **{**settings, **options})  # type: ignore


def test_standard_input_is_the_loops(tmp_path: Path) -> None:
    """A run in a `while read` loop leaves the lines to the loop."""
    script = f"while read m; do {PROGRAM} simulate {PENDULUM} --set m=$m --t-end 0.01 --json; done"
    process = shell(script, tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    out, _ = process.communicate("1\n2\n", timeout=PATIENCE)
    assert [json.loads(line)["parameters"]["m"] for line in out.splitlines()] == [1, 2]


@pytest.mark.skipif(os.name != "posix", reason="needs process groups")
def test_an_interrupt_ends_the_loop_too(tmp_path: Path) -> None:
    """A shell goes on after a program that exits, whatever its status, having seen Ctrl-C."""
    endless = f"{PROGRAM} simulate {PENDULUM} --t-end 1e6 --samples 10000000 --quiet"
    script = f"for m in 1 2; do {endless} --set m=$m -o - > run_$m.csv || echo failed; done"
    process = shell(
        script,
        tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        # a test started in the background ignores SIGINT, and so would all its children
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    first = tmp_path / "run_1.csv"
    wait_until(lambda: first.exists() and first.stat().st_size > 10_000)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == -signal.SIGINT
    assert out == ""  # it did not fail
    assert "kept" in err
    assert os.listdir(tmp_path) == ["run_1.csv"]  # and the second was not begun


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")
def test_the_shell_calls_it_status_130(tmp_path: Path) -> None:
    endless = f"{PROGRAM} simulate {PENDULUM} --t-end 1e6 --samples 10 --quiet"
    process = shell(f"timeout --preserve-status -s INT 1.5 {endless}; echo $?", tmp_path,
                    stdout=subprocess.PIPE, stderr=subprocess.PIPE)  # fmt: skip
    assert process.communicate(timeout=PATIENCE)[0] == "130\n"
