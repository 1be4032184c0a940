"""Opening of HDF5 files, which may be damaged or hostile.

The checksum of a sealed file is verified before the HDF5 library reads it. Files of layout 1 have
none; a separate process, which may loop or crash safely, converts them to the current layout.
"""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import h5py

from lagcli.errors import FileError
from lagcli.files import read_failure
from lagcli.results.hdf5.seal import is_sealed
from lagcli.results.hdf5.structure import text_attribute
from lagcli.results.reasons import check_readable

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: Start of files of HDF5 1.8 and newer: signature, version, and end of the file.
_SUPERBLOCK = struct.Struct("<8sB19xQ")
#: Time limit for converting layout 1, s, and additional bytes per second.
_SECONDS, _RATE = 20.0, 1 << 21

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
        ``trajectory`` or ``sweep``.
    layout : str
        The version of the layout of the original file.
    """

    root: h5py.File
    kind: str
    layout: str


@contextmanager
def open_verified(path: str | os.PathLike[str], version: str) -> Iterator[Opened]:
    """Open an HDF5 file written by lagcli.

    Parameters
    ----------
    path : str or path
    version : str
        The layout supported by the caller; layout 1 is converted to it.

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
    layout = version if is_sealed(path) else "1"
    source = path if layout == version else _copy_of(path, version)
    try:
        # A file under its final name is complete and does not change: no lock is needed, and some
        # network file systems have none.
        with h5py.File(source, "r", locking=False) as root:
            found = text_attribute(root, "schema_version")
            if found != version:
                raise _other_version(path, found, version, text_attribute(root, "lagcli_version"))
            yield Opened(root, text_attribute(root, "kind") or "", layout)
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


def _other_version(path: str, found: str | None, known: str, writer: str | None) -> FileError:
    if found is None:
        return not_of_lagcli(path)
    return FileError(
        f"cannot read {path}: its layout has version {found}, and this lagcli supports {known};"
        f" read it with lagcli {writer}"
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


#: Folder of the last conversion of a file of layout 1, by the file's status.
_copies: dict[tuple[object, ...], tempfile.TemporaryDirectory[str]] = {}


def _copy_of(path: str, version: str) -> str:
    """Return the name of a copy in the current layout, which is deleted when the process ends."""
    found = os.stat(path)
    key = (path, found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns)
    if key not in _copies:
        while _copies:
            _copies.popitem()[1].cleanup()
        folder = tempfile.TemporaryDirectory(prefix="lagcli-")
        copy = os.path.join(folder.name, "copy.h5")
        try:
            _copy(path, copy, version, _SECONDS + found.st_size / _RATE)
        except BaseException:
            folder.cleanup()
            raise
        _copies[key] = folder
    return os.path.join(_copies[key].name, "copy.h5")


def _copy(path: str, copy: str, version: str, seconds: float) -> None:
    """Convert a file of layout 1 to the current layout, in a separate process."""
    # -P: no module is imported from the current folder
    command = [sys.executable, "-P", "-m", "lagcli.results.hdf5.layout1", path, copy, version]
    try:
        done = subprocess.run(command, capture_output=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        reason = RuntimeError(f"reading it does not end within {seconds:.0f} s")
        raise damage(path, reason) from None
    except OSError as error:
        raise FileError(
            f"cannot read {path}: it has layout 1 or is damaged, and the process that reads such"
            f" files cannot be started ({error.strerror or error})"
        ) from error
    if done.returncode == FileError.exit_status:
        raise FileError(done.stdout.decode(errors="replace"))
    if done.returncode:
        reason = RuntimeError(f"the process that reads it ended with status {done.returncode}")
        raise damage(path, reason)
