"""The examples of docs/shell-sweeps.md are run as they stand, by the tools that they are for."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest
from patience import PATIENCE

from lagcli.results import read

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "shell-sweeps.md"


def blocks(heading: str, kind: str) -> list[str]:
    """Return the examples of a kind below a heading that begins so."""
    sections = re.split(r"^## ", PAGE.read_text(encoding="utf-8"), flags=re.M)
    (section,) = [s for s in sections if s.startswith(heading)]
    return re.findall(rf"```{kind}\n(.*?)```", section, re.S)


def needs(*tools: str) -> pytest.MarkDecorator:
    missing = [tool for tool in tools if shutil.which(tool) is None]
    return pytest.mark.skipif(bool(missing), reason=f"not installed: {', '.join(missing)}")


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with the models and, for the shell to find, lagcli."""
    shutil.copytree(ROOT / "models", tmp_path / "models")
    (tmp_path / "bin").mkdir()
    program = tmp_path / "bin" / "lagcli"
    program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m lagcli "$@"\n')
    program.chmod(0o755)
    return tmp_path


def run(
    command: Iterable[str], place: Path, text: str | None = None, **variables: str
) -> subprocess.CompletedProcess[str]:
    # as installed: with the bytecode that the first run writes
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment = {
        **kept,
        "PATH": f"{place / 'bin'}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        "HOME": str(place),
        **variables,
    }
    return subprocess.run(
        list(command), cwd=place, env=environment, input=text,
        capture_output=True, text=True, timeout=PATIENCE, check=False,
    )  # fmt: skip


def shell(script: str, place: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    done = run(["bash", "-c", script], place, **variables)
    assert done.returncode == 0, done.stderr
    return done


def results(place: Path) -> set[str]:
    return {p.name for p in place.glob("*.h5")}


@needs("bash", "awk")
def test_for(place: Path) -> None:
    files, rows, table = blocks("for", "sh")
    (reader,) = blocks("for", "python")
    (place / "run_1.h5").write_text("mine")
    assert shell(files, place).stderr.count("\n") == 1
    assert (place / "failed.txt").read_text() == "m = 1: status 4\n"
    assert results(place) == {"run_0.5.h5", "run_1.h5", "run_2.h5"}

    shell(rows, place)
    runs = [json.loads(line) for line in (place / "runs.jsonl").read_text().splitlines()]
    assert [r["initial"]["phi'"] for r in runs] == [10, 12, 14]
    done = run([sys.executable, "-c", reader], place)
    printed = [tuple(map(float, line.split())) for line in done.stdout.splitlines()]
    assert printed == [(r["initial"]["phi'"], r["multipliers"]["guide"]["max"]) for r in runs]

    largest = dict(line.split() for line in shell(table, place).stdout.splitlines())
    assert list(largest) == ["0.25", "0.3", "0.35"]
    # the model as it is, l = 0.3, is the second of the runs before
    assert float(largest["0.3"]) == pytest.approx(runs[1]["multipliers"]["guide"]["max"])


@pytest.mark.slow
@needs("bash", "xargs", "seq")
def test_xargs(place: Path) -> None:
    numbers, lines = blocks("xargs", "sh")
    (place / "run_2.h5").write_text("mine")
    done = run(["bash", "-c", numbers], place)
    assert done.returncode == 123  # the others are there all the same
    assert done.stderr.count("run_2.h5 exists already") == 1
    assert results(place) == {f"run_{m}.h5" for m in range(1, 5)}
    assert (place / "run_2.h5").read_text() == "mine"
    shell(lines, place)
    assert {"run_1_0.3.h5", "run_1.5_0.35.h5", "run_2_0.4.h5"} <= results(place)
    assert read(place / "run_1.5_0.35.h5").parameters["l"] == 0.35


@pytest.mark.slow  # as xargs does
@needs("bash", "parallel")
def test_parallel(place: Path) -> None:
    (script,) = blocks("GNU parallel", "sh")
    shell(script, place)
    every = {f"run_{m}_{l}.h5" for m in ("1", "2") for l in ("0.3", "0.4")}
    assert results(place) == every
    header, *rows = (place / "sweep.log").read_text().splitlines()
    column = header.split("\t").index("Exitval")
    assert [row.split("\t")[column] for row in rows] == ["0"] * 4
    shell(script.replace("--joblog", "--resume --joblog"), place)  # nothing is left to do
    assert len((place / "sweep.log").read_text().splitlines()) == 5


@pytest.mark.slow
@needs("make")
def test_make(place: Path) -> None:
    (makefile,) = blocks("make", "make")
    (place / "Makefile").write_text(makefile)
    make = ("make", "-j", "2", "--keep-going")
    done = run(make, place)
    assert (done.returncode, done.stdout.count("lagcli simulate")) == (0, 3)
    assert results(place) == {"run_1.h5", "run_2.h5", "run_3.h5"}
    assert run(make, place).stdout.count("lagcli simulate") == 0
    (place / "run_2.h5").unlink()
    done = run(make, place)
    assert re.findall(r"--set m=(\d)", done.stdout) == ["2"]
    os.utime(place / "models" / "slider_crank.yaml")
    assert run((*make, "--dry-run"), place).stdout.count("lagcli simulate") == 3
    # a failure leaves nothing that would count as made, and the rest goes on
    (place / "Makefile").write_text(makefile.replace("--quiet", "--quiet --max-steps $*000"))
    os.utime(place / "run_3.h5")
    done = run([*make, "run_2.h5", "run_0.h5"], place)
    assert done.returncode == 2
    assert results(place) == {"run_1.h5", "run_2.h5", "run_3.h5"}


@pytest.mark.slow  # as xargs does
@needs("bash", "xargs", "awk", "seq", "grep")
def test_slurm_array_and_reading_back(place: Path) -> None:
    batch, submission, tidy = blocks("Slurm", "sh")
    assert batch.startswith("#!/bin/bash\n#SBATCH --array=")
    values, submit = submission.splitlines()
    assert submit == "sbatch sweep.sbatch"
    (place / "sweep.sbatch").write_text(batch)
    shell(values, place)
    assert len((place / "values.txt").read_text().splitlines()) == 1000
    (place / "values.txt").write_text("0.5\n1\n1.5\n")
    for task in ("0", "1"):
        shell(
            "bash sweep.sbatch", place,
            SLURM_ARRAY_TASK_ID=task, SLURM_ARRAY_TASK_COUNT="2", SLURM_CPUS_PER_TASK="2",
        )  # fmt: skip
        assert ("run_0.5.h5" in results(place)) == (task == "1")
    assert results(place) == {"run_0.5.h5", "run_1.h5", "run_1.5.h5"}

    command = "lagcli simulate models/slider_crank.yaml --set m=9 --max-steps 9 -q -o 'run_{m}.h5'"
    assert run(["bash", "-c", command], place).returncode == 3
    h5py_example, xarray_example = blocks("Reading", "python")
    done = run([sys.executable, "-c", h5py_example], place)
    assert done.returncode == 0, done.stderr
    assert "run_9.h5 stopped after 9 steps" in done.stdout
    largest = {
        float(m): float(value) for m, value in re.findall(r"m = (\S+) kg: .* (\S+)", done.stdout)
    }
    assert list(largest) == [0.5, 1.5, 1]  # in the order of the names
    # force and mass are proportional: nothing but inertia and weight acts
    assert largest[1.5] == pytest.approx(3 * largest[0.5], rel=1e-3)

    shell(tidy, place)
    assert results(place) == {"run_0.5.h5", "run_1.h5", "run_1.5.h5"}
    pytest.importorskip("xarray")
    done = run([sys.executable, "-c", xarray_example], place)
    assert done.returncode == 0, done.stderr
    found = re.search(r"array\(\[(.*?)\]\)", done.stdout)
    assert found, done.stdout
    shown = [float(x) for x in found[1].split(",")]
    assert shown == pytest.approx([largest[m] for m in (0.5, 1, 1.5)], rel=1e-3)
