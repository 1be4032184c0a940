"""The checksum at the end of an HDF5 result file, verified before the HDF5 library reads it.

HDF5 has checksums for some of its structures, but not for numbers and texts, and undetected damage
can make the library loop. A sealed file has one line of `LENGTH` bytes after the end of the HDF5
data, ``lagcli sha256 DIGEST``: the SHA-256 of all preceding bytes. Other programs ignore the line.
"""

from __future__ import annotations

import hashlib
import os
from typing import Any, BinaryIO

from lagcli.errors import FileError
from lagcli.files import read_failure

_MARK = b"\nlagcli sha256 "
_DIGITS = 64
#: Length of the line, bytes.
LENGTH = len(_MARK) + _DIGITS + 1
_PIECE = 1 << 20
#: Place of the flags in the superblock of HDF5, and their value while a program writes the file.
_FLAGS, _WRITING = 11, b"\x01"

#: Files whose checksum has been verified, by path and status: a plot opens its file several times.
_verified: set[tuple[Any, ...]] = set()


def seal(file: BinaryIO) -> None:
    """Append the checksum of a file to it.

    Parameters
    ----------
    file : binary file
        Open for reading and writing.
    """
    size = file.seek(0, os.SEEK_END)
    digest = _digest(file, size)
    file.seek(0, os.SEEK_END)
    file.write(_MARK + digest + b"\n")


def check_seal(path: str) -> None:
    """Raise an error unless a file ends with the checksum of its contents.

    Parameters
    ----------
    path : str
        A regular file.

    Raises
    ------
    FileError
        The checksum is missing or does not match the contents, or the file cannot be read.
    """
    try:
        with open(path, "rb") as file:
            status = os.fstat(file.fileno())
            key = (path, status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)
            if key in _verified:
                return
            end = max(0, status.st_size - LENGTH)
            file.seek(end)
            line = file.read()
            expected = _MARK + _digest(file, end) + b"\n" if line.startswith(_MARK) else None
            file.seek(_FLAGS)
            writing = line != expected and file.read(1) == _WRITING
    except OSError as error:
        raise read_failure(path, error) from error
    if writing:
        raise FileError(
            f"cannot read {path}: a program has it open for writing, or was stopped while it wrote;"
            " close it there, and read result files in the mode `r` of h5py, which does not change"
            " them"
        )
    if expected is None:
        raise FileError(
            f"cannot read {path}: the checksum at its end is missing: the file is cut short, was"
            " changed by another program, or was not written by lagcli; copy it again, or run"
            " lagcli again"
        )
    if line != expected:
        raise FileError(
            f"cannot read {path}: the file is damaged, or was changed after lagcli wrote it (its"
            " checksum does not fit); copy it again, or run lagcli again"
        )
    _verified.add(key)


def _digest(file: BinaryIO, size: int) -> bytes:
    """Return the SHA-256 of the first bytes of a file, in hexadecimal."""
    digest = hashlib.sha256()
    file.seek(0)
    while size > 0 and (piece := file.read(min(size, _PIECE))):
        digest.update(piece)
        size -= len(piece)
    return digest.hexdigest().encode()
