"""Formats of result files: suffixes, readers, writers, and capabilities."""

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
    """Writes a run while its samples are computed.

    A context manager: the file gets its name only after `finish`; if the context ends before,
    nothing remains. `FileError` is raised as by `write`, here or at the end of the context.
    """

    def append(self, samples: Samples) -> None:
        """Write the next samples; the first block may be empty."""

    def finish(self, record: Record) -> None:
        """Complete the file, to which samples must have been written, and give it its name."""


class Reader(Protocol):
    """An open result file."""

    coordinates: tuple[str, ...]
    constraints: tuple[str, ...]
    outputs: tuple[str, ...]
    conserved_names: tuple[str, ...]
    sensitivity: tuple[str, ...]
    terms: Terms

    @property
    def record(self) -> Record:
        """The record of the run."""

    def count(self) -> int:
        """Return the number of samples."""

    def columns(self, names: Sequence[str]) -> Iterator[Mapping[str, Array]]:
        """Yield fields of `Samples` by name, in blocks that fit in memory.

        An output is ``outputs/NAME``. Without samples, nothing may be yielded.
        """

    def trajectory(self) -> Trajectory:
        """Return the whole trajectory."""


class FormatFunctions(NamedTuple):
    """Functions of a format.

    Parameters
    ----------
    check_target : callable of (path, force, meta)
        Raises the errors of a writer, as far as they can be determined in advance.
    open_writer : callable of (path, force, meta)
    open_reader : callable of (path)
    files : callable of (path)
        Returns the files that a writer writes or removes.
    """

    check_target: Callable[[str, bool, bool], None]
    open_writer: Callable[[str, bool, bool], AbstractContextManager[Writer]]
    open_reader: Callable[[str], AbstractContextManager[Reader]]
    files: Callable[[str], tuple[str, ...]]


class ResultFormat(NamedTuple):
    """A format of result files.

    Parameters
    ----------
    name : str
        Name in ``lagcli info --json``.
    title : str
        Name in messages.
    suffixes : tuple of str
        In lower case; messages suggest the first.
    functions : callable
        Imports the reader and the writer.
    sweeps : "all", "table" or ""
        Support for sweeps: all data, the table of measures, or none.
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
        *(trajectories.check_hdf5_target, trajectories.Hdf5Writer, trajectories.open_hdf5),
        lambda path: (path,),
    )


def _csv() -> FormatFunctions:
    from lagcli.results.csv import writer

    return FormatFunctions(writer.check_csv_target, writer.CsvWriter, _open_csv, writer.files_of)


def _open_csv(path: str) -> AbstractContextManager[Reader]:
    from lagcli.results.csv.reader import open_csv  # much that writing does not need

    return open_csv(path)


FORMATS = (
    ResultFormat("hdf5", "HDF5", (".h5", ".hdf5"), _hdf5, sweeps="all"),
    ResultFormat("csv", "CSV", (".csv",), _csv, sweeps="table", streams=True),
)
#: All suffixes, as a tuple for `str.endswith`.
MODEL_SUFFIXES = (".yaml", ".yml")
SUFFIXES = tuple(suffix for f in FORMATS for suffix in f.suffixes)
#: The suffixes in help texts.
SUFFIX_TEXT = " or ".join(f"{f.suffixes[0]} ({f.title})" for f in FORMATS)
SUFFIX_NAMES = " or ".join(f.suffixes[0] for f in FORMATS)


def format_of(path: str | os.PathLike[str]) -> ResultFormat:
    """Return the format of a file name.

    Parameters
    ----------
    path : str or path
        A file name; ``-``, standard output, has no format.

    Returns
    -------
    ResultFormat

    Raises
    ------
    UsageError
        The suffix, in any case, is unknown.
    """
    stem, suffix = os.path.splitext(os.fspath(path))
    if os.fspath(path) == "-":
        raise UsageError(
            "-: only a single run can be written to standard output; give a file name that ends in"
            f" {SUFFIX_NAMES}"
        )
    for known in FORMATS:
        if suffix.lower() in known.suffixes:
            return known
    names = " or ".join(f"{stem}{f.suffixes[0]} ({f.title})" for f in FORMATS)
    raise UsageError(
        f"{os.fspath(path)}: the suffix {suffix or '(none)'} is not a result format; use {names}"
    )


def format_read(path: str | os.PathLike[str]) -> ResultFormat:
    """Return the format of a file to read; see `format_of`.

    Raises
    ------
    UsageError
        The suffix is unknown, or that of model files.
    """
    stem, suffix = os.path.splitext(os.fspath(path))
    if suffix.lower() in MODEL_SUFFIXES:
        raise UsageError(
            f"{os.fspath(path)} is a model file, not a result;"
            f" `lagcli simulate {os.fspath(path)} -o {stem}.h5` makes one"
        )
    if stem == "-" and not suffix:
        raise UsageError("results cannot be read from standard input; save them to a file first")
    if not suffix:
        raise UsageError(
            f"{stem} is not the name of a result, which ends in {SUFFIX_NAMES}; of a model,"
            f" `lagcli simulate {stem} -o {stem}.h5` makes one"
        )
    return format_of(path)


def kind_of(path: str | os.PathLike[str]) -> str:
    """Return the kind of a file: ``trajectory``, ``sweep``, or the command of an analysis.

    Raises
    ------
    FileError, UsageError
        As `read`.
    """
    from lagcli.results.metadata import KIND

    if format_read(path).sweeps != "all":
        return KIND
    from lagcli.results.hdf5.opening import open_verified

    with open_verified(path) as opened:
        return opened.kind or KIND


def check_target(output: str | os.PathLike[str], force: bool = False, meta: bool = False) -> None:
    """Raise, before a long run, the errors that `write` would raise after it.

    Parameters
    ----------
    output, force, meta
        As for `write`.

    Raises
    ------
    FileError, UsageError
        As `write`, as far as they can be determined in advance.
    """
    path = os.fspath(output)
    _target_format(path).functions().check_target(path, force, meta)


def files_of(output: str) -> tuple[str, ...]:
    """Return the files that `write` writes or, with ``force``, removes; raises UsageError too."""
    return _target_format(output).functions().files(output)


def write(
    trajectory: Trajectory,
    output: str | os.PathLike[str],
    force: bool = False,
    meta: bool = False,
) -> None:
    """Write a trajectory in the format given by the suffix, atomically.

    For the parameters and errors see `lagcli.write`, which also writes results of analyses.
    """
    check_target(output, force, meta)
    with open_writer(output, force, meta) as writer:
        writer.append(trajectory)
        writer.finish(trajectory)


def open_writer(
    output: str | os.PathLike[str], force: bool = False, meta: bool = False
) -> AbstractContextManager[Writer]:
    """Return a writer for a run in progress; for the parameters and errors see `lagcli.write`.

    `check_target` checks in advance whether the file could be written.
    """
    path = os.fspath(output)
    return _target_format(path).functions().open_writer(path, force, meta)


def read(path: str | os.PathLike[str]) -> Trajectory:
    """Read the trajectory of a result file.

    Parameters
    ----------
    path : str or path
        A file written by `write`. In CSV, line ends may be ``\\r\\n``, and a byte order mark is
        allowed.

    Returns
    -------
    Trajectory
        Arrays are bit-equal to the written ones (in CSV, every NaN becomes Python's). Metadata that
        only the sidecar of a CSV file contains is empty without it: ``status`` and other texts are
        ``""``, mappings are empty, ``scale_position`` and ``scale_velocity`` are NaN.

    Raises
    ------
    FileError
        The file is missing, unreadable, truncated or damaged, or was not written by lagcli in a
        layout that this version supports; or a sidecar belongs to another CSV file.
    UsageError
        The suffix is unknown.
    """
    with open_reader(path) as file:
        return file.trajectory()


def open_reader(path: str | os.PathLike[str]) -> AbstractContextManager[Reader]:
    """Open a result file to read some of its columns; for the errors see `read`.

    They are raised when the context is entered, or when damaged data is read.
    """
    return format_read(path).functions().open_reader(os.fspath(path))


def _target_format(path: str) -> ResultFormat:
    """Return the format to write; ``-`` is the format for standard output."""
    return next(f for f in FORMATS if f.streams) if path == "-" else format_of(path)
