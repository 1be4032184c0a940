"""CSV files hold a run bit for bit, for readers from awk to pandas."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_cases import FUZZ_COUNT
from trajectories import (
    assert_same,
    assert_same_arrays,
    environment,
    make,
    make_for_csv,
    random_trajectories,
)

from lagcli.columns import RESIDUALS, SAMPLED, SCALARS, column_names
from lagcli.errors import FileError, UsageError
from lagcli.results import read, write
from lagcli.results.csv import reader
from lagcli.results.formats import open_reader
from lagcli.results.info import describe
from lagcli.trajectory.trajectory import Trajectory

SCALARS_AND_RESIDUALS = ",".join(
    str(name)
    for quantity in SAMPLED
    if quantity in (*SCALARS, *RESIDUALS)
    for name in column_names(quantity, (), ("guide", "pin"))
)
HEADER = (
    "t,phi,psi,phi_dot,psi_dot,phi_ddot,psi_ddot,lambda.guide,lambda.pin,Qc.phi,Qc.psi,"
    f"Qc.guide.phi,Qc.guide.psi,Qc.pin.phi,Qc.pin.psi,{SCALARS_AND_RESIDUALS},conserved.p_phi,"
    "rod_force,a_first"
)


def _written(folder: Path, trajectory: Trajectory, meta: bool = False) -> Path:
    write(trajectory, folder / "run.csv", meta=meta)
    return folder / "run.csv"


def _store(path: Path, rows: list[list[str]]) -> None:
    with path.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def test_columns_and_numbers(tmp_path: Path) -> None:
    run = make(3, constraints=("guide", "pin"), time=np.array([0.0, 0.1, np.nan]))
    lines = _written(tmp_path, run).read_bytes().decode().split("\n")
    assert lines[0] == HEADER
    assert len(lines) == 5
    assert lines[4] == ""
    assert [line.split(",")[0] for line in lines[1:4]] == ["0", "0.10000000000000001", "nan"]

    row = dict(zip(HEADER.split(","), map(float, lines[2].split(",")), strict=True))
    assert row["psi"] == run.q[1, 1]
    assert row["phi_dot"] == run.v[1, 0]
    assert row["psi_ddot"] == run.a[1, 1]
    assert row["lambda.pin"] == run.multipliers[1, 1]
    assert row["Qc.psi"] == run.constraint_force[1, 1]
    assert row["Qc.guide.psi"] == run.constraint_force_of("guide")[1, 1]
    assert row["Qc.pin.phi"] == run.constraint_force_of("pin")[1, 0]
    assert row["residual_velocity.pin"] == run.residual_velocity[1, 1]
    assert row["a_first"] == run.outputs["a_first"][1]


@pytest.mark.parametrize("meta", [False, True])
@pytest.mark.parametrize(
    "size",
    [
        {},
        {"constraints": ()},
        {"nt": 1},
        {"nt": 0},
        {"outputs": ()},
        {"coordinates": (), "constraints": ("c",)},
        {"coordinates": (), "constraints": (), "outputs": ()},
        {"nt": 7_000, "coordinates": ("x",), "constraints": ()},  # several blocks
    ],
)
def test_a_run_comes_back(tmp_path: Path, size: dict[str, Any], meta: bool) -> None:
    run = make(**size) if meta else make_for_csv(**size)
    back = read(_written(tmp_path, run, meta))
    assert_same_arrays(run, back)
    if meta:
        assert_same(run, back)


_RANDOM_RUN = random_trajectories(st.floats(allow_nan=False) | st.just(np.nan))  # one NaN in CSV


def check_round_trip(run: Trajectory) -> None:
    with tempfile.TemporaryDirectory() as folder:
        assert_same(run, read(_written(Path(folder), run, meta=True)))


@settings(deadline=None, max_examples=20)
@given(run=_RANDOM_RUN)
def test_any_run_comes_back(run: Trajectory) -> None:
    check_round_trip(run)


@pytest.mark.fuzz
@settings(deadline=None, max_examples=FUZZ_COUNT)
@given(run=_RANDOM_RUN)
def test_many_random_runs_come_back(run: Trajectory) -> None:
    check_round_trip(run)


def test_without_a_sidecar_the_rest_is_empty(tmp_path: Path) -> None:
    back = read(_written(tmp_path, make()))
    assert (back.status, back.message, back.model, back.lagcli_version) == ("", "", "", "")
    assert (back.units, back.parameters, back.options, back.initial_correction) == ({}, {}, {}, {})
    assert np.isnan(back.scale_position).all()
    assert back.scale_velocity.shape == (1,)


def test_names_are_quoted_where_needed(tmp_path: Path) -> None:
    run = make_for_csv(coordinates=("A[1,2]", "φ"), outputs=('say "x"',))
    path = _written(tmp_path, run)
    header = path.read_text(encoding="utf-8").split("\n")[0]
    assert header.startswith('t,"A[1,2]",φ,"A[1,2]_dot",φ_dot,')
    assert header.endswith(',"say ""x"""')
    assert_same_arrays(run, read(path))


def test_pandas_reads_the_same(tmp_path: Path) -> None:
    run = make(200, coordinates=("A[1,2]", "φ"))
    table = pd.read_csv(_written(tmp_path, run))
    # before version 3, pandas errs in the last four digits by default
    np.testing.assert_allclose(table["t"], run.time, rtol=1e-12)
    np.testing.assert_allclose(table["A[1,2]_ddot"], run.a[:, 0], rtol=1e-12)
    np.testing.assert_allclose(table["lambda.guide"], run.multipliers[:, 0], rtol=1e-12)


def test_line_ends_and_a_mark_of_a_spreadsheet_are_no_obstacle(tmp_path: Path) -> None:
    run = make_for_csv()
    path = _written(tmp_path, run)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert_same_arrays(run, read(path))


def test_the_sidecar_is_strict_json_with_everything_else(tmp_path: Path) -> None:
    run = make(scale_position=np.array([np.nan]), parameters={"m": np.inf, "φ": 0.5})
    path = _written(tmp_path, run, meta=True)
    text = Path(f"{path}.json").read_text(encoding="utf-8")

    def reject(constant: str) -> None:
        pytest.fail(f"{constant} is not JSON")

    about = json.loads(text, parse_constant=reject)
    assert about["status"] == "completed"
    assert about["model"] == run.model
    assert about["parameters"] == {"m": "inf", "φ": 0.5}
    assert about["scale_position"] == [None]
    assert about["scale_velocity"] == list(run.scale_velocity)
    assert (about["samples"], about["coordinates"]) == (5, ["phi", "psi"])
    assert {"sign_convention", "schema_version", "units", "seconds", "counts"} <= set(about)
    assert_same(run, read(path))


def test_an_old_sidecar_stands_in_the_way(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    (tmp_path / "run.csv.json").write_text("mine")
    for meta in (False, True):
        with pytest.raises(FileError, match=r"run\.csv\.json exists already"):
            write(make(), path, meta=meta)
    assert os.listdir(tmp_path) == ["run.csv.json"]
    assert (tmp_path / "run.csv.json").read_text() == "mine"


def test_force_replaces_the_sidecar_or_removes_it(tmp_path: Path) -> None:
    path = _written(tmp_path, make(), meta=True)
    run = make(7, seed=1)
    write(run, path, force=True, meta=True)
    assert_same(run, read(path))
    write(run, path, force=True)
    assert os.listdir(tmp_path) == ["run.csv"]
    assert read(path).status == ""


def test_a_sidecar_of_another_run_is_noticed(tmp_path: Path) -> None:
    path = _written(tmp_path, make(), meta=True)
    path.write_bytes(path.read_bytes().replace(b"1", b"2"))
    with pytest.raises(FileError, match=r"run\.csv\.json is of another run.* remove"):
        read(path)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "empty"),
        ("{", "not JSON"),
        ("[]", "not the sidecar"),
        ('{"kind": "sweep"}', "not the sidecar"),
        ('{"kind": "trajectory", "schema_version": "99"}', "version 99"),
    ],
)
def test_a_sidecar_that_is_none_is_reported(tmp_path: Path, text: str, reason: str) -> None:
    path = _written(tmp_path, make())
    Path(f"{path}.json").write_text(text)
    with pytest.raises(FileError, match=reason) as caught:
        read(path)
    assert "run.csv.json" in str(caught.value)


def test_a_damaged_sidecar_is_reported(tmp_path: Path) -> None:
    path = _written(tmp_path, make(), meta=True)
    sidecar = Path(f"{path}.json")
    for name, value in (("parameters", [1]), ("scale_position", None), ("seconds", {"a": "b"})):
        about = json.loads(sidecar.read_text(encoding="utf-8"))
        sidecar.write_text(json.dumps({**about, name: value}))
        with pytest.raises(FileError, match="damaged"):
            read(path)
        sidecar.write_text(json.dumps(about))


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "it is empty"),
        (b"\n", "not of lagcli"),
        (b"a,b\n1,2\n", "not of lagcli"),
        (b"t,x,y\n1,2,3\n", "not of lagcli"),
        (HEADER.encode(), "within a line"),
        (HEADER.replace("psi_dot", "psi_dt").encode() + b"\n", "not of lagcli"),
        (bytes(range(128, 256)) + b"\n", "not CSV text"),
        (b'"t' * 50_000 + b"\n", "not CSV text"),
    ],
)
def test_what_is_no_run_is_reported(tmp_path: Path, content: bytes, reason: str) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes(content)
    with pytest.raises(FileError, match=reason) as caught:
        read(path)
    assert str(path) in str(caught.value)


def test_a_missing_file_and_a_folder_are_reported(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no such file"):
        read(tmp_path / "run.csv")
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(FileError, match="it is a folder"):
        read(tmp_path / "folder.csv")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda rows: rows[3].pop(), "line 4 has {less} values for {all} columns"),
        (lambda rows: rows[3].append("1"), "line 4 has {more} values for {all} columns"),
        (lambda rows: rows[2].__setitem__(3, ""), "line 3, column phi_dot: '' is not a number"),
        (lambda rows: rows[2].__setitem__(3, "1,5"), "line 3, column phi_dot: '1,5' is not"),
        (lambda rows: rows[2].__setitem__(3, "one"), "line 3, column phi_dot: 'one' is not"),
        (
            lambda rows: [row.pop() for row in rows[1:]],
            "line 2 has {less} values for {all} columns",
        ),
    ],
)
def test_a_line_that_is_no_sample_is_named(tmp_path: Path, change: Any, reason: str) -> None:
    path = _written(tmp_path, make())
    rows = list(csv.reader(io.StringIO(path.read_text())))
    change(rows)
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    width = len(path.read_text().partition("\n")[0].split(","))
    said = reason.format(less=width - 1, all=width, more=width + 1)
    with pytest.raises(FileError, match=said):
        read(path)


def test_a_cut_within_a_line_is_noticed(tmp_path: Path) -> None:
    path = _written(tmp_path, make())
    whole = path.read_bytes()
    for size in range(0, len(whole), 29):
        if whole[size - 1 : size] != b"\n":
            path.write_bytes(whole[:size])
            with pytest.raises(FileError):
                read(path)


@pytest.mark.parametrize("nt", [5, 300])
def test_a_line_that_occurs_twice_is_noticed(
    tmp_path: Path, nt: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = _written(tmp_path, make(nt))
    header, *lines = path.read_text().splitlines(keepends=True)
    for place in (0, nt // 2, nt - 1):
        path.write_text("".join([header, *lines[: place + 1], *lines[place:]]))
        with pytest.raises(FileError, match="there are two samples at t = "):
            read(path)
    monkeypatch.setattr(reader, "_NUMBERS_READ", 3)
    with open_reader(path) as file, pytest.raises(FileError, match="there are two samples at"):
        list(file.columns(["time"]))


def test_changed_and_exchanged_forces_are_noticed(tmp_path: Path) -> None:
    path = _written(tmp_path, make(constraints=("rod", "guide")))
    rows = list(csv.reader(io.StringIO(path.read_text())))
    places = [i for i, title in enumerate(rows[0]) if title.startswith("Qc.")]
    for place in places:
        changed = [list(row) for row in rows]
        changed[3][place] = repr(float(changed[3][place]) + 1)
        _store(path, changed)
        with pytest.raises(FileError, match=r"Qc\.\w+ of sample 2 is not the sum"):
            read(path)
    exchanged = [list(row) for row in rows]
    for row in exchanged[1:]:
        row[places[0]], row[places[1]] = row[places[1]], row[places[0]]
    _store(path, exchanged)
    with pytest.raises(FileError, match="columns were exchanged"):
        read(path)
    _store(path, [rows[0], *([f"{float(x):.6g}" for x in row] for row in rows[1:])])
    assert len(read(path).time) == 5  # rounded by a spreadsheet


def test_missing_lines_are_a_warning_without_a_sidecar(tmp_path: Path) -> None:
    run = make(50, time=np.linspace(0.0, 4.9, 50))
    path = _written(tmp_path, run)
    assert read(path).warnings == ()
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:21] + lines[22:]))
    said = "samples may be missing between t = 1.9 and 2.1 s: others are 0.1 s apart"
    assert read(path).warnings == (said,)
    assert describe(path)["warnings"] == [said]
    own = make(49, time=np.delete(run.time, 20))
    write(own, path, force=True, meta=True)
    assert read(path).warnings == own.warnings


def test_blank_lines_are_no_samples(tmp_path: Path) -> None:
    path = _written(tmp_path, make())
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n\r\n"))
    with open_reader(path) as file:
        assert file.count() == 5
    assert len(read(path).time) == 5


def test_standard_output(tmp_path: Path) -> None:
    script = """
from trajectories import make
from lagcli.results import write
print("before")  # it waits in the buffer, and must come first
write(make(), "-")
print("after")
"""
    done = subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, env=environment()
    )
    table = _written(tmp_path, make()).read_bytes()
    assert done.stdout == b"before\n" + table + b"after\n"


def test_a_standard_output_that_takes_little_at_a_time(
    tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    write_all = os.write
    monkeypatch.setattr(os, "write", lambda fd, data: write_all(fd, data[:1000]))
    write(make(), "-")
    assert capfdbinary.readouterr().out == _written(tmp_path, make()).read_bytes()


def test_standard_output_in_memory(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = make(coordinates=("φ", "psi"))
    write(run, "-")
    assert capsys.readouterr().out.encode() == _written(tmp_path, run).read_bytes()
    monkeypatch.setattr(sys, "stdout", None)
    with pytest.raises(FileError, match="closed"):
        write(run, "-")


def test_standard_output_has_no_sidecar() -> None:
    with pytest.raises(UsageError, match="no sidecar"):
        write(make(), "-", meta=True)


TO_STDOUT = """
import sys
from trajectories import make
from lagcli.errors import FileError
from lagcli.results import write
try:
    write(make(20_000), "-")
except FileError as error:
    print(error, file=sys.stderr)
    sys.exit(error.exit_status)
except BrokenPipeError:
    sys.exit(141)
"""


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
def test_a_full_standard_output_is_an_error() -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-c", TO_STDOUT],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(),
        )
    assert done.returncode == 4  # and not 120, which Python gives when its own flush fails
    assert done.stderr.startswith("cannot write standard output: the disk is full")
    assert done.stderr.count("\n") == 1


def test_a_closed_pipe_is_left_to_the_caller() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run([sys.executable, "-c", TO_STDOUT], stdout=writer, env=environment())
    os.close(writer)
    assert done.returncode == 141


def test_csv_needs_neither_h5py_nor_pandas(tmp_path: Path) -> None:
    script = """
import sys
sys.modules.update({"h5py": None, "pandas": None})  # importing either is an error now
from trajectories import make
from lagcli.results import write
from lagcli.results.info import describe
write(make(), sys.argv[1])
describe(sys.argv[1])
"""
    subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "run.csv")], check=True, env=environment()
    )
