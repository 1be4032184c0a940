"""The log of contacts and events in result files: every format, and what is wrong with a table."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from trajectories import assert_same, assert_same_logs, make, make_log, make_with_log

from lagcli.cli.app import run as lagcli
from lagcli.errors import FileError
from lagcli.results import info, read, write
from lagcli.results.csv.names import events_path
from lagcli.results.hdf5.seal import LENGTH, seal


@pytest.mark.parametrize("name", ["run.h5", "run.csv"])
def test_round_trip(tmp_path: Path, name: str) -> None:
    run = make_with_log()
    write(run, tmp_path / name, meta=True)
    found = read(tmp_path / name)
    assert_same_logs(run.events, found.events)
    assert_same(dataclasses.replace(run, events=None), dataclasses.replace(found, events=None))


@pytest.mark.parametrize("name", ["run.h5", "run.csv"])
@pytest.mark.parametrize("entries", [(), ((0.5, 'a, "b"', "event"),)])
def test_logs_of_any_size(
    tmp_path: Path, name: str, entries: tuple[tuple[float, str, str]]
) -> None:
    run = dataclasses.replace(make_with_log(nt=0), events=make_log(entries=entries))
    write(run, tmp_path / name)
    assert_same_logs(run.events, read(tmp_path / name).events)


@pytest.mark.parametrize("name", ["run.h5", "run.csv"])
def test_runs_without_contacts_have_none(tmp_path: Path, name: str) -> None:
    write(make_with_log(), tmp_path / name)
    write(make(), tmp_path / name, force=True)
    assert read(tmp_path / name).events is None
    assert not (tmp_path / "run.events.csv").exists()


def test_an_old_table_stands_in_the_way(tmp_path: Path) -> None:
    write(make_with_log(), tmp_path / "run.csv")
    (tmp_path / "run.csv").unlink()
    with pytest.raises(FileError, match=r"run\.events\.csv"):
        write(make(), tmp_path / "run.csv")


def test_hdf5_for_other_programs(tmp_path: Path) -> None:
    """The modes at each sample are in the file, along the time and the names of the rows."""
    run = make_with_log()
    write(run, tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5") as root:
        modes = root["events/mode"]
        assert modes[()].tolist() == run.modes.tolist()
        assert modes.dims[0][0].name == "/time"
        assert modes.dims[1][0].asstr()[()].tolist() == ["floor", "floor.slip"]
        assert root["events/impulse"].dims[0][0].name == "/events/impulse_entry"
        assert root["events/change"].dims[0][0].name == "/events/change_entry"
        assert root["events/loss"].attrs["units"] == b"J"


@pytest.mark.parametrize(
    ("dataset", "change"),
    [
        ("time", lambda x: x[::-1]),
        ("time", lambda x: x[:-1]),
        ("change", lambda x: x + 9),
        ("change", lambda x: x[1:]),
        ("change_row", lambda x: x + 9),
        ("change_entry", lambda x: x[::-1]),
        ("impulse_entry", lambda x: x + 99),
        ("impulse_constraint", lambda x: x - 9),
        ("impulse_constraint", lambda x: x[1:]),
        ("mode_at_start", lambda x: x[:1]),
        ("kind", lambda x: np.array([b"crash"] * len(x))),
        ("name", lambda x: x[:2]),
        ("impulse", lambda x: x[:-1]),
        ("column", lambda x: x[:1]),
        ("recorded_entry", lambda x: x + 9),
        ("recorded_before", lambda x: x[:, :1]),
        ("row", lambda x: x.astype(float) if x.dtype.kind != "S" else np.zeros(len(x))),
    ],
)
def test_a_group_without_sense_is_damage(tmp_path: Path, dataset: str, change: object) -> None:
    path = tmp_path / "run.h5"
    write(make_with_log(), path)
    data = path.read_bytes()[:-LENGTH]
    path.write_bytes(data)
    with h5py.File(path, "r+") as root:
        values = root["events"][dataset][()]
        del root["events"][dataset]
        root["events"][dataset] = change(values)  # type: ignore[operator]
    with path.open("r+b") as file:
        seal(file)
    with pytest.raises(FileError, match="damaged"):
        read(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("impulses", "impulse.rod", "its columns are not those of this model"),
        ("guide=", "rod=", "'rod' is not a name of this model"),
        ("guide=", "guide", "is not a name and a value"),
        ("guide=", "guide=x", "could not convert"),
        ("floor=open; floor.slip=open", "floor=open; floor=open", "'floor.slip' is not a name"),
        (",start,", ",begin,", "no modes at the start"),
        (",impact,", ",crash,", "crash"),
        ("recorded.y_dot.after", "recorded.x_dot.after", "its columns are not those of this model"),
        ("open", "ajar", "'ajar' is not a mode"),
        ("0.25,floor,rest,", "0.25,floor,rest,x", "could not convert"),
        ("0.25,floor,rest,", "0.25,floor,rest,,,", "line 6 has"),
    ],
)
def test_a_table_that_was_changed(tmp_path: Path, old: str, new: str, message: str) -> None:
    write(make_with_log(), tmp_path / "run.csv")
    table = tmp_path / "run.events.csv"
    text = table.read_text()
    assert old in text
    table.write_text(text.replace(old, new))
    with pytest.raises(FileError, match=message):
        read(tmp_path / "run.csv")


def test_a_table_of_another_run(tmp_path: Path) -> None:
    """With a sidecar, the event table must be the one that was written with it."""
    write(make_with_log(), tmp_path / "run.csv", meta=True)
    table = tmp_path / "run.events.csv"
    kept = table.read_text()
    table.write_text(kept.replace("impact", "closes"))
    with pytest.raises(FileError, match="of another run"):
        read(tmp_path / "run.csv")
    table.unlink()
    with pytest.raises(FileError, match="missing"):
        read(tmp_path / "run.csv")
    table.write_text(kept)
    assert read(tmp_path / "run.csv").events is not None
    write(make(), tmp_path / "other.csv", meta=True)
    shutil.copy(table, tmp_path / "other.events.csv")
    with pytest.raises(FileError, match="not the event table"):
        read(tmp_path / "other.csv")


def test_name_of_the_table() -> None:
    assert events_path("a/run.csv") == "a/run.events.csv"
    assert events_path("run.v2.csv") == "run.v2.events.csv"


@pytest.mark.parametrize("name", ["run.h5", "run.csv"])
def test_info(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    run = make_with_log()
    write(run, tmp_path / name)
    found = info.describe(tmp_path / name)
    assert run.events is not None
    assert found["events"] == run.events.to_mapping()
    assert lagcli(["info", str(tmp_path / name)]) == 0
    out = capsys.readouterr().out
    assert "events              floor: impact 2, rest 1; floor.slip: impact 1, slips 1" in out
    assert "note: `floor` came to rest at t = 0.25 s after 2 impacts" in out
    write(make(), tmp_path / name, force=True)
    assert info.describe(tmp_path / name)["events"] is None
