"""Runs of very many samples: memory, signals, kills, and disks that are full in the middle."""

from __future__ import annotations

import os
import re
import resource
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from patience import PATIENCE, children_time, processor_time, wait_until
from peak_memory import peak
from trajectories import environment

from lagcli.results import atomic, read
from lagcli.results.info import describe

MODELS = Path(__file__).parents[2] / "models"
CRANK, PENDULUM, SQUEEZER = (
    str(MODELS / f"{name}.yaml")
    for name in ("slider_crank", "pendulum_cartesian", "andrews_squeezer")
)
#: What a shell calls status 130.
BY_INTERRUPT = -signal.SIGINT
ENDLESS = ("--t-end", "1e4", "--samples", "10000000", "--quiet")

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")


def started(*arguments: str, stdout: int = subprocess.DEVNULL) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "lagcli", "simulate", *arguments],
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    )


def written(process: subprocess.Popen[str]) -> int:
    """Return the bytes that a process has written so far."""
    try:
        found = re.search(r"wchar: (\d+)", Path(f"/proc/{process.pid}/io").read_text())
    except OSError:
        pytest.skip("what a process writes is not to be seen here")
    return int(found[1]) if found else 0


def wait_until_written(process: subprocess.Popen[str], size: int) -> None:
    def reached() -> bool:
        assert process.poll() is None, process.communicate()
        return written(process) >= size

    wait_until(reached)


# memory


@pytest.mark.slow
def test_a_million_samples_take_little_memory(tmp_path: Path) -> None:
    path = str(tmp_path / "run.h5")
    arguments = ("simulate", PENDULUM, "--samples", "1000000", "--quiet", "-o", path)
    assert peak(*arguments) < 300
    assert peak("info", path, seconds=30) < 300
    found = describe(path)
    assert (found["sizes"]["samples"], found["time"]["last"]) == (10**6, 10.0)


@pytest.mark.slow
@pytest.mark.parametrize("output", ["run.csv", pytest.param("-", marks=pytest.mark.slow)])
def test_memory_does_not_grow_with_a_table(tmp_path: Path, output: str) -> None:
    path = output if output == "-" else str(tmp_path / output)
    few, many = (
        peak("simulate", CRANK, "--samples", n, "-o", path, "--force", "--quiet")
        for n in ("5000", "60000")
    )
    assert many < few + 20  # all numbers together are 12 MB, their text twice that
    if output != "-":
        assert peak("info", path) < few + 60


@pytest.mark.slow
def test_memory_without_a_file() -> None:
    """The summary alone needs no samples at all."""
    few, many = (peak("simulate", CRANK, "--samples", n, "--quiet") for n in ("5000", "300000"))
    assert many < few + 20


@pytest.mark.slow
@pytest.mark.parametrize("output", ["run.h5", "run.csv", "-"])
@pytest.mark.parametrize("model", [CRANK, PENDULUM, SQUEEZER])
def test_a_million_samples_of_every_kind(tmp_path: Path, model: str, output: str) -> None:
    path = output if output == "-" else str(tmp_path / output)
    assert peak("simulate", model, "--samples", "1000000", "--quiet", "-o", path) < 300
    if output != "-":
        assert peak("info", path) < 300


# signals


@pytest.mark.parametrize(("number", "suffix"), [(signal.SIGINT, ".h5"), (signal.SIGTERM, ".csv")])
def test_a_signal_ends_a_run_soon_and_keeps_its_samples(
    tmp_path: Path, number: signal.Signals, suffix: str
) -> None:
    path = tmp_path / f"run{suffix}"
    before = children_time()
    process = started(PENDULUM, *ENDLESS, "-o", str(path), "--meta")
    wait_until_written(process, 20_000_000 if suffix == ".h5" else 1_000_000)
    until_signal = processor_time(process.pid)
    process.send_signal(number)
    _, said = process.communicate(timeout=PATIENCE)
    # 0.1 s to stop; the rest writes the file and ends Python
    assert children_time() - before - until_signal < 5
    assert process.returncode == BY_INTERRUPT
    found = re.search(r"kept (\d+) samples", said)
    assert found, said
    run = read(path)
    assert (run.status, len(run.time)) == ("interrupted", int(found[1]))
    assert len(run.time) > 1000
    # every one of them, up to the last
    np.testing.assert_array_equal(run.time, np.linspace(0, 1e4, 10**7)[: len(run.time)])
    assert np.isfinite(run.multipliers).all()
    assert {p.name for p in tmp_path.iterdir()} <= {path.name, f"{path.name}.json"}


BEGUN = """
from lagcli.engine.integrate.run import Integration

integrate = Integration.integrate

def begun(integration):
    print("begun", flush=True)
    integrate(integration)

Integration.integrate = begun
from lagcli.cli.app import main
main()
"""


def test_a_signal_to_a_run_without_a_file() -> None:
    """In the middle of a run of which nothing is seen for minutes."""
    process = subprocess.Popen(
        [
            *(sys.executable, "-c", BEGUN, "simulate", PENDULUM),
            *("--t-end", "1e9", "--samples", "3", "--quiet"),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    began = processor_time(process.pid)
    wait_until(lambda: processor_time(process.pid) > began + 0.1)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == BY_INTERRUPT
    assert "interrupted" in said
    assert "Traceback" not in said


TWICE = """
import os, signal
from lagcli.results.hdf5 import trajectories

describe = trajectories.Hdf5Writer._describe

def interrupted(*arguments):
    os.kill(os.getpid(), signal.SIGINT)  # noted: all samples are there
    if {again}:
        os.kill(os.getpid(), signal.SIGINT)
    describe(*arguments)

trajectories.Hdf5Writer._describe = interrupted
from lagcli.cli.app import main
main()
"""


@pytest.mark.parametrize("again", [False, True])
def test_signals_while_the_file_is_finished(tmp_path: Path, again: bool) -> None:
    path = tmp_path / "run.h5"
    done = subprocess.run(
        [sys.executable, "-c", TWICE.format(again=again), "simulate", PENDULUM, "-o", str(path)],
        capture_output=True,
        text=True,
        env=environment(),
        timeout=PATIENCE,
        check=False,
    )
    assert "Traceback" not in done.stderr
    if again:
        assert (done.returncode, done.stderr) == (BY_INTERRUPT, "interrupted\n")
        assert os.listdir(tmp_path) == []
    else:
        assert (done.returncode, read(path).status) == (0, "completed")


# kills, full disks, closed pipes


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_a_killed_run_leaves_nothing(tmp_path: Path, suffix: str) -> None:
    if atomic._open_unnamed(str(tmp_path)) is None:
        pytest.skip("without unnamed files a kill leaves a hidden one")
    process = started(PENDULUM, *ENDLESS, "-o", str(tmp_path / f"run{suffix}"))
    wait_until_written(process, 20_000_000 if suffix == ".h5" else 1_000_000)
    assert os.listdir(tmp_path) == []
    process.kill()
    process.communicate(timeout=PATIENCE)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_a_disk_that_fills_up_ends_the_run(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"run{suffix}"
    (tmp_path / "old.h5").write_text("mine")
    process = subprocess.Popen(
        [sys.executable, "-m", "lagcli", "simulate", PENDULUM, *ENDLESS, "-o", str(path)],
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    # not in the child before it starts: Python would take the signal for its own files
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (12_000_000, 12_000_000))
    _, said = process.communicate(timeout=PATIENCE)  # long before the ten million samples
    assert process.returncode == 4
    assert said == (
        f"error: cannot write {path}: the file is larger than allowed here; raise the limit"
        " (ulimit -f)\n"
    )
    assert os.listdir(tmp_path) == ["old.h5"]


def test_a_reader_that_has_enough_ends_the_run() -> None:
    process = started(PENDULUM, *ENDLESS, "-o", "-", stdout=subprocess.PIPE)
    assert process.stdout is not None
    lines = [process.stdout.readline() for _ in range(3)]
    process.stdout.close()
    assert process.wait(timeout=PATIENCE) != 0
    assert process.stderr is not None
    assert process.stderr.read() == ""
    process.stderr.close()
    assert lines[0].startswith("t,x,y")
    assert lines[1].startswith("0,")
