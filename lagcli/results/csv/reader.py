"""Reader of trajectories in CSV."""

from __future__ import annotations

import csv
import math
import os
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from typing import Any, NamedTuple, TextIO

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import (
    ARRAYS,
    REQUIRED,
    SCALARS,
    ColumnName,
    read_column_name,
    read_dotted_name,
)
from lagcli.errors import FileError
from lagcli.files import check_readable, read_failure
from lagcli.prose import counted
from lagcli.results.csv.gaps import Gaps
from lagcli.results.csv.sidecar import read_sidecar
from lagcli.results.csv.writer import titles
from lagcli.results.metadata import check_times
from lagcli.trajectory.samples import Record, Terms
from lagcli.trajectory.trajectory import Trajectory

#: Number of values read at once, if a file is read in blocks.
_NUMBERS_READ = 1 << 20
#: Difference of sums that is rounding, also of numbers that another program rounded.
_ROUNDED = 1e-5


@contextmanager
def open_csv(path: str) -> Iterator[CsvReader]:
    """Open a CSV file and its sidecar; raises the errors of `lagcli.results.formats.read`, also
    later."""
    check_readable(path)
    _check_last_line(path)
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            yield CsvReader(path, file)
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"cannot read {path}: it is not CSV text ({error})") from error
    except OSError as error:
        raise read_failure(path, error) from error


class CsvReader:
    """An open file that can be read once; see `lagcli.results.formats.Reader`."""

    def __init__(self, path: str, file: TextIO):
        self._path, self._file = path, file
        self._header = next(csv.reader(file, strict=True), [])
        names = _names(path, self._header)
        self.coordinates, self.constraints, self.terms = names[:3]
        self.conserved_names, self.outputs = names.conserved, names.outputs
        self.sensitivity, self._missing = names.sensitivity, names.missing
        self._reached = -math.inf  # the time of the last sample so far
        self._gaps = Gaps()
        self._record = read_sidecar(path, self.coordinates, self.constraints)

    @property
    def record(self) -> Record:
        """The record, with a warning if samples read so far have gaps that no sidecar explains."""
        warning = None if self._record.status else self._gaps.warning()
        if warning is None:
            return self._record
        return Record(**{**vars(self._record), "warnings": (warning,)})

    def count(self) -> int:
        """Return the number of samples: lines that are not blank, without the header."""
        with open(self._path, "rb") as file:
            return sum(not line.isspace() for line in file) - 1

    def columns(self, names: Sequence[str]) -> Iterator[Mapping[str, Array]]:
        """Yield columns of consecutive samples, by name."""
        rows = max(1, _NUMBERS_READ // len(self._header))
        while lines := list(islice(self._file, rows)):
            columns = self._columns(_table(self._path, lines, self._header))
            columns |= {f"outputs/{n}": values for n, values in columns["outputs"].items()}
            yield {name: columns[name] for name in names}

    def trajectory(self) -> Trajectory:
        """Return the whole trajectory."""
        columns = self._columns(_table(self._path, self._file, self._header))
        del columns["constraint_force"]  # the sum of constraint_force_by
        return Trajectory(
            coordinates=self.coordinates,
            constraints=self.constraints,
            terms=self.terms,
            conserved_names=self.conserved_names,
            sensitivity=self.sensitivity,
            **columns,
            **vars(self.record),
        )

    def _columns(self, table: Array) -> dict[str, Any]:
        """Return the columns of a table, by field of `Samples`."""
        length = {
            "time": len(table),
            "coordinate": len(self.coordinates),
            "constraint": len(self.constraints),
            "term": len(self.terms.constraint),
            "conserved_quantity": len(self.conserved_names),
            "parameter": len(self.sensitivity),
        }
        fields: dict[str, Any] = {}
        position = 0
        names = self.terms.names(self.coordinates, self.constraints)
        for name, of_name in titles(
            *(self.coordinates, self.constraints, names, self.conserved_names, self.outputs),
            self.sensitivity,
        ).items():
            if name in self._missing:
                block = np.full((len(table), len(of_name)), np.nan)
            else:
                block = np.ascontiguousarray(table[:, position : position + len(of_name)])
                position += len(of_name)
            if name == "outputs":
                fields[name] = {n: block[:, i].copy() for i, n in enumerate(self.outputs)}
            else:
                fields[name] = block.reshape([length[axis] for axis in ARRAYS[name].axes])
        self._check_times(fields["time"])
        self._check_forces(fields["constraint_force"], fields["constraint_force_by"])
        return fields

    def _check_times(self, time: Array) -> None:
        try:
            check_times(time, self._reached)
        except ValueError as error:
            raise self._changed(str(error)) from None
        equal = time[1:][time[1:] == time[:-1]]
        if len(time) and (len(equal) or time[0] == self._reached):
            twice = float(equal[0] if len(equal) else time[0])
            raise self._changed(f"there are two samples at t = {twice:g} s")
        self._gaps.add(time)
        self._reached = float(time[-1]) if len(time) else self._reached

    def _check_forces(self, total: Array, terms: Array) -> None:
        """Raise unless the constraint forces are the sums of their terms, which are stored too."""
        if "constraint_force_by" in self._missing:
            return
        with np.errstate(invalid="ignore", over="ignore"):
            size = self.terms.total(abs(terms))
            wrong = abs(total - self.terms.total(terms)) > _ROUNDED * size
        if wrong.any():
            sample, place = np.argwhere(wrong)[0]
            raise self._changed(
                f"Qc.{self.coordinates[place]} of sample {sample} is not the sum of the forces of"
                " the constraints: a number was changed, or columns were exchanged"
            )

    def _changed(self, problem: str) -> FileError:
        """Return the error of contents that lagcli does not write."""
        return FileError(
            f"cannot read {self._path}: {problem}; copy it again, or run the simulation again"
        )


def _check_last_line(path: str) -> None:
    """Raise if the file does not end with a newline: its last number may be truncated."""
    try:
        with open(path, "rb") as file:
            file.seek(-1, os.SEEK_END)
            complete = file.read() == b"\n"
    except OSError as error:
        raise read_failure(path, error) from error
    if not complete:
        raise FileError(
            f"cannot read {path}: it ends within a line, so it is cut short or not CSV of lagcli; "
            "copy it again, or run the simulation again"
        )


class HeaderNames(NamedTuple):
    """Names in the header of a CSV file.

    ``missing`` are quantities that were added after the file was written.
    """

    coordinates: tuple[str, ...]
    constraints: tuple[str, ...]
    terms: Terms
    conserved: tuple[str, ...]
    outputs: tuple[str, ...]
    sensitivity: tuple[str, ...]
    missing: set[str]


def _names(path: str, header: list[str]) -> HeaderNames:
    """Return the names of a header; raise FileError if lagcli did not write it."""
    # Forces follow the accelerations; without coordinates there are none, and scalars follow.
    named = [read_dotted_name(text) or ColumnName("") for text in header]
    forces = ("multipliers", "constraint_force", "constraint_force_by")
    ends = [i for i, name in enumerate(named) if name.quantity in forces]
    ends += [i for i, text in enumerate(header) if text == SCALARS[0].name]
    coordinates = tuple(header[1 : 1 + (ends[0] - 1) // 3]) if ends else ()
    constraints = tuple(n.constraint for n in named if n.quantity == "multipliers")
    known = set(coordinates), set(constraints)
    named = [
        (read_column_name(text, *known) or name) if name.coordinate else name
        for text, name in zip(header, named, strict=True)
    ]
    pairs = [(n.constraint, n.coordinate) for n in named if n.quantity == "constraint_force_by"]
    terms = _terms(pairs, coordinates, constraints)
    conserved = tuple(n.conserved for n in named if n.conserved)
    blocks, there = titles(coordinates, constraints, pairs, conserved, ()), set(header)
    missing = {
        name
        for name, texts in blocks.items()
        if texts and name not in REQUIRED and there.isdisjoint(texts)
    }
    fixed = [text for name, texts in blocks.items() if name not in missing for text in texts]
    if terms is None or header[: len(fixed)] != fixed:
        raise FileError(
            f"cannot read {path}: it is CSV, but not of lagcli, whose columns are t, coordinates, "
            "their _dot and _ddot, lambda.CONSTRAINT, …; name a file of lagcli simulate"
        )
    rest = header[len(fixed) :]
    for names in (coordinates, constraints, conserved, rest):
        if len(set(names)) < len(names):
            raise FileError(f"cannot read {path}: two of its columns have one name")
    parameters: dict[str, None] = {}
    for first, text in enumerate(rest):  # derivatives are last; no other name has a slash
        if "/d" in text:
            parameters = dict.fromkeys(x.partition("/d")[2] for x in rest[first:])
            rest = rest[:first]
            break
    every = titles(coordinates, constraints, pairs, conserved, rest, (*parameters,))
    expected = [text for name, block in every.items() if name not in missing for text in block]
    if header != expected:
        raise FileError(
            f"cannot read {path}: its derivatives are not those of its coordinates and constraints;"
            " copy it again, or run the simulation again"
        )
    return HeaderNames(
        *(coordinates, constraints, terms, conserved),
        *(tuple(rest), tuple(parameters), missing),
    )


def _terms(
    pairs: list[tuple[str, str]], coordinates: tuple[str, ...], constraints: tuple[str, ...]
) -> Terms | None:
    """Return the terms that columns name; None if they are invalid, or not in order."""
    places = {q: j for j, q in enumerate(coordinates)}
    rows = {c: i for i, c in enumerate(constraints)}
    if not all(c in rows and q in places for c, q in pairs):
        return None
    terms = Terms.of(((rows[c], places[q]) for c, q in pairs), (len(constraints), len(coordinates)))
    try:
        terms.check()
    except ValueError:
        return None
    return terms


def _table(path: str, lines: Iterable[str], header: list[str]) -> Array:
    """Return the samples, one by row."""
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "loadtxt: input contained no data")
            table = np.loadtxt(lines, delimiter=",", comments=None, ndmin=2)
    except UnicodeDecodeError:
        raise
    except ValueError as error:
        raise _bad_line(path, header, str(error)) from error
    if table.size == 0:
        return np.empty((0, len(header)))
    if table.shape[1] != len(header):
        raise _bad_line(path, header, f"{table.shape[1]} columns")
    return table


def _bad_line(path: str, header: list[str], reason: str) -> FileError:
    """Return the error for the first line that is not a sample."""
    with open(path, encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file)
        next(reader)
        for row in reader:
            where = f"cannot read {path}: line {reader.line_num}"
            if row and len(row) != len(header):
                return FileError(
                    f"{where} has {counted(len(row), 'value')} for"
                    f" {counted(len(header), 'column')}; "
                    "copy the file again, or run the simulation again"
                )
            for name, text in zip(header, row, strict=False):
                try:
                    float(text)
                except ValueError:
                    return FileError(
                        f"{where}, column {name}: {text!r} is not a number; "
                        "copy the file again, or run the simulation again"
                    )
    return FileError(f"cannot read {path}: {reason}; copy it again, or run the simulation again")
