"""Opening of HDF5 files, which may be damaged or hostile.

The checksum at the end of a file is verified before the HDF5 library reads it: damage could make
the library loop or crash.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import h5py

from lagcli.errors import FileError
from lagcli.files import check_readable, read_failure
from lagcli.results.hdf5.seal import check_seal
from lagcli.results.hdf5.structure import text_attribute
from lagcli.trajectory.samples import SCHEMA_VERSION

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: Start of files of HDF5 1.8 and newer: signature, version, and end of the file.
_SUPERBLOCK = struct.Struct("<8sB19xQ")

#: Errors by which h5py, and the interpretation of the contents, report damage.
DAMAGE = (
    *(OSError, RuntimeError, LookupError, ValueError, TypeError, AttributeError),
    *(ArithmeticError, MemoryError),
)


class Opened(NamedTuple):
    """An open file.

    Parameters
    ----------
    root : h5py.File
    kind : str
        ``trajectory``, ``sweep``, or the command of an analysis.
    """

    root: h5py.File
    kind: str


@contextmanager
def open_verified(path: str | os.PathLike[str]) -> Iterator[Opened]:
    """Open an HDF5 file written by lagcli.

    Parameters
    ----------
    path : str or path

    Yields
    ------
    Opened

    Raises
    ------
    FileError
        The file is missing or unreadable, is not HDF5 or not from lagcli, is truncated, changed or
        damaged, or has another layout. Errors in the block caused by the file's contents count as
        damage.
    """
    path = os.fspath(path)
    check_readable(path)
    _check_start(path)
    check_seal(path)
    try:
        # By Python's file object, HDF5 neither locks the file, which some network file systems do
        # not support, nor compares it with those that the process has open in other modes. A file
        # under its final name is complete and does not change.
        with open(path, "rb") as file, h5py.File(file, "r") as root:
            stated = text_attribute(root, "schema_version")
            if stated != SCHEMA_VERSION:
                raise _other_version(path, stated, text_attribute(root, "lagcli_version"))
            yield Opened(root, text_attribute(root, "kind") or "")
    except DAMAGE as error:
        raise damage(path, error) from error


def damage(path: str, error: Exception) -> FileError:
    """Return the error for a file with invalid contents."""
    if isinstance(error, MemoryError):
        return FileError(
            f"cannot read {path}: its contents do not fit into the memory; close other programs,"
            " raise the limit (ulimit -v), or read it piece by piece with h5py"
        )
    reason = str(error) or type(error).__name__
    if isinstance(error, KeyError):  # its text is the repr of the reason
        reason = str(error.args[0])
    return FileError(
        f"cannot read {path}: the file is cut short or damaged ({reason}); copy it again, or run"
        " lagcli again"
    )


def not_of_lagcli(path: str) -> FileError:
    """Return the error for an HDF5 file of another program."""
    return FileError(
        f"cannot read {path}: it is an HDF5 file, but not one of lagcli; "
        "name a result file of lagcli simulate or lagcli sweep"
    )


def _other_version(path: str, stated: str | None, writer: str | None) -> FileError:
    if stated is None:
        return not_of_lagcli(path)
    return FileError(
        f"cannot read {path}: its layout has version {stated}, and this lagcli supports"
        f" {SCHEMA_VERSION}; read it with lagcli {writer}"
    )


def _check_start(path: str) -> None:
    """Raise an error unless a file begins as HDF5, and has the length given there."""
    try:
        with open(path, "rb") as file:
            start = file.read(_SUPERBLOCK.size)
            size = file.seek(0, os.SEEK_END)
    except OSError as error:
        raise read_failure(path, error) from error
    if not start.startswith(_SIGNATURE):
        raise FileError(
            f"cannot read {path}: it is not an HDF5 file; name a result file of lagcli simulate"
        )
    if len(start) < _SUPERBLOCK.size:
        raise damage(path, ValueError(f"it has {size} bytes"))
    _, version, end = _SUPERBLOCK.unpack(start)
    if version in (2, 3) and size < end:
        raise damage(path, ValueError(f"it has {size} of {end} bytes"))
