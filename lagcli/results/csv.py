"""Trajectories in CSV: one header line, one line per sample, 17 significant digits."""

from __future__ import annotations

import csv
import hashlib
import io
import os
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, TextIO

import numpy as np

from lagcli.errors import FileError, UsageError
from lagcli.results.atomic import check_writable, whole_file
from lagcli.results.layout import QUANTITIES
from lagcli.results.reasons import check_readable, read_failure, write_failure
from lagcli.results.sidecar import read_sidecar, sidecar_path, sidecar_text
from lagcli.trajectory import Array, Trajectory

#: Numbers formatted in one go: large enough to be fast, small enough for any memory.
_NUMBERS_AT_ONCE = 1 << 16


def columns(
    coordinates: Sequence[str], constraints: Sequence[str], outputs: Iterable[str]
) -> dict[str, list[str]]:
    """Return the names of the columns of a CSV file.

    Parameters
    ----------
    coordinates, constraints, outputs : sequence of str
        Names, in the model's order.

    Returns
    -------
    dict
        In the order of the file: field of `Trajectory` → names of its columns, the last axis
        running fastest.
    """
    by_axes = {("time",): [""], ("time", "constraint"): [f".{c}" for c in constraints]}
    named = {
        "time": ["t"],
        "q": list(coordinates),
        "v": [f"{q}_dot" for q in coordinates],
        "a": [f"{q}_ddot" for q in coordinates],
        "multipliers": [f"lambda.{c}" for c in constraints],
        "constraint_force": [f"Qc.{q}" for q in coordinates],
        "constraint_force_by": [f"Qc.{c}.{q}" for c in constraints for q in coordinates],
    }
    for quantity in QUANTITIES:
        if "time" in quantity.axes and quantity.name not in named:
            named[quantity.name] = [quantity.name + end for end in by_axes[quantity.axes]]
    return {**named, "outputs": list(outputs)}


def write_csv(
    trajectory: Trajectory,
    output: str | os.PathLike[str],
    force: bool = False,
    meta: bool = False,
) -> None:
    """Write a trajectory as CSV, to a file (whole or not at all) or to standard output.

    Parameters
    ----------
    trajectory : Trajectory
        The run; nt, nc and the number of outputs may be 0.
    output : str or path
        The file, or ``-`` for standard output.
    force : bool
        Replace an existing file and its sidecar.
    meta : bool
        Write the sidecar ``OUTPUT.json`` too, with what CSV has no place for: status, message,
        model, parameters, units, options, scales, …

    Raises
    ------
    FileError
        The file or its sidecar exists and ``force`` is false, or cannot be written; standard
        output takes no more (a full disk). A closed pipe remains a ``BrokenPipeError``.
    UsageError
        A sidecar is asked for with standard output.

    Notes
    -----
    As RFC 4180 says (comma, quotes doubled, quoted where needed), but for the line end, which is
    ``\\n`` alone: awk, cut, sort and join would take the carriage return for a part of the last
    column, and every reader of CSV accepts the newline. The text is UTF-8. NaN is ``nan``,
    infinities are ``inf`` and ``-inf``.

    The file gets its name just before the sidecar does. The sidecar carries the digest of its
    CSV file, so that one that belongs to another run is noticed; with ``force`` and without
    ``meta`` an old sidecar is removed.
    """
    path = os.fspath(output)
    check_csv_target(path, force, meta)
    if path == "-":
        _write_stdout(_encode(trajectory))
        return
    sidecar = sidecar_path(path)
    if meta:
        with whole_file(sidecar, force) as beside, whole_file(path, force) as file:
            digest = hashlib.sha256()
            for block in _encode(trajectory):
                digest.update(block)
                file.write(block)
            beside.write(sidecar_text(trajectory, digest.hexdigest()))
    else:
        with whole_file(path, force) as file:
            file.writelines(_encode(trajectory))
        if os.path.lexists(sidecar):
            try:
                os.unlink(sidecar)
            except OSError as error:
                raise write_failure(sidecar, error) from error


def check_csv_target(path: str, force: bool = False, meta: bool = False) -> None:
    """Raise if `write_csv` could not write there now.

    Parameters
    ----------
    path, force, meta
        As for `write_csv`.

    Raises
    ------
    FileError
        The file or its sidecar exists and ``force`` is false, or the folder takes no file.
    UsageError
        A sidecar is asked for with standard output.
    """
    if path == "-":
        if meta:
            raise UsageError(
                "standard output has no sidecar for --meta; name a file: -o run.csv --meta"
            )
        return
    # An old sidecar would be taken for one of the new file, so it stands in the way even of a
    # file without.
    check_writable(path, force)
    check_writable(sidecar_path(path), force)


def read_csv(path: str | os.PathLike[str]) -> Trajectory:
    """Read the trajectory of a CSV file, and of its sidecar where there is one.

    Parameters
    ----------
    path : str or path
        A file that `write_csv` wrote; line ends may be ``\\r\\n`` and a byte order mark may lead.

    Returns
    -------
    Trajectory
        With the same bits in every array (every NaN becomes the one of Python). What only the
        sidecar holds is empty without it: ``status`` and the other texts are ``""``, mappings
        have no entry, ``scale_position`` and ``scale_velocity`` are NaN.

    Raises
    ------
    FileError
        A file is missing or unreadable, was not written by `write_csv`, is cut short or has a
        line that is no sample; or the sidecar belongs to another CSV file.
    """
    path = os.fspath(path)
    check_readable(path)
    _check_last_line(path)
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            header = next(csv.reader(file, strict=True), [])
            coordinates, constraints, outputs = _names(path, header)
            table = _table(path, file, header)
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"cannot read {path}: it is not CSV text ({error})") from error
    except OSError as error:
        raise read_failure(path, error) from error

    length = {"time": len(table), "coordinate": len(coordinates), "constraint": len(constraints)}
    axes = {quantity.name: quantity.axes for quantity in QUANTITIES}
    fields: dict[str, Any] = {}
    position = 0
    for name, titles in columns(coordinates, constraints, outputs).items():
        block = np.ascontiguousarray(table[:, position : position + len(titles)])
        position += len(titles)
        if name == "outputs":
            fields[name] = {n: block[:, i].copy() for i, n in enumerate(outputs)}
        elif name != "constraint_force":  # the sum of constraint_force_by
            fields[name] = block.reshape([length[axis] for axis in axes[name]])
    about = read_sidecar(path, len(constraints))
    return Trajectory(coordinates=coordinates, constraints=constraints, **fields, **about)


def _encode(trajectory: Trajectory) -> Iterator[bytes]:
    """Return the file's text, block by block."""
    names = columns(trajectory.coordinates, trajectory.constraints, trajectory.outputs)
    header = io.StringIO()
    csv.writer(header, lineterminator="\n").writerow([n for block in names.values() for n in block])
    yield header.getvalue().encode()

    samples = len(trajectory.time)
    arrays = [
        np.asarray(getattr(trajectory, name)).reshape(samples, len(titles))
        for name, titles in names.items()
        if name != "outputs"
    ]
    arrays += [np.asarray(values).reshape(samples, 1) for values in trajectory.outputs.values()]
    width = sum(array.shape[1] for array in arrays)
    rows = max(1, _NUMBERS_AT_ONCE // width)
    line = ",".join(["%.17g"] * width) + "\n"
    for start in range(0, samples, rows):
        block = np.hstack([array[start : start + rows] for array in arrays])
        yield (line * len(block) % tuple(block.ravel().tolist())).encode("ascii")


def _write_stdout(blocks: Iterable[bytes]) -> None:
    """Write to standard output; leave nothing in a buffer that could fail at exit."""
    stream = sys.stdout
    if stream is None:
        raise FileError("cannot write to standard output: it is closed; name a file: -o run.csv")
    try:
        stream.flush()
        try:
            descriptor = stream.fileno()
        except (AttributeError, io.UnsupportedOperation):  # a stream in memory: a test, a notebook
            for block in blocks:
                stream.write(block.decode())
            return
        for block in blocks:
            rest = memoryview(block)
            while rest:
                rest = rest[os.write(descriptor, rest) :]
    except BrokenPipeError:
        raise
    except OSError as error:
        raise write_failure("standard output", error) from error


def _check_last_line(path: str) -> None:
    """Raise if the file does not end with a line end: then even its last number may be cut."""
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


def _names(
    path: str, header: list[str]
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Return the coordinates, constraints and outputs that the header names."""
    # Forces follow the accelerations; without a coordinate there are none, and energies follow.
    ends = [i for i, n in enumerate(header) if n.startswith(("lambda.", "Qc."))]
    ends += [i for i, n in enumerate(header) if n == "energy_kinetic"]
    coordinates = tuple(header[1 : 1 + (ends[0] - 1) // 3]) if ends else ()
    constraints = tuple(n.removeprefix("lambda.") for n in header if n.startswith("lambda."))
    fixed = [n for block in columns(coordinates, constraints, ()).values() for n in block]
    if header[: len(fixed)] != fixed:
        raise FileError(
            f"cannot read {path}: it is CSV, but not of lagcli, whose columns are t, coordinates, "
            "their _dot and _ddot, lambda.CONSTRAINT, …; name a file of lagcli simulate"
        )
    return coordinates, constraints, tuple(header[len(fixed) :])


def _table(path: str, file: TextIO, header: list[str]) -> Array:
    """Return the samples, one by row."""
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "loadtxt: input contained no data")
            table = np.loadtxt(file, delimiter=",", comments=None, ndmin=2)
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
    """Return the error that names the first line that is no sample."""
    with open(path, encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file)
        next(reader)
        for row in reader:
            where = f"cannot read {path}: line {reader.line_num}"
            if row and len(row) != len(header):
                return FileError(
                    f"{where} has {len(row)} values for {len(header)} columns; "
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
