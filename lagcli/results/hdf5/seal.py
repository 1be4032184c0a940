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

#: Files whose checksum has been verified, by path and status: a plot opens its file several times.
_whole: set[tuple[Any, ...]] = set()


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


def is_sealed(path: str) -> bool:
    """Return whether a file ends with a checksum; raise an error if it does not match the contents.

    Parameters
    ----------
    path : str
        A regular file.

    Raises
    ------
    FileError
        The contents were changed, or the file cannot be read.
    """
    try:
        with open(path, "rb") as file:
            found = os.fstat(file.fileno())
            key = (path, found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns)
            if key in _whole:
                return True
            file.seek(max(0, found.st_size - LENGTH))
            line = file.read()
            if not line.startswith(_MARK):
                return False
            digest = _digest(file, found.st_size - LENGTH)
    except OSError as error:
        raise read_failure(path, error) from error
    if line != _MARK + digest + b"\n":
        raise FileError(
            f"cannot read {path}: the file is damaged, or was changed after lagcli wrote it (its"
            " checksum does not fit); copy it again, or run lagcli again"
        )
    _whole.add(key)
    return True


def _digest(file: BinaryIO, size: int) -> bytes:
    """Return the SHA-256 of the first bytes of a file, in hexadecimal."""
    digest = hashlib.sha256()
    file.seek(0)
    while size > 0 and (piece := file.read(min(size, _PIECE))):
        digest.update(piece)
        size -= len(piece)
    return digest.hexdigest().encode()
