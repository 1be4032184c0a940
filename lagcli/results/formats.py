"""The formats of result files: their suffixes, readers and writers, and what they can hold."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Literal, NamedTuple, Protocol

from lagcli.errors import UsageError

if TYPE_CHECKING:
    from lagcli.trajectory.samples import Array, Record, Samples, Terms
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
    conserved_names: tuple[str, ...]
    sensitivity: tuple[str, ...]
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


class FormatFunctions(NamedTuple):
    """What a format provides.

    Parameters
    ----------
    check_target : callable of (path, force, meta)
        Raises what a writer would, as far as can be known before.
    open_writer : callable of (path, force, meta)
    open_reader : callable of (path)
    """

    check_target: Callable[[str, bool, bool], None]
    open_writer: Callable[[str, bool, bool], AbstractContextManager[Writer]]
    open_reader: Callable[[str], AbstractContextManager[Reader]]


class ResultFormat(NamedTuple):
    """A format of result files.

    Parameters
    ----------
    name : str
        As `lagcli info --json` gives it.
    title : str
        As messages have it.
    suffixes : tuple of str
        In lower case; messages propose the first.
    functions : callable
        Imports what reads and writes it.
    sweeps : "all", "table" or ""
        What of a sweep it can hold: all of it, the table of its measures, or nothing.
    streams : bool
        Whether it can be written to standard output.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    functions: Callable[[], FormatFunctions]
    sweeps: Literal["", "table", "all"] = ""
    streams: bool = False


def _hdf5() -> FormatFunctions:
    from lagcli.results.hdf5 import trajectories  # h5py takes 0.1 s to import

    return FormatFunctions(
        trajectories.check_hdf5_target, trajectories.Hdf5Writer, trajectories.open_hdf5
    )


def _csv() -> FormatFunctions:
    from lagcli.results.csv import reader, writer

    return FormatFunctions(writer.check_csv_target, writer.CsvWriter, reader.open_csv)


FORMATS = (
    ResultFormat("hdf5", "HDF5", (".h5", ".hdf5"), _hdf5, sweeps="all"),
    ResultFormat("csv", "CSV", (".csv",), _csv, sweeps="table", streams=True),
)
#: All suffixes, as `str.endswith` takes them.
MODEL_SUFFIXES = (".yaml", ".yml")
SUFFIXES = tuple(suffix for f in FORMATS for suffix in f.suffixes)
#: The suffixes in help texts.
SUFFIX_TEXT = " or ".join(f"{f.suffixes[0]} ({f.title})" for f in FORMATS)
SUFFIX_NAMES = " or ".join(f.suffixes[0] for f in FORMATS)


def format_of(path: str | os.PathLike[str]) -> ResultFormat:
    """Return the format that a name stands for.

    Parameters
    ----------
    path : str or path
        A file's name; ``-`` is none.

    Returns
    -------
    ResultFormat

    Raises
    ------
    UsageError
        The suffix, in whichever case, is that of no format.
    """
    stem, suffix = os.path.splitext(os.fspath(path))
    if stem == "-":
        raise UsageError("results cannot be read from standard input; save them to a file first")
    for found in FORMATS:
        if suffix.lower() in found.suffixes:
            return found
    names = " or ".join(f"{stem}{f.suffixes[0]} ({f.title})" for f in FORMATS)
    raise UsageError(
        f"{os.fspath(path)}: the suffix {suffix or '(none)'} is not a result format; use {names}"
    )


def format_read(path: str | os.PathLike[str]) -> ResultFormat:
    """Return the format of a file to read; see `format_of`.

    Raises
    ------
    UsageError
        The suffix is that of no format, or of model files.
    """
    stem, suffix = os.path.splitext(os.fspath(path))
    if suffix.lower() in MODEL_SUFFIXES:
        raise UsageError(
            f"{os.fspath(path)} is a model file, not a result;"
            f" `lagcli simulate {os.fspath(path)} -o {stem}.h5` makes one"
        )
    if not suffix and stem != "-":
        raise UsageError(
            f"{stem} is not the name of a result, which ends in {SUFFIX_NAMES}; of a model,"
            f" `lagcli simulate {stem} -o {stem}.h5` makes one"
        )
    return format_of(path)


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
    path = os.fspath(output)
    _target_format(path).functions().check_target(path, force, meta)


def write(
    trajectory: Trajectory,
    output: str | os.PathLike[str],
    force: bool = False,
    meta: bool = False,
) -> None:
    """Write a trajectory in the format that the name's suffix says, whole or not at all.

    Parameters
    ----------
    trajectory : Trajectory
        The run; nt, nq, nc and the number of outputs may be 0.
    output : str or path
        A name that ends with ``.h5`` (``.hdf5``) or ``.csv``; ``-`` is CSV on standard output.
    force : bool
        Replace an existing file.
    meta : bool
        Write the sidecar of a CSV file; HDF5 holds all of it by itself.

    Raises
    ------
    FileError
        The file exists and ``force`` is false, or it cannot be written; standard output takes no
        more (a full disk). A closed pipe remains a ``BrokenPipeError``.
    UsageError
        The suffix is unknown, or a sidecar is requested with standard output.
    """
    check_target(output, force, meta)
    with open_writer(output, force, meta) as writer:
        writer.append(trajectory)
        writer.finish(trajectory)


def open_writer(
    output: str | os.PathLike[str], force: bool = False, meta: bool = False
) -> AbstractContextManager[Writer]:
    """Return what writes a run as its samples come; for the parameters and errors see `write`.

    `check_target` says whether the file could be written.
    """
    path = os.fspath(output)
    return _target_format(path).functions().open_writer(path, force, meta)


def read(path: str | os.PathLike[str]) -> Trajectory:
    """Read the trajectory of a result file.

    Parameters
    ----------
    path : str or path
        A file that `write` wrote. Of CSV, line ends may be ``\\r\\n`` and a byte order mark may
        lead.

    Returns
    -------
    Trajectory
        With the same bits in every array (in CSV, every NaN becomes the one of Python). What only
        the sidecar of a CSV file holds is empty without it: ``status`` and the other texts are
        ``""``, mappings have no entry, ``scale_position`` and ``scale_velocity`` are NaN.

    Raises
    ------
    FileError
        The file is missing, unreadable, cut short or damaged, or not of lagcli in a layout that
        this version knows; or a sidecar belongs to another CSV file.
    UsageError
        The suffix is unknown.
    """
    with open_reader(path) as file:
        return file.trajectory()


def open_reader(path: str | os.PathLike[str]) -> AbstractContextManager[Reader]:
    """Open a result file, to look at some of its columns; for the errors see `read`.

    They are raised when the context is entered, or when damage is met.
    """
    return format_read(path).functions().open_reader(os.fspath(path))


def _target_format(path: str) -> ResultFormat:
    """Return the format to write; ``-`` is the one that can be written to standard output."""
    return next(f for f in FORMATS if f.streams) if path == "-" else format_of(path)
