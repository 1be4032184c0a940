"""The journal of a sweep: results of its rows, stored during the sweep.

An append-only file of records. Each record has its length and a checksum over all records up to it,
so that it is valid only at its position. A killed process leaves complete records and at most a
partial one; a power failure may leave zeros. The next reader truncates the file after the last
complete record.
"""

from __future__ import annotations

import json
import operator
import os
import stat
import struct
import time
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from lagcli.errors import FileError, UsageError
from lagcli.files import read_failure, write_failure
from lagcli.results.atomic import sync_folder
from lagcli.sweeps.row_results import MISSING, Results

try:
    import fcntl
except ImportError:  # without POSIX locks, a second process cannot be excluded
    fcntl = None  # type: ignore[assignment]

_NAME = b"lagcli sweep journal "
_MAGIC = _NAME + b"2\n"
_HEAD = struct.Struct("<QI")  # bytes of the record; CRC-32 of all lengths and records so far
_LENGTH = struct.Struct("<Q")
_SYNC = 1.0  # s between two syncs: the largest loss at a power failure


def journal_of(output: str) -> str:
    """Return the name of the journal of a result file."""
    return f"{output}.journal"


class Mark(NamedTuple):
    """The end of a record: its position in the file, and the checksum up to there."""

    place: int
    checksum: int


class Journal:
    """An open journal, locked against other processes.

    Parameters
    ----------
    path : str
    header : mapping
        Description of the sweep, as JSON values.
    resume : bool
        Continue an existing journal. One that ends before its first row (an empty file, a truncated
        header, zeros) is rewritten; otherwise the file is emptied first.

    Attributes
    ----------
    header : dict
        Description with which the journal was created.
    damage : int
        Number of bytes that `recover` truncated.

    Raises
    ------
    FileError
        The file cannot be read or written, is not a journal, or its beginning is damaged.
    UsageError
        Another process has it open.
    """

    def __init__(self, path: str, header: Mapping[str, Any], resume: bool = False):
        self.path = path
        self.damage = 0
        self._synced = time.monotonic()
        self._file = self._open()
        try:
            if resume and self._holds_rows(header):
                self.header = self._read_header()
            else:
                self.header = dict(header)
                self._begin()
            self._start = self._end
        except BaseException:
            os.close(self._file)
            raise

    def _open(self) -> int:
        while True:
            try:
                file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
            except OSError as error:
                raise write_failure(self.path, error) from error
            try:
                if not stat.S_ISREG(os.fstat(file).st_mode):
                    os.close(file)
                    raise FileError(f"cannot write {self.path}: it is not a regular file")
                if fcntl is not None:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                with suppress(FileNotFoundError):
                    if os.path.samestat(os.fstat(file), os.stat(self.path)):
                        return file
            except BlockingIOError:
                os.close(file)
                raise UsageError(
                    f"another process is running this sweep: it holds {self.path}; wait for it, or"
                    " write to another file"
                ) from None
            os.close(file)  # completed and removed by its owner in the meantime

    def close(self) -> None:
        """Sync and close the file without removing it."""
        with suppress(OSError, ValueError):  # the latter once it is closed
            os.fsync(self._file)
        self._release()

    def remove(self) -> None:
        """Remove the file, once its contents are in the result file."""
        with suppress(FileNotFoundError):
            os.unlink(self.path)
        self._release()

    def _release(self) -> None:
        """Close the file, unless an interrupt comes after that."""
        file, self._file = self._file, -1
        if file >= 0:
            os.close(file)

    @property
    def lost(self) -> bool:
        """Whether the name no longer refers to this file: it was removed or replaced."""
        try:
            return not os.path.samestat(os.fstat(self._file), os.stat(self.path))
        except OSError:
            return True

    # the beginning

    def _begin(self) -> None:
        self._end = Mark(0, 0)
        self._write(_MAGIC)
        self._end = Mark(len(_MAGIC), 0)
        self._add(json.dumps(self.header).encode())
        self._sync()
        sync_folder(os.path.dirname(self.path) or ".")

    def _holds_rows(self, header: Mapping[str, Any]) -> bool:
        """Return whether rows may follow the header; raise an error if the file is something else.

        A power failure during the first writes leaves a partial header, or zeros.
        """
        head = self._read(0, len(_MAGIC))
        if not head.startswith(_NAME) and not _NAME.startswith(head.rstrip(b"\0")):
            raise FileError(f"{self.path} is not a journal of a sweep; remove it, or give --force")
        if self._record(Mark(len(_MAGIC), 0)) is not None:
            return True
        first_row = len(_MAGIC) + _HEAD.size + len(json.dumps(header).encode())
        return bool(self._read(first_row, self._size() - first_row).strip(b"\0"))

    def _read_header(self) -> dict[str, Any]:
        magic = self._read(0, len(_MAGIC))
        if magic != _MAGIC and magic[len(_NAME) :].strip().isdigit():
            raise FileError(
                f"{self.path} was written by another version of lagcli; finish the sweep with that"
                " version, or give --force to start again"
            )
        first = self._record(Mark(len(_MAGIC), 0)) if magic == _MAGIC else None
        if first is not None:
            self._end, record = first
            with suppress(ValueError):
                header = json.loads(record)
                if isinstance(header, dict) and isinstance(header.get("sweep"), dict):
                    return header
        raise FileError(
            f"{self.path} is damaged: its header, which identifies the sweep, cannot be read;"
            " give --force to start again"
        )

    # records

    def append(self, results: Results) -> None:
        """Append the results of some rows; later results of a row replace earlier ones.

        Raises
        ------
        FileError
            The disk is full, or the write fails; the journal is unchanged.
        """
        self._add(encode(results))

    def recover(self, rows: int, measures: int) -> Iterator[Results]:
        """Yield all results in the order of writing; truncate a damaged end.

        Parameters
        ----------
        rows, measures : int
            Those of the sweep; a record with other sizes counts as damaged.
        """
        self._end = self._start
        while (entry := self._record(self._end)) is not None:
            try:
                results = decode(entry[1], rows, measures)
            except ValueError:
                break
            self._end = entry[0]
            yield results
        self.damage = self._size() - self._end.place
        if self.damage:
            try:
                os.ftruncate(self._file, self._end.place)
            except OSError as error:
                raise write_failure(self.path, error) from error

    def results(self, rows: int, measures: int) -> Iterator[Results]:
        """Yield all results that were recovered or appended.

        Raises
        ------
        FileError
            The file no longer contains them.
        """
        mark = self._start
        while mark.place < self._end.place:
            entry = self._record(mark)
            if entry is None:
                raise FileError(
                    f"cannot read {self.path}: it was damaged while the sweep ran; the same"
                    " command with --resume runs the rows again that are lost"
                )
            mark, record = entry
            yield decode(record, rows, measures)

    def _record(self, before: Mark) -> tuple[Mark, bytes] | None:
        """Return the record after a mark, and its end; None if there is no valid one."""
        head = self._read(before.place, _HEAD.size)
        if len(head) < _HEAD.size:
            return None
        size, checksum = _HEAD.unpack(head)
        if not 0 < size <= self._size() - before.place - _HEAD.size:
            return None
        record = self._read(before.place + _HEAD.size, size)
        end = _following(before, record)
        return (end, record) if end.checksum == checksum else None

    def _add(self, record: bytes) -> None:
        end = _following(self._end, record)
        self._write(_HEAD.pack(len(record), end.checksum) + record)
        self._end = end

    def _size(self) -> int:
        return os.fstat(self._file).st_size

    def _read(self, place: int, size: int) -> bytes:
        parts = []
        try:
            while size > 0 and (part := os.pread(self._file, min(size, 1 << 24), place)):
                parts.append(part)
                size, place = size - len(part), place + len(part)
        except OSError as error:
            raise read_failure(self.path, error) from error
        return b"".join(parts)

    def _write(self, data: bytes) -> None:
        """Write at the end; if that fails, restore the file."""
        place, view = self._end.place, memoryview(data)
        try:
            os.ftruncate(self._file, place)
            while view:
                written = os.pwrite(self._file, view, place)
                place, view = place + written, view[written:]
            if time.monotonic() - self._synced > _SYNC:
                os.fsync(self._file)
                self._synced = time.monotonic()
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._file, self._end.place)
            raise write_failure(self.path, error) from error

    def _sync(self) -> None:
        try:
            os.fsync(self._file)
        except OSError as error:
            raise write_failure(self.path, error) from error


def _following(before: Mark, record: bytes) -> Mark:
    """Return the end of a record after a mark."""
    checksum = zlib.crc32(record, zlib.crc32(_LENGTH.pack(len(record)), before.checksum))
    return Mark(before.place + _HEAD.size + len(record), checksum)


def check_no_journal(output: str) -> None:
    """Raise an error if a result file has the journal of an unfinished sweep.

    Raises
    ------
    FileError
    """
    path = journal_of(output)
    try:
        os.stat(path)
    except FileNotFoundError:
        return
    except OSError as error:
        raise read_failure(path, error) from error
    raise FileError(
        f"{path} exists: this sweep was not finished; --resume continues it, --force starts again"
    )


def encode(results: Results) -> bytes:
    """Return results as bytes: sizes and messages as JSON, then the arrays."""
    n, nt, columns = results.kept.shape
    said = {str(i): text for i, text in enumerate(results.messages) if text}
    sizes = [n, results.measures.shape[1], nt, columns]
    head = json.dumps({"sizes": sizes, "messages": said}).encode()
    arrays = [
        np.ascontiguousarray(results.numbers, "<i8"),
        np.ascontiguousarray(results.status, "<i1"),
        np.ascontiguousarray(results.counts, "<i8"),
        np.ascontiguousarray(results.measures, "<f8"),
        np.ascontiguousarray(results.kept, "<f8"),
    ]
    return b"".join([_LENGTH.pack(len(head)), head, *(a.tobytes() for a in arrays)])


def decode(record: bytes, rows: int, measures: int) -> Results:
    """Return the results in a record, given the numbers of rows and measures.

    Raises
    ------
    ValueError
        The bytes are not such a record.
    """
    try:
        (length,) = _LENGTH.unpack_from(record)
        head = json.loads(record[_LENGTH.size : _LENGTH.size + length])
        n, width, nt, columns = map(operator.index, head["sizes"])
        messages = [str(head["messages"].get(str(i), "")) for i in range(min(n, rows))]
    except (struct.error, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError("the record has no sizes or messages") from error
    if min(n, nt, columns) < 0 or width != measures:
        raise ValueError("the record's sizes do not fit")
    place = _LENGTH.size + length

    def array(kind: str, *shape: int) -> Any:
        nonlocal place
        numbers = np.frombuffer(record, kind, int(np.prod(shape)), place).reshape(shape)
        place += numbers.nbytes
        return numbers

    results = Results(
        array("<i8", n),
        array("<i1", n),
        messages,
        array("<i8", n, 3),
        array("<f8", n, width),
        array("<f8", n, nt, columns),
    )
    if place != len(record) or n > rows:
        raise ValueError("the record's sizes do not fit")
    if not ((results.numbers >= 0) & (results.numbers < rows)).all():
        raise ValueError("the record holds rows that the sweep does not have")
    if not ((results.status >= 0) & (results.status < MISSING)).all():
        raise ValueError("the record holds an unknown status")
    return results
