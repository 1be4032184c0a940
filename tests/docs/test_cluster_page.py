"""Examples of docs/cluster.md that need neither ssh nor a cluster are run as they stand."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from patience import PATIENCE

pytest.importorskip("distributed", reason="lagcli[cluster] is not installed")

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "cluster.md"


def blocks(heading: str, kind: str) -> list[str]:
    sections = re.split(r"^## ", PAGE.read_text(encoding="utf-8"), flags=re.M)
    (section,) = [s for s in sections if s.startswith(heading)]
    return re.findall(rf"```{kind}\n(.*?)```", section, re.S)


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with models, and with programs that stand for those of a cluster."""
    shutil.copytree(ROOT / "models", tmp_path / "models")
    shutil.copy(ROOT / "models" / "slider_crank.yaml", tmp_path / "model.yaml")
    (tmp_path / "bin").mkdir()
    python = shlex.quote(sys.executable)
    for name, body in {
        "lagcli": f'exec {python} -m lagcli "$@"',
        "dask": f'what=$1; shift; exec {python} -m distributed.cli.dask_$what "$@"',
        "srun": 'exec "$@"',
        "hostname": "echo 127.0.0.1",
    }.items():
        program = tmp_path / "bin" / name
        program.write_text(f"#!/bin/sh\n{body}\n")
        program.chmod(0o755)
    return tmp_path


def environment(place: Path) -> dict[str, str]:
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    path = f"{place / 'bin'}{os.pathsep}{os.environ['PATH']}"
    return {**kept, "PATH": path, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


@pytest.mark.slow
def test_from_python(place: Path) -> None:
    (code,) = blocks("From Python", "python")
    # as a file: spawned processes import it
    (place / "sweep.py").write_text(
        "if __name__ == '__main__':\n" + re.sub(r"^(?=.)", "    ", code, flags=re.M)
    )
    done = subprocess.run(
        [sys.executable, "sweep.py"], cwd=place, env=environment(place),
        capture_output=True, text=True, timeout=PATIENCE, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "11 of 11"
    assert (place / "sweep.h5").exists()


@pytest.mark.slow
def test_a_job_of_slurm_that_is_ended_and_submitted_again(place: Path) -> None:
    (script,) = [b for b in blocks("Slurm", "sh") if "dask scheduler" in b]
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    script = script.replace("8786", port).replace("--nworkers 32", "--nworkers 2 --no-dashboard")
    script = script.replace("dask scheduler", "dask scheduler --no-dashboard")
    script = script.replace("m=1:2:0.0001", "m=1:2:0.002").replace("--resume", "--resume --t-end 1")
    (place / "job").write_text(script)

    def submit() -> subprocess.Popen[str]:
        return subprocess.Popen(
            ["bash", "job"], cwd=place, env=environment(place), start_new_session=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip

    def clean(job: subprocess.Popen[str]) -> str:
        os.killpg(job.pid, signal.SIGKILL)  # as Slurm does, with what a job leaves
        return job.communicate()[0]

    first = submit()
    journal = place / "sweep.h5.journal"
    while not (journal.exists() and journal.stat().st_size > 3000):
        assert first.poll() is None
        time.sleep(0.02)
    first.send_signal(signal.SIGTERM)
    try:
        assert first.wait(PATIENCE) == 130
    finally:
        assert "rows kept in sweep.h5.journal" in clean(first)
    assert not (place / "sweep.h5").exists()
    second = submit()
    try:
        assert second.wait(PATIENCE) == 0
    finally:
        assert "rows done before" in clean(second)
    assert (place / "sweep.h5").exists()
