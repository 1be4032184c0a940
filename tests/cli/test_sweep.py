"""`lagcli sweep` from the shell: files, statuses, resuming, and being killed."""

from __future__ import annotations

import csv
import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from here import Here
from patience import PATIENCE, wait_until

import lagcli
from lagcli.cli.app import run as run_here
from lagcli.errors import UsageError
from lagcli.sweeps.file.journal import Journal

MODELS = Path(__file__).parents[2] / "models"
CRANK = str(MODELS / "slider_crank.yaml")
SHORT = ("--t-end", "0.1", "--samples", "11", "--jobs", "1")
PEAK = ("--measure", "peak=max(abs(lambda.guide))")
GRID = ("--vary", "m=1:2:0.5", "--vary", "l=0.2,0.3")


@pytest.fixture
def here(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Here:
    monkeypatch.chdir(tmp_path)
    return Here(capsys)


def contents(path: str | Path) -> dict[str, np.ndarray]:
    """Return all datasets of a file."""
    found: dict[str, np.ndarray] = {}
    with h5py.File(path) as root:
        root.visititems(
            lambda name, x: found.update({name: x[()]}) if isinstance(x, h5py.Dataset) else None
        )
    return found


def assert_same(a: str | Path, b: str | Path) -> None:
    """Hold two files to the same rows, bit for bit."""
    left, right = contents(a), contents(b)
    assert left.keys() == right.keys()
    for name, values in left.items():
        assert np.array_equal(values, right[name], equal_nan=values.dtype.kind == "f"), name


# files


def test_measures_of_a_grid(here: Here) -> None:
    assert here("sweep", CRANK, *GRID, *PEAK, "-o", "s.h5", *SHORT) == 0
    assert here.out.startswith("completed: 6 of 6 rows, 6 good")
    assert here.err == ""
    assert os.listdir() == ["s.h5"]
    found = contents("s.h5")
    assert found["m"].tolist() == [1, 1, 1.5, 1.5, 2, 2]
    assert found["l"].tolist() == [0.2, 0.3] * 3
    for m, l, peak in zip(found["m"], found["l"], found["peak"], strict=True):
        model = lagcli.load(CRANK, set={"m": m, "l": l})
        run = lagcli.simulate(model, t_end=0.1, samples=11)
        assert peak == pytest.approx(np.abs(run.multipliers).max(), rel=1e-9)


def test_it_opens_in_xarray(here: Here) -> None:
    import xarray

    arguments = ("sweep", CRANK, "--vary", "m=0:2:1", "--vary", "phi'=8", *SHORT)
    assert here(*arguments, *PEAK, "--keep", "trajectories", "-o", "s.h5") == 3
    with xarray.open_dataset("s.h5", engine="h5netcdf") as data:
        assert data.sizes == {"run": 3, "time": 11, "coordinate": 2, "constraint": 1}
        assert data["q"].dims == ("run", "time", "coordinate")
        assert data["m"].attrs["units"] == "kg"
        assert data["phi_dot"].attrs["units"] == "rad/s"
        assert data["peak"].attrs["long_name"] == "max(abs(lambda.guide))"
        assert data["status"].attrs["flag_meanings"] == "completed failed error"
        assert data["status"].values.tolist() == [1, 0, 0]
        assert "no inertia" in str(data["message"].values[0])
        assert str(data["message"].values[1]) == ""
        assert np.isnan(data["q"].values[0]).all()
        model = lagcli.load(CRANK, set={"m": 2}, set_initial={"phi'": 8})
        run = lagcli.simulate(model, t_end=0.1, samples=11)
        assert data["q"].values[2] == pytest.approx(run.q, rel=1e-9)
        assert data["multipliers"].values[2] == pytest.approx(run.multipliers, rel=1e-8)
        assert data["energy_total"].values[2] == pytest.approx(run.energy_total, rel=1e-9)
        assert data["constraint_force"].values[2] == pytest.approx(run.constraint_force, rel=1e-8)
    with xarray.open_dataset("s.h5", engine="h5netcdf", group="outputs") as outputs:
        assert outputs["slider"].values[2] == pytest.approx(run.outputs["slider"], rel=1e-9)


def test_what_is_kept_by_default(here: Here) -> None:
    assert here("sweep", CRANK, "--vary", "m=1,2", "-o", "t.h5", *SHORT) == 0
    assert contents("t.h5")["q"].shape == (2, 11, 2)
    arguments = ("sweep", CRANK, "--vary", "m=1,2", "--keep", "measures", *SHORT)
    assert here(*arguments, "-o", "m.h5") == 0
    found = contents("m.h5")
    assert "q" not in found
    assert {"min(lambda.guide)", "final(phi)", "max(abs(energy_balance))"} <= set(found)
    assert here(*arguments[:4], "-o", "m.csv", *SHORT) == 0
    assert "final(phi')" in Path("m.csv").read_text()


def test_csv_and_export(here: Here) -> None:
    arguments = ("sweep", CRANK, "--vary", "m=0,1", *PEAK, *SHORT)
    assert here(*arguments, "-o", "s.csv") == 3
    assert here(*arguments, "-o", "s.h5") == 3
    assert here("export-csv", "s.h5", "-o", "e.csv") == 0
    assert sorted(os.listdir()) == ["e.csv", "s.csv", "s.h5"]
    assert Path("s.csv").read_bytes() == Path("e.csv").read_bytes()
    rows = list(csv.DictReader(Path("s.csv").read_text().splitlines()))
    assert list(rows[0]) == ["run", "m", "peak", "status", "message"]
    assert [row["status"] for row in rows] == ["failed", "completed"]
    assert rows[0]["peak"] == "nan"
    assert float(rows[1]["peak"]) == contents("s.h5")["peak"][1]
    assert here("export-csv", "s.h5", "-o", "e.csv") == 4
    assert "--force" in here.err
    assert here("export-csv", "s.csv", "-o", "f.csv") == 4
    assert here("export-csv", "s.h5", "-o", "e.h5") == 2


def test_info(here: Here) -> None:
    here("sweep", CRANK, "--vary", "m=0:2:1", *PEAK, "-o", "s.h5", *SHORT)
    assert here("info", "s.h5") == 0
    for word in ("sweep, HDF5", "3: 2 completed, 1 failed", "no inertia", "m=0:2:1", "m [kg]"):
        assert word in here.out
    assert max(map(len, here.out.splitlines())) <= 100
    assert here("info", "s.h5", "--json") == 0
    said = json.loads(here.out)
    assert said["rows"] == {"completed": 2, "failed": 1}
    assert said["columns"][0]["max"] == 2


def test_the_file_reproduces_itself(here: Here) -> None:
    here("sweep", CRANK, "--vary", "m=1..2", "--sample", "lhs:3", "--seed", "4", *PEAK,
         "--set", "c=0.1", "-o", "s.h5", *SHORT)  # fmt: skip
    with h5py.File("s.h5") as root:
        text = root.attrs["model"].decode()
        assert text == Path(CRANK).read_text()
        asked = json.loads(root.attrs["sweep"])
        options = json.loads(root.attrs["options"])
        Path("again.yaml").write_text(text)
    assert asked["set"] == {"c": "0.1"}
    assert asked["plan"]["sample"] == {"m": {"kind": "lhs", "points": 3, "seed": 4}}
    summary = lagcli.sweep(
        "again.yaml",
        asked["plan"]["vary"],
        "again.h5",
        sample="lhs:3",
        seed=4,
        set=asked["set"],
        measures=dict(asked["measures"]),
        jobs=1,
        rtol=options["rtol"],
        **{k: asked["settings"][k] for k in ("t_end", "samples")},
    )
    assert summary.ok == 3
    assert_same("s.h5", "again.h5")


# statuses and what is said


def test_json(here: Here) -> None:
    assert here("sweep", CRANK, "--vary", "m=0,1", *PEAK, "-o", "s.h5", "--json", *SHORT) == 3
    said = json.loads(here.out)
    assert {k: said[k] for k in ("status", "rows", "done", "ok", "run", "keep")} == {
        **{"status": "completed", "rows": 2, "done": 2, "ok": 1, "run": 2, "keep": "measures"}
    }
    assert list(said["failed"].values()) == [1]
    assert "no inertia" in next(iter(said["failed"]))
    assert said["rows_per_second"] > 0
    assert here("sweep", CRANK, "--vary", "zz=1", "-o", "t.h5", "--json") == 2
    assert "zz" in json.loads(here.out)["message"]


def test_quiet(here: Here) -> None:
    assert here("sweep", CRANK, *GRID, *PEAK, "-o", "s.h5", "--quiet", *SHORT) == 0
    assert here.out == here.err == ""


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (("--vary", "m=1,2", "--measure", "max(lambda.gide)"), 2, "did you mean"),
        (("--vary", "m=1,2", "--measure", "max(phi)/m"), 2, "peak=max(phi)/m"),
        (("--vary", "m=1,2", "--measure", "status=max(phi)"), 2, "another name"),
        (("--vary", "m=1,2", "--measure", "m=max(phi)"), 2, "would be named `m`"),
        (("--vary", "m=1,2", "--measure", "a=max(phi)", "--measure", "a=min(phi)"), 2, "`a`"),
        (("--vary", "m=1,2", "--measure", "at(phi, 7)"), 2, "goes from 0 to 0.1 s"),
        (("--vary", "m=1,2", "--set", "m=3"), 2, "both varied and set"),
        (("--vary", "m=1,2", "--retry-failed"), 2, "--resume"),
        (("--vary", "m=1,2", "--rtol", "5"), 2, "rtol must lie"),
        ((), 2, "nothing is varied"),
    ],
)
def test_usage_errors(here: Here, arguments: tuple[str, ...], status: int, said: str) -> None:
    assert here("sweep", CRANK, *arguments, "-o", "s.h5", *SHORT) == status
    assert said in here.err
    assert os.listdir() == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"vary": {"l": [0.2, 0.3]}}, "list of texts such as ['m=1:2:0.1'], not {"),
        ({"vary": "l=0.2,0.3"}, "`vary` must be a list of texts"),
        ({"measures": {"peak": None}}, "`measures` must be a list of texts such as ["),
        ({"set": ["m=2"]}, "`set` must be a dict such as {'m': 2}, not ['m=2']"),
        ({"set_initial": {1: 2}}, "`set_initial` must be a dict"),
        ({"jobs": 0}, "`jobs` must be at least 1, not 0"),
        ({"jobs": 1.5}, "`jobs` must be a whole number, not 1.5"),
        ({"vary": ["l=0.2..0.3"], "sample": "sobol:4", "seed": 1.5}, "`seed` must be a whole"),
    ],
)
def test_arguments_of_wrong_types_are_named(
    here: Here, arguments: dict[str, Any], said: str
) -> None:
    with pytest.raises(UsageError, match=re.escape(said)):
        lagcli.sweep("slider_crank", output="a.h5", **{"vary": ["l=0.2"], **arguments})
    assert os.listdir() == []


def test_targets(here: Here) -> None:
    arguments = ("sweep", CRANK, "--vary", "m=1,2", *PEAK, *SHORT)
    assert here(*arguments, "-o", "s.txt") == 2
    assert here(*arguments, "-o", "no/s.h5") == 4
    assert "mkdir -p no" in here.err
    assert here(*arguments, "--keep", "trajectories", "-o", "s.csv") == 2
    assert here(*arguments, "-o", "s.h5") == 0
    assert here(*arguments, "-o", "s.h5") == 4
    assert "--force" in here.err
    assert here(*arguments, "-o", "s.h5", "--force") == 0
    assert os.listdir() == ["s.h5"]


def test_structures_need_measures(here: Here) -> None:
    chain = str(MODELS / "chain.yaml")
    arguments = ("sweep", chain, "--vary", "N=2,3", "--t-end", "0.05", "--jobs", "1")
    assert here(*arguments, "-o", "s.h5") == 2
    assert here(*arguments, "-o", "s.h5", "--keep", "trajectories") == 2
    assert "`N` changes the structure" in here.err
    assert here(*arguments, "-o", "s.h5", "--measure", "e=final(energy_total)") == 0
    assert contents("s.h5")["N"].tolist() == [2, 3]


# processes


def test_rows_do_not_depend_on_jobs(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    from lagcli.sweeps.rows import workers

    monkeypatch.setattr(workers, "_can_fork", lambda: False)
    monkeypatch.setattr(workers, "_SPAWN", -100.0)
    arguments = ("sweep", CRANK, "--vary", "m=linspace(0, 2, 70)", "--measure", "rms(phi')",
                 "--keep", "trajectories", "--samples", "5", "--t-end", "6")  # fmt: skip
    assert here(*arguments, "-o", "one.h5", "--jobs", "1") == 3
    assert here(*arguments, "-o", "two.h5", "--jobs", "2") == 3
    assert_same("one.h5", "two.h5")


FORKED = """
import sys
from lagcli.__main__ import main
from lagcli.sweeps.rows import workers

began, start, what = [], workers._Processes.__init__, sys.argv.pop(1)
def started(self, spec, jobs, forked):
    began.append(forked)
    start(self, spec, jobs, forked)
    if what == "kill":
        print(*(process.pid for process in self.workers.values()), flush=True)
        workers.os.kill(workers.os.getpid(), workers.signal.SIGKILL)
workers._Processes.__init__, workers._FORK = started, -1.0
try:
    main()
finally:
    print(began)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux only")
def test_rows_do_not_depend_on_forks(here: Here) -> None:
    arguments = ("sweep", CRANK, "--vary", "m=linspace(0, 2, 70)", "--measure", "rms(phi')",
                 "--keep", "trajectories", "--samples", "5", "--t-end", "6")  # fmt: skip
    assert here(*arguments, "-o", "one.h5", "--jobs", "1") == 3
    command = [sys.executable, "-c", FORKED, "run", *arguments, "-o", "two.h5", "--jobs", "2"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 3, done.stderr
    assert done.stdout.strip().endswith("[True]")
    assert_same("one.h5", "two.h5")


def _runs(process: Path) -> bool:
    try:
        return "Z (zombie)" not in (process / "status").read_text()
    except OSError:
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux only")
def test_forked_processes_end_with_a_killed_sweep(here: Here) -> None:
    arguments = ("sweep", CRANK, "--vary", "m=linspace(1, 2, 70)", "--measure", "rms(phi')",
                 "--samples", "5", "--t-end", "6", "--jobs", "2")  # fmt: skip
    command = [sys.executable, "-c", FORKED, "kill", *arguments, "-o", "s.h5"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == -signal.SIGKILL
    processes = [Path("/proc", pid) for pid in done.stdout.split()]
    assert len(processes) == 2
    wait_until(lambda: not any(map(_runs, processes)))
    assert here(*arguments, "-o", "s.h5", "--resume") == 0


def test_strict_fails_rows_that_cannot_be_trusted(here: Here) -> None:
    Path("fast.yaml").write_text(
        "coordinates: [x]\nparameters: {w: 20}\nT: x'^2/2\nV: w^2*x^2/2\n"
        "initial: {x: 1, x': 0}\nsimulation: {t_end: 20, samples: 101, atol: 0.1}\n"
    )
    arguments = ("sweep", "fast.yaml", "--vary", "w=0,20", "--measure", "final(x)", "--jobs", "1")
    assert here(*arguments, "-o", "s.h5") == 0
    assert here(*arguments, "--strict", "-o", "t.h5", "--json") == 3
    said = json.loads(here.out)
    assert (said["rows"], said["ok"]) == (2, 1)
    ((cause, count),) = said["failed"].items()
    assert cause.startswith("the energy balance has an error of … J")
    assert count == 1
    found = contents("t.h5")
    assert found["status"].tolist() == [0, 1]
    assert np.isnan(found["final(x)"]).tolist() == [False, True]
    run = lagcli.simulate(lagcli.load("fast.yaml"))
    assert b"energy balance" in found["message"][1]
    assert any("energy balance" in warning for warning in run.warnings)
    assert here(*arguments, "--resume", "-o", "t.h5") == 2
    assert "strict: True before, False now" in here.err


UNDEFINED = """
coordinates: [x]
parameters: {a: 1, b: 1}
T: x'^2/2
V: x^2/2
initial: {x: b, x': 0}
outputs: {tilt: acos(a*x/b), root: sqrt(b^2 - x^2)}
simulation: {t_end: 5, samples: 101}
"""


def test_rows_with_values_that_are_not_finite(here: Here) -> None:
    Path("m.yaml").write_text(UNDEFINED)
    rows = ("sweep", "m.yaml", "--vary", "a=0.5,0.9,1.5,2", "--jobs", "1", "--force")
    # max ignores NaN, so that the number itself does not show it
    assert here(*rows, "--measure", "max(tilt)", "--measure", "max(x)", "-o", "s.h5") == 0
    assert (
        here.err == "warning: 2 of 4 rows: `max(tilt)` is NaN at … of … samples, first at t = …\n"
    )
    found = contents("s.h5")
    assert found["status"].tolist() == [0, 0, 0, 0]
    assert np.isfinite(found["max(tilt)"]).all()
    x = np.abs(np.cos(np.linspace(0, 5, 101)))
    assert found["message"].tolist()[2:] == [
        f"warning: `max(tilt)` is NaN at {count} of 101 samples, first at t = 0".encode()
        for count in ((1.5 * x > 1).sum(), (2 * x > 1).sum())
    ]
    assert here(*rows[:-1], "--measure", "max(tilt)", "--measure", "max(x)", "-o", "s.h5",
                "--resume", "--json") == 0  # fmt: skip
    assert list(json.loads(here.out)["warnings"].values()) == [2]
    # stored outputs, and measures themselves
    assert here(*rows, "-o", "s.h5") == 0
    assert here.err.startswith("warning: 2 of 4 rows: `outputs.tilt` is NaN at")
    assert here(*rows, "--measure", "z=log(max(x) - 2)", "-o", "s.h5") == 0
    assert here.err == "warning: 4 of 4 rows: the measure `z` is not finite\n"
    # a time that does not exist is no error
    assert here(*rows, "--measure", "time_of(x > 2)", "-o", "s.h5") == 0
    assert here.err == ""
    assert here(*rows, "--measure", "max(tilt)", "--strict", "-o", "s.h5", "--json") == 3
    said = json.loads(here.out)
    assert said["failed"] == {"`tilt` is NaN at … of … samples, first at t = …": 2}
    assert said["warnings"] == {}
    assert here(*rows, "--measure", "u=max(acos(a*x))", "--strict", "-o", "s.h5") == 3


def test_rounding_beyond_a_domain_in_batches(here: Here) -> None:
    # x is b at t = 0 exactly, and for some b/b·x there is rounding beyond 1
    Path("m.yaml").write_text(UNDEFINED.replace("a*x/b", "x/b*(1 + 3e-16)"))
    rows = ("sweep", "m.yaml", "--vary", "b=linspace(0.1, 3, 64)", "--jobs", "1", "--t-end", "1")
    measures = ("--measure", "min(tilt)", "--measure", "at(root, 0)")
    assert here(*rows, *measures, "-o", "s.h5") == 0
    assert here.err == ""
    found = contents("s.h5")
    assert found["min(tilt)"].tolist() == [0.0] * 64
    assert found["at(root, 0)"].tolist() == [0.0] * 64


# resuming


RESUME = ("sweep", CRANK, *GRID, *PEAK, "-o", "s.h5", *SHORT, "--resume")


def cut(path: str, records: int) -> None:
    """Cut a journal down to its first records."""
    journal = Journal(path, {}, resume=True)
    kept = list(journal.recover(6, 1))[:records]
    header = journal.header
    journal.close()
    journal = Journal(path, header)
    for results in kept:
        journal.append(results)
    journal.close()


@pytest.fixture
def journaled(here: Here, monkeypatch: pytest.MonkeyPatch) -> Here:
    """A sweep of six rows, of which the journal holds the first two."""
    from lagcli.sweeps.rows import workers

    monkeypatch.setattr(workers, "_FIRST", 2)
    monkeypatch.setattr(workers, "_MOST", 2)
    arguments = [x for x in RESUME if x != "--resume"]
    assert here(*arguments, "-o", "whole.h5") == 0
    with monkeypatch.context() as patch:
        patch.setattr(Journal, "remove", Journal.close)
        assert here(*arguments) == 0
    os.unlink("s.h5")
    cut("s.h5.journal", 1)
    return here


def test_resume_runs_what_is_missing(journaled: Here) -> None:
    here = journaled
    assert here(*RESUME, "--json") == 0
    said = json.loads(here.out)
    assert (said["done"], said["run"]) == (6, 4)
    assert_same("s.h5", "whole.h5")
    assert not Path("s.h5.journal").exists()
    assert here(*RESUME, "--json") == 0
    assert json.loads(here.out)["run"] == 0


def test_resume_begins_what_was_not_begun(here: Here) -> None:
    assert here(*RESUME) == 0
    assert Path("s.h5").exists()


def test_an_unfinished_sweep_is_not_overwritten(journaled: Here) -> None:
    here = journaled
    arguments = [x for x in RESUME if x != "--resume"]
    assert here(*arguments) == 4
    assert "--resume continues it" in here.err
    assert here(*arguments, "--force", "--json") == 0
    assert json.loads(here.out)["run"] == 6


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("--vary", "g=9,10"), "rows: 6 before, 12 now"),
        (("--measure", "max(phi)"), "measures: "),
        (("--rtol", "1e-7"), "rtol: not given before, 1e-07 now"),
        (("--set", "c=0.1"), "c: not given before, 0.1 now"),
        (("--keep", "trajectories"), "keep: measures before, trajectories now"),
    ],
)
def test_another_sweep_is_rejected(journaled: Here, change: tuple[str, ...], said: str) -> None:
    here = journaled
    before = Path("s.h5.journal").read_bytes()
    assert here(*RESUME, *change) == 2
    assert said in here.err
    assert Path("s.h5.journal").read_bytes() == before
    assert here(*RESUME) == 0
    assert here(*RESUME, *change) == 2  # the file knows as well as the journal
    assert said in here.err


def test_a_changed_model_is_rejected(journaled: Here) -> None:
    here = journaled
    changed = Path("slider_crank.yaml")
    changed.write_text(Path(CRANK).read_text() + "\n# changed\n")
    assert here("sweep", str(changed), *RESUME[2:]) == 2
    assert "the model file has changed" in here.err


def test_retry_failed_runs_the_failed_alone(here: Here) -> None:
    arguments = ("sweep", CRANK, "--vary", "m=0,1,2", *PEAK, "-o", "s.h5", "--json", *SHORT)
    assert here(*arguments) == 3
    assert here(*arguments, "--resume") == 3
    assert json.loads(here.out)["run"] == 0
    assert here(*arguments, "--resume", "--retry-failed") == 3
    said = json.loads(here.out)
    assert (said["run"], said["ok"]) == (1, 2)
    assert os.listdir() == ["s.h5"]
    assert np.isfinite(contents("s.h5")["peak"]).tolist() == [False, True, True]


def test_two_sweeps_of_one_file_are_rejected(journaled: Here) -> None:
    here = journaled
    other = Journal("s.h5.journal", {}, resume=True)
    assert here(*RESUME) == 2
    assert "another process is running this sweep" in here.err
    other.close()
    assert here(*RESUME) == 0


def test_a_full_disk_loses_nothing(journaled: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    here = journaled
    from lagcli.errors import FileError
    from lagcli.sweeps.file import store

    def full(*_: object) -> None:
        raise FileError("cannot write s.h5: the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(store, "new_file", full)
        assert here(*RESUME) == 4
    assert "all rows are kept in s.h5.journal" in here.err
    assert here(*RESUME, "--json") == 0
    assert json.loads(here.out)["run"] == 0
    assert_same("s.h5", "whole.h5")


def test_a_damaged_end_of_the_journal_is_cut_and_reported(journaled: Here) -> None:
    here = journaled
    with open("s.h5.journal", "ab") as file:
        file.write(bytes(24))
    assert here(*RESUME, "--json") == 0
    said = json.loads(here.out)
    assert (said["run"], said["done"]) == (4, 6)
    assert said["notes"] == [
        "s.h5.journal was damaged or incomplete at its end: 24 bytes cut off; 2 rows kept, 4 to run"
    ]
    assert f"note: {said['notes'][0]}" in here.err
    assert_same("s.h5", "whole.h5")


@pytest.mark.parametrize("when", ["keep", "write", "interrupted"])
def test_a_folder_that_vanishes_keeps_nothing(
    here: Here, monkeypatch: pytest.MonkeyPatch, when: str
) -> None:
    import shutil

    from lagcli.sweeps import run as module

    os.mkdir("gone")
    sweep = module._Sweep
    if when == "keep":
        before = sweep._keep
        monkeypatch.setattr(
            sweep, "_keep", lambda self, x: (shutil.rmtree("gone"), before(self, x))
        )
    elif when == "write":
        write = sweep._write
        monkeypatch.setattr(
            sweep, "_write", lambda self, x: (shutil.rmtree("gone"), write(self, x))
        )
    else:

        def interrupted(self: object, results: object) -> None:
            shutil.rmtree("gone")
            raise KeyboardInterrupt

        monkeypatch.setattr(sweep, "_keep", interrupted)
    status = here("sweep", CRANK, *GRID, *PEAK, "-o", "gone/s.h5", *SHORT)
    assert status == (130 if when == "interrupted" else 4)
    assert "removed while the sweep ran" in here.err
    assert "are kept in" not in here.err
    assert "--resume" not in here.err


# signals

LONG = (
    *("sweep", CRANK, "--vary", "m=linspace(0, 2, 500)", "--vary", "phi'=9,12", *PEAK),
    *("--measure", "final(phi)", "--t-end", "10", "--samples", "101", "--quiet", "--jobs", "2"),
)


def program(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "lagcli", *arguments]


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def start(*arguments: str, cwd: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        program(*arguments),
        cwd=cwd,
        env=environment(),
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def journal_size(tmp_path: Path) -> int:
    path = tmp_path / "k.h5.journal"
    return path.stat().st_size if path.exists() else 0


def wait_for_rows(process: subprocess.Popen[str], tmp_path: Path) -> None:
    """Wait until the journal has some rows more, or the process has ended."""
    before = max(journal_size(tmp_path), 1000)
    wait_until(lambda: process.poll() is not None or journal_size(tmp_path) > before)


#: Balls that bounce, of which an event softens the floor; rows without lanes.
BOUNCES = """
coordinates: {y: m}
parameters: {m: 2 kg, g: 9.81 m/s^2, e: 0.8, k: 10 N/m}
T: m/2*y'^2
V: m*g*y + k/2*y^2
constraints:
  floor: {expr: y >= 0, restitution: e}
events:
  soft: {when: t >= 1, set: {k: 2*k}}
initial: {y: 1, y': 0}
simulation: {t_end: 2, samples: 101}
"""
CONTACTS = (
    *("sweep", "balls.yaml", "--vary", "e=linspace(0.1, 0.9, 120)", "--quiet", "--jobs", "2"),
    *("--measure", "n=count(floor impacts)", "--measure", "j=impulse.floor"),
    *("--measure", "last=final(energy_total)", "--measure", "b=max(abs(energy_balance))"),
)


def killed_and_resumed(
    tmp_path: Path, times: int, rng: random.Random, arguments: tuple[str, ...] = LONG
) -> None:
    others = {path.name for path in tmp_path.iterdir()}
    whole = subprocess.run(program(*arguments, "-o", "whole.h5"), cwd=tmp_path, env=environment(),
                           capture_output=True, check=False)  # fmt: skip
    expected = 3 if arguments is LONG else 0
    assert whole.returncode == expected
    kills = 0
    while kills < times:
        process = start(*arguments, "-o", "k.h5", "--resume", cwd=tmp_path)
        wait_for_rows(process, tmp_path)
        time.sleep(rng.uniform(0, 0.2))
        process.kill()
        process.communicate()
        kills += 1
        if (tmp_path / "k.h5").exists():  # killed too late
            assert_same(tmp_path / "k.h5", tmp_path / "whole.h5")
            (tmp_path / "k.h5").unlink()
            (tmp_path / "k.h5.journal").unlink(missing_ok=True)
    process = start(*arguments, "-o", "k.h5", "--resume", cwd=tmp_path)
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == expected, said
    assert_same(tmp_path / "k.h5", tmp_path / "whole.h5")
    assert {x.name for x in tmp_path.iterdir()} == {"k.h5", "whole.h5", *others}


def test_killed_and_resumed_it_is_as_if_nothing_had_been(tmp_path: Path) -> None:
    killed_and_resumed(tmp_path, 1, random.Random(1))


@pytest.mark.slow
def test_killed_and_resumed_with_contacts(tmp_path: Path) -> None:
    (tmp_path / "balls.yaml").write_text(BOUNCES)
    killed_and_resumed(tmp_path, 1, random.Random(3), CONTACTS)


def test_what_contacts_do_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "balls.yaml").write_text(BOUNCES)
    monkeypatch.chdir(tmp_path)
    few = [x.replace(", 120)", ", 16)") for x in CONTACTS]
    assert run_here([*few, "--jobs", "1", "-o", "whole.h5"]) == 0
    whole = contents(tmp_path / "whole.h5")
    # what the event and impacts change is in the balance
    assert np.abs(whole["b"]).max() < 1e-8 * 24.62
    model = lagcli.load(tmp_path / "balls.yaml", set={"e": repr(float(whole["e"][7]))})
    one = lagcli.simulate(model)
    assert one.events is not None
    assert whole["n"][7] == one.events.kinds.count("impact")
    assert whole["j"][7] == one.events.total_impulse()[0]
    assert whole["last"][7] == pytest.approx(one.energy_total[-1])


@pytest.mark.slow
def test_killed_twenty_times(tmp_path: Path) -> None:
    killed_and_resumed(tmp_path, 20, random.Random(2))


def test_ctrl_c_keeps_the_rows(tmp_path: Path) -> None:
    # of so many rows that none of them has to wait for the signal
    rows = ("--vary", "m=linspace(1, 2, 100000)", *PEAK, "--t-end", "10", "--samples", "101")
    process = start("sweep", CRANK, *rows, "-o", "k.h5", "--jobs", "2", cwd=tmp_path)
    wait_for_rows(process, tmp_path)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == -signal.SIGINT, said  # which a shell calls 130
    assert "rows kept in k.h5.journal" in said
    assert "--resume continues" in said
    assert "Traceback" not in said
    assert [x.name for x in tmp_path.iterdir()] == ["k.h5.journal"]


#: Models that complete with a warning about the start or an event, beside a free body.
WARNED = {
    "force": """\
coordinates: [s, x, y]
T: (s'^2 + x'^2 + y'^2)/2
V: y
Q: {x: -0.1*lambda.guide}
constraints: {guide: y = 0, again: 2*y = 0}
initial: {s: 0, s': 0, x: 0, y: 0, x': 1, y': 0}
""",
    "condition": """\
coordinates: [s]
T: s'^2/2
initial: {s: 0, s': 1}
events: {there: {when: s >= -1}}
""",
    "action": """\
coordinates: [s, x, y]
T: (s'^2 + x'^2 + y'^2)/2
constraints: {rod: x^2 + y^2 = 25}
initial: {s: 0, s': 0, x: 5, y: 0, x': 0, y': 0}
events: {move: {when: t >= 0.5, set: {x: 3}}}
""",
    "start": """\
coordinates: [s, x, y]
T: (s'^2 + x'^2 + y'^2)/2
constraints: {floor: y = 0, bowl: y = x^2 - 1e-7*x}
initial: {s: 0, s': 0, x: 0, y: 0, x': 0, y': 0}
""",
}


@pytest.mark.parametrize("name", WARNED)
def test_strict_fails_rows_of_which_simulate_warns(here: Here, name: str) -> None:
    Path("m.yaml").write_text(WARNED[name], encoding="utf-8")
    run = lagcli.simulate(lagcli.load("m.yaml"), t_end=1.0)
    assert run.status == "completed"
    assert run.warnings
    rows = ("sweep", "m.yaml", "--vary", "s'=0.5,1", "--t-end", "1", "--measure", "final(s)")
    assert here(*rows, "--jobs", "1", "-o", "s.h5") == 0
    assert here(*rows, "--jobs", "1", "--strict", "-o", "t.h5") == 3
    messages = contents("t.h5")["message"]
    for k, speed in enumerate((0.5, 1.0)):
        run = lagcli.simulate(lagcli.load("m.yaml", set_initial={"s'": speed}), t_end=1.0)
        assert messages[k].decode() == "; ".join(run.warnings)
