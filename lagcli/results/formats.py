"""The format of a result file, by the suffix of its name; what its writers and readers share."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Protocol

from lagcli.errors import UsageError
from lagcli.results.atomic import check_writable
from lagcli.results.csv.writer import CsvWriter, check_csv_target, write_csv
from lagcli.trajectory.samples import Array, Record, Samples, Terms

if TYPE_CHECKING:
    from lagcli.trajectory.trajectory import Trajectory


class Writer(Protocol):
    """Writes a run as its samples come.

    A context: the file has its name only after `finish`; if the context ends before, nothing
    remains. `FileError` is raised as by `write`, here or at the end of the context.
    """

    def append(self, samples: Samples) -> None:
        """Take the next samples; the first may be none."""

    def finish(self, record: Record) -> None:
        """Complete the file, which must have been given samples, and name it."""


class Reader(Protocol):
    """An open result file."""

    coordinates: tuple[str, ...]
    constraints: tuple[str, ...]
    outputs: tuple[str, ...]
    terms: Terms
    layout: str
    record: Record

    def count(self) -> int:
        """Return the number of samples."""

    def columns(self, names: Sequence[str]) -> Iterator[Mapping[str, Array]]:
        """Yield fields of `Samples` by name, for so many samples at a time as memory allows.

        An output is ``outputs/NAME``. No sample at all may yield nothing.
        """

    def trajectory(self) -> Trajectory:
        """Return all of it."""


_SUFFIXES = {".h5": "hdf5", ".hdf5": "hdf5", ".csv": "csv"}


def format_of(path: str | os.PathLike[str]) -> str:
    """Return the format that a name stands for.

    Parameters
    ----------
    path : str or path
        A file's name; ``-`` is none.

    Returns
    -------
    str
        ``hdf5`` or ``csv``.

    Raises
    ------
    UsageError
        The suffix is neither ``.h5`` (``.hdf5``) nor ``.csv``, in whichever case.
    """
    stem, suffix = os.path.splitext(os.fspath(path))
    if stem == "-":
        raise UsageError("a result is not read from standard input; save it to a file first")
    try:
        return _SUFFIXES[suffix.lower()]
    except KeyError:
        raise UsageError(
            f"{os.fspath(path)}: the suffix {suffix or '(none)'} is no format of results; "
            f"name it {stem}.h5 (HDF5) or {stem}.csv (CSV)"
        ) from None


def check_target(output: str | os.PathLike[str], force: bool = False, meta: bool = False) -> None:
    """Raise, before a long run, what `write` would raise after it.

    Parameters
    ----------
    output, force, meta
        As for `write`.

    Raises
    ------
    FileError, UsageError
        As `write`, as far as can be known before.
    """
    output = os.fspath(output)
    if _is_csv(output):
        check_csv_target(output, force, meta)
    else:
        check_writable(output, force)


def write(
    trajectory: Trajectory,
    output: str | os.PathLike[str],
    force: bool = False,
    meta: bool = False,
) -> None:
    """Write a trajectory in the format that the name's suffix says.

    Parameters
    ----------
    trajectory : Trajectory
        The run.
    output : str or path
        A name that ends with ``.h5`` (``.hdf5``) or ``.csv``; ``-`` is CSV on standard output.
    force : bool
        Replace an existing file.
    meta : bool
        Write the sidecar of a CSV file; HDF5 holds all of it by itself.

    Raises
    ------
    FileError
        The file exists and ``force`` is false, or it cannot be written.
    UsageError
        The suffix is unknown, or a sidecar is asked for with standard output.
    """
    if _is_csv(output):
        write_csv(trajectory, output, force, meta)
    else:
        from lagcli.results.hdf5.trajectories import write_hdf5  # h5py takes 0.1 s to import

        write_hdf5(trajectory, output, force)


def open_writer(
    output: str | os.PathLike[str], force: bool = False, meta: bool = False
) -> AbstractContextManager[Writer]:
    """Return what writes a run as its samples come; for the parameters and errors see `write`.

    Whether the file could be written, `check_target` says.
    """
    if _is_csv(output):
        return CsvWriter(output, force, meta)
    from lagcli.results.hdf5.trajectories import Hdf5Writer

    return Hdf5Writer(output, force)


def read(path: str | os.PathLike[str]) -> Trajectory:
    """Read the trajectory of a result file.

    Parameters
    ----------
    path : str or path
        A file that `write` wrote.

    Returns
    -------
    Trajectory
        With the same bits in every array; see `read_csv` for what CSV without a sidecar lacks.

    Raises
    ------
    FileError
        The file is missing, damaged, or not of lagcli.
    UsageError
        The suffix is unknown.
    """
    with open_reader(path) as file:
        return file.trajectory()


def open_reader(path: str | os.PathLike[str]) -> AbstractContextManager[Reader]:
    """Open a result file, to look at some of its columns; for the errors see `read`.

    They are raised when the context is entered, or when damage is met.
    """
    name = os.fspath(path)
    if name.lower().endswith((".yaml", ".yml")):
        raise UsageError(f"{name} is a model; simulate it first: lagcli simulate {name} -o run.h5")
    if format_of(path) == "csv":
        from lagcli.results.csv.reader import open_csv

        return open_csv(path)
    from lagcli.results.hdf5.trajectories import open_hdf5

    return open_hdf5(path)


def _is_csv(output: str | os.PathLike[str]) -> bool:
    """Return whether to write CSV."""
    return os.fspath(output) == "-" or format_of(output) == "csv"
