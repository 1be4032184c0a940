"""Checks of regular files before they are read, with errors that state the path and a remedy."""

from __future__ import annotations

import errno
import os
import shlex
import stat

from lagcli.errors import FileError


def read_failure(path: str, error: OSError) -> FileError:
    """Return the error for a file that cannot be read."""
    match error.errno:
        case errno.ENOENT:
            reason = "there is no such file; check the name and the folder"
        case errno.EACCES | errno.EPERM:
            reason = f"no permission to read it; ask its owner, or chmod u+r {shlex.quote(path)}"
        case errno.EISDIR:
            reason = "it is a folder; give the name of a file in it"
        case _:
            reason = error.strerror or str(error)
    return FileError(f"cannot read {path}: {reason}")


def check_regular(path: str) -> int:
    """Return the size of a regular file that can be opened, in bytes.

    Parameters
    ----------
    path : str

    Raises
    ------
    FileError
        It is missing, a folder, a pipe or device, or not readable.
    """
    try:
        # O_NONBLOCK: opening a pipe without a writer must not block
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    except OSError as error:
        raise read_failure(path, error) from error
    except ValueError as error:  # not a valid file name
        raise FileError(f"cannot read {path!r}: {error}") from None
    try:
        found = os.fstat(descriptor)
    finally:
        os.close(descriptor)
    if stat.S_ISDIR(found.st_mode):
        raise read_failure(path, IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR)))
    if not stat.S_ISREG(found.st_mode):
        raise FileError(f"cannot read {path}: it is not a regular file; save it to one first")
    return found.st_size
