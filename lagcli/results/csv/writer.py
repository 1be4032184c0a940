"""Trajectories to CSV: one header line, one line per sample, 17 significant digits."""

from __future__ import annotations

import csv
import hashlib
import io
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain

import numpy as np

from lagcli.columns import DERIVATIVES, SAMPLED, column_names, derivative_names
from lagcli.errors import FileError, UsageError
from lagcli.results.atomic import FileWriter, check_writable, whole_file
from lagcli.results.csv.event_table import events_path, events_text
from lagcli.results.csv.sidecar import sidecar_path, sidecar_text
from lagcli.results.layout import term_names
from lagcli.results.reasons import write_failure
from lagcli.trajectory.samples import Record, Samples

#: Numbers formatted in one go: large enough to be fast, small enough for any memory.
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
        In the order of the file: field of `Trajectory` → names of its columns, the last axis
        running fastest.
    """
    found = {
        quantity.name: list(
            map(str, column_names(quantity, coordinates, constraints, terms, conserved))
        )
        for quantity in SAMPLED
    }
    found["outputs"] = list(outputs)
    for quantity in DERIVATIVES if parameters else ():
        found[quantity.name] = derivative_names(quantity, coordinates, constraints, parameters)
    return found


class CsvWriter(FileWriter):
    """Writes a run as CSV as its samples come; see `lagcli.results.formats.Writer`.

    Parameters
    ----------
    path : str
        The file, or ``-`` for standard output; `check_csv_target` has accepted it.
    force : bool
        Replace an existing file, its sidecar and its table of events.
    meta : bool
        Write the sidecar ``PATH.json`` too, with what CSV has no place for: status, message,
        model, parameters, units, options, scales, …

    Notes
    -----
    As RFC 4180 says (comma, quotes doubled, quoted where needed), but for the line end, which is
    ``\\n`` alone: awk, cut, sort and join would take the carriage return for a part of the last
    column, and every reader of CSV accepts the newline. The text is UTF-8. NaN is ``nan``,
    infinities are ``inf`` and ``-inf``.

    Contacts and events are written to a separate table, ``FILE.events.csv``; standard output
    has none. The file gets its name just before the sidecar does. The sidecar carries the digests
    of its CSV file and of the table, by which files of another run are noticed; with ``force``
    and without ``meta`` an old sidecar is removed.
    """

    def __init__(self, path: str, force: bool = False, meta: bool = False):
        super().__init__()
        self._path, self._force, self._meta = path, force, meta
        self._write: Callable[[bytes], object] | None = None
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
        """Write the table of events and the sidecar, and give the files their names."""
        table = None
        if record.events is not None:
            table = self._write_events(record)
        if self._meta:
            contents = {
                "csv_sha256": self._digest.hexdigest(),
                "samples": self._samples,
                **self._names,
                **({} if table is None else {"events_sha256": hashlib.sha256(table).hexdigest()}),
            }
            self._beside.write(sidecar_text(record, contents))
        self.opened.close()
        if self._path != "-" and not self._meta:
            _remove(sidecar_path(self._path))
        if self._path != "-" and table is None:
            _remove(events_path(self._path))

    def _write_events(self, record: Record) -> bytes:
        """Write the table of events, if the samples go to a file; it is named first."""
        assert record.events is not None
        t_start = float(record.options.get("t_start", math.nan))
        names = (self._names["coordinates"], self._names["constraints"])
        text = events_text(record.events, t_start, *names)
        if self._path != "-":
            table = whole_file(events_path(self._path), self._force)
            self.opened.enter_context(table).write(text)
        return text

    def _open(self, samples: Samples) -> Callable[[bytes], object]:
        self._names = {
            "coordinates": list(samples.coordinates),
            "constraints": list(samples.constraints),
            "outputs": list(samples.outputs),
        }
        if self._path == "-":
            return _standard_output()
        if self._meta:  # opened first, so that it is named last
            sidecar = whole_file(sidecar_path(self._path), self._force)
            self._beside = self.opened.enter_context(sidecar)
        return self.opened.enter_context(whole_file(self._path, self._force)).write

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


def check_csv_target(path: str, force: bool = False, meta: bool = False) -> None:
    """Raise if `CsvWriter` could not write there now.

    Parameters
    ----------
    path, force, meta
        As for `CsvWriter`.

    Raises
    ------
    FileError
        The file, its sidecar or its table of events exists and ``force`` is false, or the folder
        takes no file.
    UsageError
        A sidecar is requested with standard output.
    """
    if path == "-":
        if meta:
            raise UsageError(
                "standard output has no sidecar for --meta; name a file: -o run.csv --meta"
            )
        return
    # An old sidecar, or table of events, would be taken for one of the new file, so it stands in
    # the way even of a file without.
    check_writable(path, force)
    check_writable(sidecar_path(path), force)
    check_writable(events_path(path), force)


def _header(samples: Samples) -> bytes:
    """Return the first line."""
    header = io.StringIO()
    csv.writer(header, lineterminator="\n").writerow(chain.from_iterable(_titles(samples).values()))
    return header.getvalue().encode()


def _titles(samples: Samples) -> dict[str, list[str]]:
    """Return the names of the columns of samples."""
    q, constraints = samples.coordinates, samples.constraints
    terms = term_names(samples.terms, q, constraints)
    return titles(
        *(q, constraints, terms, samples.conserved_names, samples.outputs, samples.sensitivity)
    )


def _lines(samples: Samples) -> Iterator[bytes]:
    """Yield the lines of samples, some at a time."""
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
    """Return what writes to standard output; no buffer is left that could fail at exit."""
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
