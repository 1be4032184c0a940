"""Whatever is done to a result file: it is read as it was written, or rejected with status 4.

A mutant of a file with a checksum that is read with status 0 must print what the original prints.
CSV files without a sidecar, and files with a new checksum contain numbers
without a check: such a mutant is read or rejected, with no traceback and in bounded time.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import random
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from answers import answer
from mutants import changed_bytes, changed_structure, changed_table
from random_cases import FUZZ_COUNT
from trajectories import make_log

import lagcli
from lagcli.errors import LagcliError
from lagcli.results.hdf5 import seal

ROOT = Path(__file__).parents[2]
MODEL = ROOT / "models" / "slider_crank.yaml"
#: Mutants of each kind in the normal suite.
FEW = 12
SECRET = b"the contents of another file"


def commands(name: str, folder: Path) -> list[list[str]]:
    """Return what is done with a mutant: information about it, and one of the other commands."""
    picture, page = str(folder / "picture.svg"), str(folder / "page.html")
    if name.endswith("sweep.h5"):
        return [["info"], ["export-csv", "-o", str(folder / "table.csv"), "--force"]]
    # a table without a sidecar holds no model
    model = ["--model", str(MODEL)] if name == "alone.csv" else []
    return [
        ["info"],
        ["info", "--json"],
        ["animate", "-o", page, "--force", "--quiet", *model],
        ["report", "-o", page, "--force", "--quiet", *model],
        ["plot", "-o", picture, "--force"],
    ]


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return files by name, with the sidecars of CSV files beside them."""
    folder = tmp_path_factory.mktemp("originals")
    trajectory = lagcli.simulate(lagcli.load(MODEL), samples=21, t_end=0.5)
    for name in ("run.csv", "alone.csv"):
        lagcli.write(trajectory, folder / name, meta=name == "run.csv")
    log = make_log(trajectory.coordinates, trajectory.constraints)
    lagcli.write(dataclasses.replace(trajectory, events=log), folder / "run.h5")
    lagcli.sweep(
        MODEL,
        ["m=0,1,2"],
        folder / "sweep.h5",
        samples=11,
        t_end=0.2,
        keep="trajectories",
        measures={"peak": "max(abs(lambda.guide))"},
    )
    return {path.name: path.read_bytes() for path in folder.iterdir()}


class Trial:
    """Mutants of one file, in one folder."""

    def __init__(
        self,
        folder: Path,
        name: str,
        original: bytes,
        sidecar: bytes | None = None,
        pictures: bool = True,
    ):
        self.folder, self.name, self.original = folder, name, original
        self.path = folder / name
        self.outside = folder / "outside.bin"
        self.outside.write_bytes(SECRET * 40)
        os.mkfifo(f"{self.outside}.fifo")
        self.path.write_bytes(original)
        if sidecar is not None:
            self.sidecar = folder / f"{name}.json"
            self.sidecar.write_bytes(sidecar)
        self.commands = commands(name, folder)[: 5 if pictures else 2]
        self.expected = [answer(c, str(self.path), *rest) for c, *rest in self.commands]
        for status, text in self.expected:
            assert status == 0, text
        self.counts: Counter[str] = Counter()

    def judge(self, r: random.Random, what: str, strict: bool) -> None:
        """Read the file as it is now."""
        other = 0 if len(self.commands) == 1 else r.randrange(1, len(self.commands))
        for i in sorted({0, other if r.random() < 0.2 else 0}):
            command, *rest = self.commands[i]
            status, text = answer(command, str(self.path), *rest)
            kept = self.folder / f"failed_{what.replace(' ', '_')}_{self.name}"
            if status not in (0, 4) and not (status in (2, 3) and i and not strict):
                shutil.copy(self.path, kept)
                raise AssertionError(f"{what}: {command}: status {status}: {text} ({kept})")
            if SECRET.decode() in text or "Traceback" in text or "bug in lagcli" in text:
                shutil.copy(self.path, kept)
                raise AssertionError(f"{what}: {command}: {text} ({kept})")
            same = status == 0 and self._plain(text) == self._plain(self.expected[i][1])
            if status == 0 and strict and not same:
                shutil.copy(self.path, kept)
                raise AssertionError(f"{what}: {command}: damage was accepted: {text} ({kept})")
            self.counts["refused" if status else "as the original" if same else "other"] += 1
        if r.random() < 0.1:
            with contextlib.suppress(LagcliError):
                lagcli.read(self.path)

    def _plain(self, text: str) -> list[str]:
        """Return the lines of a text without the size of the file."""
        return [line for line in text.split("\n") if "trajectory, HDF5" not in line]


SEALED = ("run.h5", "sweep.h5")


def _bytes(trial: Trial, r: random.Random, count: int, strict: bool) -> None:
    for i in range(count):
        trial.path.write_bytes(changed_bytes(trial.original, r))
        trial.judge(r, f"bytes {i}", strict)


def _structures(trial: Trial, r: random.Random, count: int, sealed: bool, strict: bool) -> None:
    done = 0
    while done < count:
        trial.path.write_bytes(trial.original)
        if not changed_structure(trial.path, r, str(trial.outside)):
            continue
        if sealed:
            with trial.path.open("r+b") as file:
                seal.seal(file)
        trial.judge(r, f"structure {done}", strict)
        done += 1


def _tables(trial: Trial, r: random.Random, count: int, strict: bool) -> None:
    for i in range(count):
        change = changed_table if r.random() < 0.7 else changed_bytes
        trial.path.write_bytes(change(trial.original, r))
        trial.judge(r, f"table {i}", strict)


def _sidecars(trial: Trial, r: random.Random, count: int) -> None:
    original = trial.sidecar.read_bytes()
    for i in range(count):
        trial.sidecar.write_bytes(changed_bytes(original, r))
        trial.judge(r, f"sidecar {i}", strict=True)


def _values(folder: Path, r: random.Random, count: int) -> Counter[str]:
    """Read mutants of a table of values for a sweep."""
    from lagcli.sweeps.plan.plan import make_plan

    model, path = lagcli.load(MODEL), folder / "values.csv"
    original = b"m,l [cm],phi_dot\n1,20,10\n1.5,30,11\n2,40,12\n"
    counts: Counter[str] = Counter()
    for i in range(count):
        change = changed_table if i % 3 else changed_bytes
        path.write_bytes(change(original, r))
        try:
            plan = make_plan(model, [f"@{path}"])
        except LagcliError:
            counts["refused"] += 1
            continue
        assert np.isfinite(plan.rows(np.arange(plan.length))).all()
        counts["read"] += 1
    return counts


def _trial(folder: Path, name: str, originals: dict[str, bytes], pictures: bool = True) -> Trial:
    return Trial(folder, name, originals[name], originals.get(f"{name}.json"), pictures)


# in the normal suite


@pytest.mark.parametrize("name", SEALED)
def test_a_few_damaged_files(tmp_path: Path, originals: dict[str, bytes], name: str) -> None:
    trial, r = _trial(tmp_path, name, originals, pictures=False), random.Random(1)
    _bytes(trial, r, FEW, strict=True)
    _structures(trial, r, FEW // 2, sealed=True, strict=False)


def test_a_few_damaged_tables(tmp_path: Path, originals: dict[str, bytes]) -> None:
    r = random.Random(2)
    trial = _trial(tmp_path, "run.csv", originals, pictures=False)
    _tables(trial, r, FEW, strict=True)
    trial.path.write_bytes(trial.original)
    _sidecars(trial, r, FEW)
    _values(tmp_path, r, FEW)


# many: `make fuzz`


@pytest.mark.fuzz
@pytest.mark.parametrize("name", SEALED)
@pytest.mark.parametrize("way", ["bytes", "structure", "forged"])
def test_many_damaged_files(
    tmp_path: Path, originals: dict[str, bytes], name: str, way: str
) -> None:
    trial, r = _trial(tmp_path, name, originals), random.Random(f"{name} {way}")
    if way == "bytes":
        _bytes(trial, r, FUZZ_COUNT, strict=True)
    else:
        forged = way == "forged"
        _structures(trial, r, FUZZ_COUNT, sealed=forged, strict=not forged)
    print(f"{name}, {way}: {FUZZ_COUNT} mutants, {dict(trial.counts)}")


@pytest.mark.fuzz
def test_many_damaged_tables(tmp_path: Path, originals: dict[str, bytes]) -> None:
    for name in ("run.csv", "alone.csv"):
        (tmp_path / name.partition(".")[0]).mkdir()
        trial = _trial(tmp_path / name.partition(".")[0], name, originals)
        r = random.Random(name)
        _tables(trial, r, FUZZ_COUNT, strict=name == "run.csv")
        print(f"{name}: {FUZZ_COUNT} mutants, {dict(trial.counts)}")
        if name == "run.csv":
            trial.counts.clear()
            trial.path.write_bytes(trial.original)
            _sidecars(trial, r, FUZZ_COUNT)
            print(f"{name}.json: {FUZZ_COUNT} mutants, {dict(trial.counts)}")
    print(f"values.csv: {FUZZ_COUNT} mutants, {_values(tmp_path, r, FUZZ_COUNT)}")
