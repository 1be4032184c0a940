"""The journal of a sweep: what is read back, after whatever happened to the file."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lagcli.errors import FileError, UsageError
from lagcli.sweeps.file import journal as module
from lagcli.sweeps.file.journal import Journal
from lagcli.sweeps.row_results import (
    COMPLETED,
    FAILED,
    MissingRows,
    Results,
    RowStatus,
    cause,
    runs_of,
)

HEADER = {"sweep": {"x": 1}}
ROWS = 10


def results(*numbers: int, kept: bool = False) -> Results:
    n = len(numbers)
    rows = np.array(numbers)
    return Results(
        rows,
        np.where(rows % 3 == 0, FAILED, COMPLETED).astype(np.int8),
        [f"row {x}: “no”" if x % 3 == 0 else "" for x in numbers],
        rows[:, None] * np.array([1, 2, 3]),
        rows[:, None] / np.array([3.0, np.nan]),
        rows[:, None, None] + np.arange(6.0).reshape(2, 3) if kept else np.empty((n, 0, 0)),
    )


def same(a: Results, b: Results) -> bool:
    arrays = all(
        np.array_equal(x, y, equal_nan=x.dtype.kind == "f")
        for x, y in zip(a, b, strict=True)
        if isinstance(x, np.ndarray)
    )
    return arrays and a.messages == b.messages


def written(path: Path, *all_: Results) -> None:
    journal = Journal(str(path), HEADER)
    for x in all_:
        journal.append(x)
    journal.close()


def read(path: Path) -> list[Results]:
    journal = Journal(str(path), HEADER, resume=True)
    try:
        assert journal.header == HEADER
        found = list(journal.recover(ROWS, 2))
        assert all(map(same, journal.results(ROWS, 2), found))
        return found
    finally:
        journal.close()


@pytest.mark.parametrize("kept", [False, True])
def test_what_is_written_is_read(tmp_path: Path, kept: bool) -> None:
    given = [results(0, 1, 2, kept=kept), results(7, 5, kept=kept), results(9, kept=kept)]
    written(tmp_path / "j", *given)
    found = read(tmp_path / "j")
    assert len(found) == 3
    assert all(map(same, found, given))


def test_a_journal_cut_anywhere_keeps_its_whole_records(tmp_path: Path) -> None:
    path = tmp_path / "j"
    written(path)
    ends = [path.stat().st_size]
    given = [results(0, 1), results(2), results(3, 4)]
    for i in range(3):
        written(path, *given[: i + 1])
        ends.append(path.stat().st_size)
    whole = path.read_bytes()
    for size in sorted({*range(ends[0], len(whole), 9), *ends, *(end - 1 for end in ends[1:])}):
        path.write_bytes(whole[:size])
        found = read(path)
        assert len(found) == sum(size >= end for end in ends[1:])
        assert path.stat().st_size == max(end for end in ends if end <= size)


GIVEN = [results(0, 1), results(2), results(3, 4)]


@pytest.fixture
def ends(tmp_path: Path) -> list[int]:
    """Write a journal of three records; return where its header and its records end."""
    found = []
    for i in range(len(GIVEN) + 1):
        written(tmp_path / "j", *GIVEN[:i])
        found.append((tmp_path / "j").stat().st_size)
    return found


def check_prefix(path: Path, records: int, ends: list[int]) -> None:
    """The journal holds its first records alone, and can be added to."""
    before = path.stat().st_size
    journal = Journal(str(path), HEADER, resume=True)
    found = list(journal.recover(ROWS, 2))
    assert len(found) == records
    assert all(map(same, found, GIVEN))
    assert path.stat().st_size == ends[records]
    assert journal.damage == before - ends[records]
    journal.append(results(9))
    journal.close()
    assert [x.numbers.tolist() for x in read(path)] == [
        *(x.numbers.tolist() for x in GIVEN[:records]),
        [9],
    ]


@pytest.mark.parametrize("zeros", [1, 8, 11, 12, 13, 24, 4096])
@pytest.mark.parametrize("records", [0, 1, 3])
def test_zeros_at_the_end_are_cut_off(
    tmp_path: Path, ends: list[int], zeros: int, records: int
) -> None:
    path = tmp_path / "j"
    path.write_bytes(path.read_bytes()[: ends[records]] + bytes(zeros))
    check_prefix(path, records, ends)


def test_a_changed_byte_ends_the_journal_there(tmp_path: Path, ends: list[int]) -> None:
    path = tmp_path / "j"
    whole = path.read_bytes()
    for place in range(ends[0], len(whole), 3):
        data = bytearray(whole)
        data[place] ^= 1 << place % 8
        path.write_bytes(data)
        check_prefix(path, sum(place >= end for end in ends[1:]), ends)


def test_a_record_counts_in_its_place_only(tmp_path: Path, ends: list[int]) -> None:
    path = tmp_path / "j"
    whole = path.read_bytes()
    magic = whole.index(b"\n") + 1
    header, first, second, third = (whole[a:b] for a, b in zip([magic, *ends], ends, strict=False))
    start = whole[:magic] + header
    for data, records in (
        (start + first + header + second + third, 1),
        (start + header + first, 0),
        (start + first + first + second, 1),
        (start + second + first + third, 0),
        (start + first + third, 1),
    ):
        path.write_bytes(data)
        check_prefix(path, records, ends)


@pytest.mark.parametrize(
    "damage",
    [
        lambda data, magic: b"",
        lambda data, magic: data[:5],
        lambda data, magic: data[:magic],
        lambda data, magic: data[: magic + 15],
        lambda data, magic: bytes(len(data)),
        lambda data, magic: data[:magic] + bytes(30),
        lambda data, magic: data[:magic] + bytes(4096),
    ],
)
def test_a_journal_that_ends_before_its_first_row_is_rewritten(
    tmp_path: Path, damage: Callable[[bytes, int], bytes]
) -> None:
    path = tmp_path / "j"
    written(path)
    data = path.read_bytes()
    path.write_bytes(damage(data, data.index(b"\n") + 1))
    assert read(path) == []
    assert path.read_bytes() == data


def test_a_damaged_header_before_rows_is_rejected(tmp_path: Path, ends: list[int]) -> None:
    path = tmp_path / "j"
    whole = path.read_bytes()
    for place in range(ends[0]):
        data = bytearray(whole)
        data[place] ^= 16
        path.write_bytes(data)
        with pytest.raises(
            FileError, match=r"not a journal|is damaged: its header|another version"
        ):
            Journal(str(path), HEADER, resume=True)
        assert path.read_bytes() == bytes(data)  # the rows are left for --force or an expert
    Journal(str(path), HEADER).close()
    assert read(path) == []


@pytest.mark.parametrize("header", [b"[1]", b"{}", b"nonsense", b'{"sweep": 1}', b"\xff"])
def test_a_header_of_something_else_is_rejected(
    tmp_path: Path, header: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "j"
    with monkeypatch.context() as patch:
        patch.setattr(module.Journal, "_add", _adding(header))
        Journal(str(path), HEADER).close()
    with pytest.raises(FileError, match="is damaged: its header"):
        Journal(str(path), HEADER, resume=True)


def _adding(header: bytes) -> Callable[[Journal, bytes], None]:
    add = module.Journal._add
    return lambda self, record: add(self, header)


def test_rows_that_the_sweep_does_not_have_are_cut_off(tmp_path: Path, ends: list[int]) -> None:
    journal = Journal(str(tmp_path / "j"), HEADER, resume=True)
    assert len(list(journal.recover(3, 2))) == 2
    assert journal.damage == ends[3] - ends[2]
    assert list(journal.recover(3, 1)) == []
    journal.close()


def test_damage_while_the_sweep_runs_is_no_result(tmp_path: Path, ends: list[int]) -> None:
    path = tmp_path / "j"
    journal = Journal(str(path), HEADER, resume=True)
    list(journal.recover(ROWS, 2))
    with path.open("r+b") as file:
        file.truncate(ends[2] + 5)
    with pytest.raises(FileError, match="damaged while the sweep ran"):
        list(journal.results(ROWS, 2))
    journal.close()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a system without pipes that have names")
def test_a_pipe_is_no_journal(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "j")
    for resume in (False, True):
        with pytest.raises(FileError, match="not a regular file"):
            Journal(str(tmp_path / "j"), HEADER, resume)


def test_one_writer_at_a_time(tmp_path: Path) -> None:
    first = Journal(str(tmp_path / "j"), HEADER)
    with pytest.raises(UsageError, match="another process is running this sweep"):
        Journal(str(tmp_path / "j"), HEADER)
    with pytest.raises(UsageError, match="another process"):
        Journal(str(tmp_path / "j"), HEADER, resume=True)
    first.remove()
    Journal(str(tmp_path / "j"), HEADER).close()


@pytest.mark.parametrize("first", ["close", "remove"])
def test_a_journal_is_closed_once(tmp_path: Path, first: str) -> None:
    """An interrupt after the end of a sweep closes its journal again."""
    journal = Journal(str(tmp_path / "s.h5.journal"), {"sweep": {}})
    getattr(journal, first)()
    other = os.open(tmp_path, os.O_RDONLY)  # may have the number of the closed file
    journal.close()
    os.close(other)


def test_other_files_are_no_journals(tmp_path: Path) -> None:
    (tmp_path / "j").write_text("something else, and long enough to be looked at")
    with pytest.raises(FileError, match="not a journal"):
        Journal(str(tmp_path / "j"), HEADER, resume=True)


def test_a_full_disk_leaves_the_journal_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "j"
    journal = Journal(str(path), HEADER)
    journal.append(results(0, 1))
    before = path.stat().st_size

    def full(file: int, data: memoryview, place: int) -> int:
        os.pwrite(file, b"half a rec", place)
        raise OSError(28, "No space left on device")

    class Os:
        def __getattr__(self, name: str) -> object:
            return full if name == "pwrite" else getattr(os, name)

    monkeypatch.setattr(module, "os", Os())
    with pytest.raises(FileError, match="disk is full"):
        journal.append(results(2))
    monkeypatch.undo()
    assert path.stat().st_size == before
    journal.append(results(3))
    journal.close()
    assert [x.numbers.tolist() for x in read(path)] == [[0, 1], [3]]


def test_ledger_counts_rows_and_causes() -> None:
    row_status = RowStatus(10)
    row_status.enter(results(0, 1, 2, 3, 6))
    assert row_status.done == 5
    assert row_status.statuses() == {"completed": 2, "failed": 3, "missing": 5}
    assert row_status.failures() == {"row …: “no”": 3}
    row_status.enter(results(4, 5, 9))
    row_status.forget_failures()
    assert row_status.statuses() == {"completed": 4, "missing": 6}
    assert row_status.failures() == {}


def test_the_missing_are_handed_out_once() -> None:
    row_status = RowStatus(200_000)
    done = np.random.default_rng(1).permutation(200_000)[:150_000]
    row_status.status[done] = COMPLETED
    missing = MissingRows(row_status)
    assert missing.left == 50_000
    parts = []
    while len(part := missing.take(777)):
        parts.append(part)
    assert [len(p) for p in parts[:-1]] == [777] * (len(parts) - 1)
    assert sorted([*np.concatenate(parts), *done]) == list(range(200_000))
    assert missing.left == 0


def test_runs_without_gaps() -> None:
    numbers = np.array([3, 4, 5, 9, 11, 12])
    found = [(numbers[a].tolist(), (b.start, b.stop)) for a, b in runs_of(numbers)]
    assert found == [([3, 4, 5], (3, 6)), ([9], (9, 10)), ([11, 12], (11, 13))]


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ("stopped after 30 steps at t = 0.1234 s; --max-steps allows more", None),
        ("stopped after 7 steps at t = 1e-05 s; more", "stopped after … steps at t = … s"),
        ("a/model.yaml:3:5: error[x-y]: `x1` is -2.5\n  3 | x\n", "error[x-y]: `x1` is …"),
    ],
)
def test_causes_have_no_numbers(message: str, expected: str | None) -> None:
    assert cause(message) == (expected or "stopped after … steps at t = … s")
