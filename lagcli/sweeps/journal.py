"""The journal of a sweep: what is known of its rows while it runs.

A file that only grows, record by record, each with its length and checksum. A process that is
killed leaves whole records and at most a part of one, which the next reader cuts off.
"""

from __future__ import annotations

import json
import os
import struct
import time
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from lagcli.errors import FileError, UsageError
from lagcli.results.reasons import read_failure, write_failure
from lagcli.sweeps.rows import Results

try:
    import fcntl
except ImportError:  # a system without POSIX locks: nobody is kept out
    fcntl = None  # type: ignore[assignment]

_MAGIC = b"lagcli sweep journal 1\n"
_HEAD = struct.Struct("<QI")  # bytes of the record, and their CRC-32
_SYNC = 1.0  # s between two syncs: what a power failure may cost


def journal_of(output: str) -> str:
    """Return the name of the journal beside a result file."""
    return f"{output}.journal"


class Journal:
    """An open journal, which no other process can open.

    Parameters
    ----------
    path : str
    header : mapping, optional
        What the sweep is, as JSON values; without it the journal must exist.

    Attributes
    ----------
    header : dict
        What it was begun with.

    Raises
    ------
    FileError
        It cannot be read or written, or is no journal.
    UsageError
        Another process has it open.
    """

    def __init__(self, path: str, header: Mapping[str, Any] | None = None):
        self.path = path
        self._synced = time.monotonic()
        self._file = self._open(os.O_RDWR | (os.O_CREAT if header is not None else 0))
        try:
            if header is not None:
                self._attempt(self._begin, header)
            records = self._records()
            first = next(records, None)
            if first is None:
                raise FileError(f"{path} is not a journal of a sweep; remove it, or give --force")
            self.header: dict[str, Any] = json.loads(first)
        except BaseException:
            os.close(self._file)
            raise

    def _open(self, flags: int) -> int:
        while True:
            try:
                file = os.open(self.path, flags, 0o666)
            except OSError as error:
                raise write_failure(self.path, error) from error
            try:
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
            os.close(file)  # finished and removed by its owner in between

    def close(self) -> None:
        """Sync and close it; it stays."""
        with suppress(OSError):
            os.fsync(self._file)
        os.close(self._file)

    def remove(self) -> None:
        """Remove it, when all it holds is in the result file."""
        with suppress(FileNotFoundError):
            os.unlink(self.path)
        os.close(self._file)

    # records

    def _begin(self, header: Mapping[str, Any]) -> None:
        os.ftruncate(self._file, 0)
        self._write(_MAGIC)
        self._write(_framed(json.dumps(header).encode()))
        os.fsync(self._file)

    def append(self, results: Results) -> None:
        """Add the results of some rows; later ones of a row replace earlier ones.

        Raises
        ------
        FileError
            The disk is full, or refuses; the journal is as it was.
        """
        self._attempt(self._write, _framed(_encoded(results)))

    def results(self) -> Iterator[Results]:
        """Yield all results, in the order in which they came; cut off what is not whole."""
        records = self._records()
        next(records)
        for record in records:
            yield _decoded(record)

    def _records(self) -> Iterator[bytes]:
        """Yield the records, and end the file after the last whole one."""
        place = len(_MAGIC)
        if os.pread(self._file, place, 0) != _MAGIC:
            return
        while True:
            head = os.pread(self._file, _HEAD.size, place)
            if len(head) < _HEAD.size:
                break
            size, checksum = _HEAD.unpack(head)
            if place + _HEAD.size + size > os.fstat(self._file).st_size:
                break
            record = _read(self._file, size, place + _HEAD.size)
            if zlib.crc32(record) != checksum:
                break
            place += _HEAD.size + size
            yield record
        os.ftruncate(self._file, place)

    def _attempt(self, action: Any, argument: Any) -> None:
        """Write something; if that fails, leave the file as it was."""
        before = os.fstat(self._file).st_size
        try:
            action(argument)
            if time.monotonic() - self._synced > _SYNC:
                os.fsync(self._file)
                self._synced = time.monotonic()
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._file, before)
            raise write_failure(self.path, error) from error

    def _write(self, data: bytes) -> None:
        place, view = os.fstat(self._file).st_size, memoryview(data)
        while view:
            written = os.pwrite(self._file, view, place)
            place, view = place + written, view[written:]


def _read(file: int, size: int, place: int) -> bytes:
    parts = []
    while size:
        part = os.pread(file, min(size, 1 << 24), place)
        if not part:
            break
        parts.append(part)
        size, place = size - len(part), place + len(part)
    return b"".join(parts)


def _framed(record: bytes) -> bytes:
    return _HEAD.pack(len(record), zlib.crc32(record)) + record


def _encoded(results: Results) -> bytes:
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
    return b"".join([struct.pack("<Q", len(head)), head, *(a.tobytes() for a in arrays)])


def _decoded(record: bytes) -> Results:
    (length,) = struct.unpack_from("<Q", record)
    head = json.loads(record[8 : 8 + length])
    n, measures, nt, columns = head["sizes"]
    place = 8 + length

    def array(kind: str, *shape: int) -> Any:
        nonlocal place
        found = np.frombuffer(record, kind, int(np.prod(shape)), place).reshape(shape)
        place += found.nbytes
        return found

    return Results(
        array("<i8", n),
        array("<i1", n),
        [head["messages"].get(str(i), "") for i in range(n)],
        array("<i8", n, 3),
        array("<f8", n, measures),
        array("<f8", n, nt, columns),
    )


def check_no_journal(output: str) -> None:
    """Raise if an unfinished sweep stands beside a result file.

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
        f"{path} is there: this sweep was begun and not finished; --resume goes on with it,"
        " --force begins anew"
    )
