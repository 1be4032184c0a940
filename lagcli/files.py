"""Errors of reading and writing files, with path and remedy; checks before a file is read."""

from __future__ import annotations

import errno
import os
import shlex
import stat

from lagcli.errors import FileError, UsageError


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
        status = os.fstat(descriptor)
    finally:
        os.close(descriptor)
    if stat.S_ISDIR(status.st_mode):
        raise read_failure(path, IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR)))
    if not stat.S_ISREG(status.st_mode):
        raise FileError(f"cannot read {path}: it is not a regular file; save it to one first")
    return status.st_size


def refuse_same_file(source: str, output: str | None, what: str = "the model itself") -> None:
    """Refuse to overwrite a file that is read, even with --force; ``-`` is no file."""
    if output and output != "-" and source != "-":
        try:
            same = os.path.samefile(output, source)
        except (OSError, ValueError):  # one of them does not exist, or is not a valid path
            return
        if same:
            raise UsageError(f"{output} is {what}; choose another name for the result")


def shown_path(path: str | os.PathLike[str]) -> str:
    """Return a path as text for files and pictures: with ? in place of bytes that are not UTF-8."""
    return os.fspath(path).encode(errors="replace").decode()


def exists(path: str) -> FileError:
    """Return the error for an existing file."""
    return FileError(f"{path} exists already; give --force to overwrite it, or another name")


def write_failure(path: str, error: OSError) -> FileError:
    """Return the error for a failed write."""
    folder = os.path.dirname(path) or "."
    match error.errno:
        case errno.EEXIST:
            return exists(path)
        case errno.ENOSPC | errno.EDQUOT:
            reason = "the disk is full (or your quota is); free some space, or write elsewhere"
        case errno.EFBIG:
            reason = "the file is larger than allowed here; raise the limit (ulimit -f)"
        case errno.EACCES | errno.EPERM:
            reason = f"no permission to write in {folder}; choose a folder of your own"
        case errno.EROFS:
            reason = f"{folder} is on a read-only file system; choose another folder"
        case errno.ENOENT if not os.path.isdir(folder):  # /proc says ENOENT to any new file
            import shlex

            reason = f"there is no folder {folder}; create it with: mkdir -p {shlex.quote(folder)}"
        case errno.ENOTDIR:
            reason = f"{folder} is not a folder; choose another name"
        case errno.EBADF:
            reason = "it is closed; redirect it to a file, or write with -o"
        case errno.EISDIR:
            reason = "it is a folder; give the name of a file in it"
        case errno.ENAMETOOLONG:
            reason = "the name is too long for the file system; choose a shorter one"
        case _:
            reason = f"{error.strerror or error}; choose another place if this persists"
    return FileError(f"cannot write {path}: {reason}")


def check_readable(path: str) -> None:
    """Raise unless the path is a regular file that can be opened and is not empty.

    Parameters
    ----------
    path : str
        The file.

    Raises
    ------
    FileError
        It is missing, a folder, pipe or device, empty, or not readable.
    """
    if check_regular(path) == 0:
        raise FileError(f"cannot read {path}: it is empty; run the simulation again")
