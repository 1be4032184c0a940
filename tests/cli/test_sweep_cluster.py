"""`lagcli sweep --scheduler` with a real scheduler and worker processes, which are killed, too."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from patience import PATIENCE, wait_until

import lagcli
from lagcli.cli.app import run as run_here
from lagcli.errors import FileError
from lagcli.settings.settings import SettingsOverrides
from lagcli.sweeps.plan.plan import Spec, make_plan
from lagcli.sweeps.row_results import COMPLETED, FAILED, MissingRows, RowStatus
from lagcli.sweeps.rows import cluster
from lagcli.sweeps.rows.cluster import Cluster
from lagcli.sweeps.rows.rows import run_rows
from lagcli.sweeps.rows.workers import Chunks

pytest.importorskip("distributed", reason="lagcli[cluster] is not installed")

MODELS = Path(__file__).parents[2] / "models"
CRANK = str(MODELS / "slider_crank.yaml")
PEAK = ("--measure", "peak=max(abs(lambda.guide))")


def environment(**changes: str) -> dict[str, str]:
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), **changes}


class Dask:
    """A scheduler and workers, each a process with a nanny that restarts it."""

    def __init__(self, folder: Path, *workers: tuple[str, ...], failures: int = 3):
        self.folder, self.processes = folder, []
        there = folder / "scheduler.json"
        allowed = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": str(failures)}
        self.start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
                   "--scheduler-file", str(there), **allowed)  # fmt: skip
        wait_until(
            lambda: there.exists() and there.read_text().strip(),
            (folder / "scheduler.log").read_text,
        )
        self.address = json.loads(there.read_text())["address"]
        for options in workers:
            self.start("worker", self.address, "--host", "127.0.0.1", "--no-dashboard",
                       "--local-directory", str(folder), *options)  # fmt: skip

    def start(self, what: str, *options: str, **changes: str) -> None:
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", *options]
        with (self.folder / f"{what}.log").open("a") as log:
            self.processes.append(
                subprocess.Popen(
                    command,
                    stdout=log,
                    stderr=log,
                    env=environment(**changes),
                    start_new_session=True,
                )
            )

    def close(self) -> None:
        for process in self.processes:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # the worker with its nanny
            process.wait(PATIENCE)


@contextmanager
def dask(folder: Path, *workers: tuple[str, ...], **options: int) -> Iterator[Dask]:
    running = Dask(folder, *workers, **options)
    try:
        if workers:  # without one that starts, a sweep would wait for ever
            with Cluster(running.address) as there:
                there._client.wait_for_workers(len(workers), timeout=PATIENCE)
        yield running
    finally:
        running.close()


@pytest.fixture(scope="module")
def two_workers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Dask]:
    """One worker with one thread, one with two."""
    with dask(tmp_path_factory.mktemp("dask"), ("--nthreads", "1"), ("--nthreads", "2")) as running:
        yield running


def crank(rows: int, **settings: Any) -> Spec:
    model = lagcli.load(CRANK)
    plan = make_plan(model, [f"m=linspace(1, 2, {rows})"])
    measures = (("peak", "max(abs(lambda.guide))"), ("end", "final(phi)"))
    return Spec(
        model.text, CRANK, {}, {}, SettingsOverrides(**settings), plan, measures, "measures"
    )


def run(
    there: Cluster, spec: Spec, check_cancelled: Callable[[int], None] = lambda done: None
) -> dict[str, np.ndarray]:
    """Run all rows on a cluster; return their results in order, each of which came once."""
    n, done = spec.plan.length, 0
    found = {"status": np.full(n, -1), "measures": np.full((n, 2), np.nan),
             "counts": np.zeros((n, 3), int), "messages": np.full(n, None)}  # fmt: skip

    def tell() -> None:
        check_cancelled(done)

    for results in there.run(spec, Chunks(MissingRows(RowStatus(n)), 0, 1), tell):
        assert (found["status"][results.numbers] == -1).all()
        for name in ("status", "measures", "counts"):
            found[name][results.numbers] = getattr(results, name)
        found["messages"][results.numbers] = results.messages
        done += len(results.numbers)
    assert done == n
    return found


def same(found: dict[str, np.ndarray], spec: Spec) -> bool:
    """Return whether results are those of this process, to the last bit."""
    here = run_rows(spec, np.arange(spec.plan.length))
    return all(np.array_equal(found[x], getattr(here, x)) for x in ("status", "measures", "counts"))


def contents(path: Path) -> dict[str, list]:
    found: dict[str, list] = {}
    with h5py.File(path) as root:
        root.visititems(
            lambda name, x: found.update({name: x[()].tolist()}) if hasattr(x, "shape") else None
        )
    return found


def test_a_worker_that_is_killed_loses_nothing(two_workers: Dask) -> None:
    spec, said, killed = crank(200, t_end=0.3), [], []
    with Cluster(two_workers.address, said.append) as there:
        workers = there._client.run(os.getpid)

        def kill(done: int) -> None:
            if done > 20 and not killed:
                killed.extend(workers.popitem())
                os.kill(killed[1], signal.SIGKILL)
            if done > 150 and not said:  # until that was noticed
                time.sleep(0.2)

        found = run(there, spec, kill)
    assert f"the worker {killed[0]} was lost; its unfinished rows are run again" in said
    assert (found["status"] == COMPLETED).all()
    assert same(found, spec)


def wait_for_rows(process: subprocess.Popen[Any], journal: Path, size: int) -> None:
    """Wait until the journal has so many bytes, while the process runs."""

    def there() -> bool:
        assert process.poll() is None
        return journal.exists() and journal.stat().st_size > size

    wait_until(there)


def test_interrupted_and_resumed_the_file_is_that_of_one_machine(
    two_workers: Dask, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "there.h5"
    sweep = ("sweep", CRANK, "--vary", "m=linspace(1, 2, 250)", "--t-end", "2", *PEAK)
    command = (*sweep, "-o", str(target), "--scheduler", two_workers.address)
    # a test in the background ignores SIGINT, and so would this
    process = subprocess.Popen(
        [sys.executable, "-m", "lagcli", *command],
        env=environment(),
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    journal = tmp_path / "there.h5.journal"
    wait_for_rows(process, journal, 1500)
    process.send_signal(signal.SIGINT)
    assert process.wait(PATIENCE) == -signal.SIGINT  # 130 to a shell
    said = capfd.readouterr().err
    assert "of 250 rows kept in" in said
    assert "Traceback" not in said
    assert not target.exists()
    assert run_here([*command, "--resume"]) == 0
    assert "rows done before" in capfd.readouterr().out
    assert not journal.exists()
    assert run_here([*sweep, "-o", str(tmp_path / "here.h5"), "--jobs", "1"]) == 0
    assert contents(target) == contents(tmp_path / "here.h5")


def test_rows_that_fail_are_rows_there_too(two_workers: Dask, tmp_path: Path) -> None:
    target = tmp_path / "s.csv"
    command = ("sweep", CRANK, "--vary", "m=0,1", "--t-end", "0.1", *PEAK, "-o", str(target))
    assert run_here([*command, "--scheduler", two_workers.address, "--quiet"]) == 3
    assert run_here([*command[:-1], str(tmp_path / "here.csv"), "--quiet", "--jobs", "1"]) == 3
    assert "no inertia" in target.read_text()
    assert target.read_text() == (tmp_path / "here.csv").read_text()


def test_another_version_is_rejected(
    two_workers: Dask,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    monkeypatch.setattr(cluster, "__version__", "99.0")
    command = ("sweep", CRANK, "--vary", "m=1,2", *PEAK, "-o", str(tmp_path / "s.h5"))
    assert run_here([*command, "--scheduler", two_workers.address]) == 2
    said = capsys.readouterr().err
    assert "has lagcli 0." in said
    assert "and this is lagcli 99.0; install the same version there" in said
    # a worker that comes later is asked by its first chunk
    monkeypatch.setattr(Cluster, "_check_versions", lambda self, workers: None)
    assert run_here([*command, "--scheduler", two_workers.address, "--force"]) == 2
    assert "and this is lagcli 99.0; install the same version there" in capsys.readouterr().err


def test_what_is_no_scheduler(
    two_workers: Dask,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    command = ("sweep", CRANK, "--vary", "m=1,2", *PEAK, "-o", str(tmp_path / "s.h5"))
    assert run_here([*command, "--scheduler", "tcp://127.0.0.1:1"]) == 4
    assert "no scheduler answers at tcp://127.0.0.1:1 within 0.5 s" in capsys.readouterr().err
    with Cluster(two_workers.address) as there:
        worker = next(iter(there._client.nthreads()))
    assert run_here([*command, "--scheduler", worker]) == 4
    assert f"{worker} is the address of a Dask worker" in capsys.readouterr().err
    assert run_here([*command, "--scheduler", "local:2", "--jobs", "2"]) == 2
    assert "give one of them" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_an_endless_row_is_given_up_by_its_worker(two_workers: Dask) -> None:
    class Enough(Exception):
        pass

    began = time.monotonic()

    def check_cancelled(done: int) -> None:
        if time.monotonic() - began > 0.7:  # that they have begun, where little else runs
            raise Enough

    with pytest.raises(Enough), Cluster(two_workers.address) as there:
        run(there, crank(6, t_end=1e6, method="Rodas5P"), check_cancelled)
    with Cluster(two_workers.address) as there:  # whose threads are free again
        spec = crank(30, t_end=0.1)
        assert same(run(there, spec), spec)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs process groups")
def test_workers_here_and_ctrl_c(tmp_path: Path) -> None:
    """Of a terminal's Ctrl-C, which all processes get, the first one alone makes something."""
    target = tmp_path / "s.h5"
    command = ("sweep", CRANK, "--vary", "m=linspace(1, 2, 3000)", *PEAK, "-o", str(target))
    process = subprocess.Popen(
        [sys.executable, "-m", "lagcli", *command, "--scheduler", "local:1"],
        env=environment(), stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    journal = tmp_path / "s.h5.journal"
    wait_for_rows(process, journal, 2000)
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == -signal.SIGINT
    lines = said.strip().splitlines()
    assert lines[0].startswith("error: interrupted; ")
    assert lines[1:] == ["   help: the same command with --resume continues"]


# longer


DEADLY = """
import os, signal
from lagcli.sweeps.rows import cluster

# a preload may be run twice
runner = cluster._real = getattr(cluster, "_real", cluster._runner)

class Deadly:
    def __init__(self, spec):
        self.spec = spec

    def run(self, numbers, check_cancelled):
        if {row} in numbers:
            os.kill(os.getpid(), signal.SIGKILL)
        return runner(self.spec).run(numbers, check_cancelled)

cluster._runner = Deadly
"""


@pytest.mark.slow
@pytest.mark.parametrize("failures", [0, 3])
def test_a_row_that_kills_workers_is_found(tmp_path: Path, failures: int) -> None:
    (tmp_path / "deadly.py").write_text(DEADLY.format(row=137))
    options = ("--nthreads", "1", "--preload", str(tmp_path / "deadly.py"))
    spec, said = crank(300, t_end=0.2), []
    with (
        dask(tmp_path, options, options, failures=failures) as running,
        Cluster(running.address, said.append) as there,
    ):
        found = run(there, spec)
    assert np.flatnonzero(found["status"] != COMPLETED).tolist() == [137]
    assert found["status"][137] == FAILED
    assert "died while this row ran alone" in found["messages"][137]
    here = run_rows(spec, np.arange(300))
    others = np.arange(300) != 137
    assert np.array_equal(found["measures"][others], here.measures[others])


@pytest.mark.slow
def test_a_scheduler_that_is_killed(tmp_path: Path) -> None:
    with dask(tmp_path, ("--nthreads", "1")) as running, Cluster(running.address) as there:

        def kill(done: int) -> None:
            if done > 50:
                running.processes[0].kill()

        with pytest.raises(FileError, match="no longer answers"):
            run(there, crank(100_000, t_end=0.1), kill)


@pytest.mark.slow
def test_workers_that_come_later(tmp_path: Path) -> None:
    said: list[str] = []
    spec = crank(50, t_end=0.1)
    with dask(tmp_path) as running, Cluster(running.address, said.append) as there:

        def start(done: int) -> None:
            if said and len(running.processes) == 1:
                running.start("worker", running.address, "--host", "127.0.0.1", "--no-dashboard")

        assert same(run(there, spec, start), spec)
    assert said == [f"the scheduler at {running.address} has no workers; waiting for workers"]
