"""Trajectories to CSV: one header line, one line per sample, 17 significant digits."""

from __future__ import annotations

import csv
import io
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain

import numpy as np

from lagcli.columns import DERIVATIVES, SAMPLED, column_names, derivative_names
from lagcli.errors import FileError, UsageError
from lagcli.files import write_failure
from lagcli.results.atomic import FileWriter, check_writable
from lagcli.results.csv.names import events_path, sidecar_path
from lagcli.trajectory.samples import Record, Samples

#: Number of values formatted at once: large enough to be fast, small enough for memory.
_NUMBERS_WRITTEN = 1 << 14


def titles(
    coordinates: Sequence[str],
    constraints: Sequence[str],
    terms: Sequence[tuple[str, str]],
    conserved: Sequence[str],
    outputs: Iterable[str],
    parameters: Sequence[str] = (),
) -> dict[str, list[str]]:
    """Return the names of the columns of a CSV file.

    Parameters
    ----------
    coordinates, constraints, outputs : sequence of str
        Names, in the model's order.
    terms : sequence of (constraint, coordinate)
        Terms of the constraint forces.
    conserved : sequence of str
        Names of the conserved quantities.
    parameters : sequence of str
        Parameters of the derivatives.

    Returns
    -------
    dict
        In the order of the file: field of `Trajectory` → names of its columns, with the last axis
        varying fastest.
    """
    columns = {
        quantity.name: list(
            map(str, column_names(quantity, coordinates, constraints, terms, conserved))
        )
        for quantity in SAMPLED
    }
    columns["outputs"] = list(outputs)
    for quantity in DERIVATIVES if parameters else ():
        columns[quantity.name] = derivative_names(quantity, coordinates, constraints, parameters)
    return columns


class CsvWriter(FileWriter):
    """Writes a run as CSV during the run; see `lagcli.results.formats.Writer`.

    Parameters
    ----------
    path : str
        The file, or ``-`` for standard output, accepted by `check_csv_target`.
    force : bool
        Replace an existing file, its sidecar and its event table.
    meta : bool
        Also write the sidecar ``PATH.json`` with the metadata: status, message, model, parameters,
        units, options, scales, ….

    Notes
    -----
    The format is RFC 4180 (comma, doubled quotes, quoted where needed) with the line end ``\\n``:
    awk, cut, sort and join would treat a carriage return as part of the last column, and all
    readers of CSV accept the newline. The text is UTF-8. NaN is ``nan``, infinities are ``inf`` and
    ``-inf``.

    Contacts and events are written to a separate table, ``FILE.events.csv``, unless the output is
    standard output. The file gets its name just before the sidecar does. The sidecar contains the
    digests of the CSV file and of the table, which reveal files of another run; with ``force`` and
    without ``meta`` an old sidecar is removed.
    """

    def __init__(self, path: str, force: bool = False, meta: bool = False):
        super().__init__()
        self._path, self._force, self._meta = path, force, meta
        self._write: Callable[[bytes], object] | None = None
        if meta:
            import hashlib  # OpenSSL, which a file without digests does not need

            self._digest = hashlib.sha256()
        self._samples = 0

    def append(self, samples: Samples) -> None:
        """Write the next samples."""
        if self._write is None:
            self._write = self._open(samples)
            self._put(self._write, _header(samples))
        for piece in _lines(samples):
            self._put(self._write, piece)
        self._samples += len(samples.time)

    def finish(self, record: Record) -> None:
        """Write the event table and the sidecar, and give the files their names."""
        table = None
        if record.events is not None:
            table = self._write_events(record)
        if self._meta:
            import hashlib

            from lagcli.results.csv.sidecar import sidecar_text

            contents = {
                "csv_sha256": self._digest.hexdigest(),
                "samples": self._samples,
                **self._names,
                **({} if table is None else {"events_sha256": hashlib.sha256(table).hexdigest()}),
            }
            self._beside.write(sidecar_text(record, contents))
        self.name_files()
        if self._path != "-" and not self._meta:
            _remove(sidecar_path(self._path))
        if self._path != "-" and table is None:
            _remove(events_path(self._path))

    def _write_events(self, record: Record) -> bytes:
        """Write the event table, if the samples go to a file; it gets its name first."""
        from lagcli.results.csv.event_table import events_text

        assert record.events is not None
        t_start = float(record.options.get("t_start", math.nan))
        names = (self._names["coordinates"], self._names["constraints"])
        text = events_text(record.events, t_start, *names)
        if self._path != "-":
            self.open_file(events_path(self._path), self._force).write(text)
        return text

    def _open(self, samples: Samples) -> Callable[[bytes], object]:
        self._names = {
            "coordinates": list(samples.coordinates),
            "constraints": list(samples.constraints),
            "outputs": list(samples.outputs),
        }
        if self._path == "-":
            return _standard_output()
        if self._meta:  # opened first, so that it gets its name last
            self._beside = self.open_file(sidecar_path(self._path), self._force)
        return self.open_file(self._path, self._force).write

    def _put(self, write: Callable[[bytes], object], data: bytes) -> None:
        if self._meta:
            self._digest.update(data)
        write(data)


def _remove(path: str) -> None:
    """Remove a file, if there is one."""
    if os.path.lexists(path):
        try:
            os.unlink(path)
        except OSError as error:
            raise write_failure(path, error) from error


def files_of(path: str) -> tuple[str, ...]:
    """Return the files that `CsvWriter` writes or removes."""
    return () if path == "-" else (path, sidecar_path(path), events_path(path))


def check_csv_target(path: str, force: bool = False, meta: bool = False) -> None:
    """Raise an error if `CsvWriter` could not write there now.

    Parameters
    ----------
    path, force, meta
        As for `CsvWriter`.

    Raises
    ------
    FileError
        The file, its sidecar or its event table exists and ``force`` is false, or the folder is not
        writable.
    UsageError
        A sidecar is requested with standard output.
    """
    if path == "-":
        if meta:
            raise UsageError(
                "standard output has no sidecar for --meta; name a file: -o run.csv --meta"
            )
        return
    # an old sidecar, or event table, could be mistaken for one of the new file, so it is an
    # obstacle even for a file without one
    for name in files_of(path):
        check_writable(name, force)


def _header(samples: Samples) -> bytes:
    """Return the first line."""
    header = io.StringIO()
    csv.writer(header, lineterminator="\n").writerow(chain.from_iterable(_titles(samples).values()))
    return header.getvalue().encode()


def _titles(samples: Samples) -> dict[str, list[str]]:
    """Return the names of the columns of samples."""
    q, constraints = samples.coordinates, samples.constraints
    terms = samples.terms.names(q, constraints)
    return titles(
        *(q, constraints, terms, samples.conserved_names, samples.outputs, samples.sensitivity)
    )


def _lines(samples: Samples) -> Iterator[bytes]:
    """Yield the lines of samples, in blocks."""
    count = len(samples.time)
    arrays = []
    for name, names in _titles(samples).items():
        if name == "outputs":
            arrays += [np.asarray(x).reshape(count, 1) for x in samples.outputs.values()]
        else:
            arrays.append(np.asarray(getattr(samples, name)).reshape(count, len(names)))
    width = sum(array.shape[1] for array in arrays)
    rows = max(1, _NUMBERS_WRITTEN // width)
    line = ",".join(["%.17g"] * width) + "\n"
    for start in range(0, count, rows):
        block = np.hstack([array[start : start + rows] for array in arrays])
        yield (line * len(block) % tuple(block.ravel().tolist())).encode("ascii")


def _standard_output() -> Callable[[bytes], object]:
    """Return a writer to standard output without buffers that could fail at exit."""
    stream = sys.stdout
    if stream is None or stream.closed:  # a program without a console, which calls the library
        raise FileError("cannot write to standard output: it is closed; name a file: -o run.csv")
    try:
        stream.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise write_failure("standard output", error) from error
    try:
        descriptor = stream.fileno()
    except (AttributeError, io.UnsupportedOperation):  # a stream in memory: a test, a notebook
        return lambda data: stream.write(data.decode())

    def write(data: bytes) -> None:
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[os.write(descriptor, rest) :]
        except BrokenPipeError:
            raise
        except OSError as error:
            raise write_failure("standard output", error) from error

    return write
