"""Atomic writing: a file name appears only once the complete file is on disk."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any, BinaryIO, Self

from lagcli.errors import FileError
from lagcli.files import exists, write_failure


def check_writable(path: str, force: bool = False) -> None:
    """Raise an error if a file could not be created under this name now.

    Parameters
    ----------
    path : str
        Path of the new file.
    force : bool
        Whether an existing file may be replaced.

    Raises
    ------
    FileError
        The name exists and ``force`` is false; it is a folder, a pipe or a device; its folder is
        missing, not a folder, or not writable.
    """
    target, hidden = _names(path, force)
    try:
        # Only a trial is reliable: os.access ignores immutable folders and restrictions on root.
        file = _open_unnamed(os.path.dirname(target))
        if file is None:
            file = _open_hidden(hidden)
            os.unlink(hidden)
        file.close()
    except OSError as error:
        raise write_failure(path, error) from error


def write_file(path: str, content: bytes, force: bool) -> None:
    """Write a file as a whole; for the parameters and errors see `whole_file`."""
    with whole_file(path, force) as file:
        file.write(content)


@contextmanager
def whole_file(path: str, force: bool = False, sync: bool = True) -> Iterator[BinaryIO]:
    """Open a file that gets its name on success and is discarded on failure.

    On Linux the file has no name until it is complete and synced, so that even ``kill -9``
    leaves nothing behind. Elsewhere, and on file systems without ``O_TMPFILE``, it grows under a
    hidden name (``.lagcli-PID-…``) in the same folder, which is removed on any error; only a
    kill leaves that. The file's mode follows the umask. A symbolic link is followed.

    Parameters
    ----------
    path : str
        The final name.
    force : bool
        Replace an existing file, atomically. Otherwise an existing file is never changed, and of
        several writers of one name exactly one succeeds.
    sync : bool
        Sync the file before it is named, and its folder after that; otherwise the caller does.

    Yields
    ------
    binary file
        Open for reading and writing, seekable.

    Raises
    ------
    FileError
        As `check_writable`; also if the disk is full, or the system reports another error. An
        ``OSError`` from the block counts as an error of this file.
    """
    target, hidden = _names(path, force)
    folder = os.path.dirname(target)
    try:
        try:
            file = _open_unnamed(folder)
            unnamed = file is not None
            with file or _open_hidden(hidden) as file:
                yield file
                file.flush()
                if sync:
                    os.fsync(file.fileno())
                if unnamed and not _name_unnamed(file, hidden, target, force):
                    unnamed = False
                    _copy(file, hidden)
            if not unnamed:
                _name_hidden(hidden, target, force)
        finally:
            with suppress(FileNotFoundError):
                os.unlink(hidden)
    except OSError as error:
        raise write_failure(path, error) from error
    if sync:
        sync_folder(folder)


class FileWriter:
    """Context manager for writing files; unfinished files are removed.

    Attributes
    ----------
    opened : ExitStack
        Contains their `whole_file` contexts; closing it completes the files.
    """

    def __init__(self) -> None:
        self.opened = ExitStack()
        self._files: list[tuple[str, BinaryIO]] = []

    def open_file(self, path: str, force: bool) -> BinaryIO:
        """Return a new file of several, whose names `name_files` gives; see `whole_file`."""
        file = self.opened.enter_context(whole_file(path, force, sync=False))
        self._files.append((path, file))
        return file

    def name_files(self) -> None:
        """Give the files their names, the last opened first, once all of them are on disk.

        Nothing waits for the disk between two names: a kill is unlikely to separate the files.
        """
        for path, file in self._files:
            try:
                file.flush()
                os.fsync(file.fileno())
            except OSError as error:
                raise write_failure(path, error) from error
        self.opened.close()
        for folder in {os.path.dirname(os.path.realpath(path)) for path, _ in self._files}:
            sync_folder(folder)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: Any) -> None:
        error = raised[1] or RuntimeError("not finished")
        self.opened.__exit__(type(error), error, error.__traceback__)


def _names(path: str, force: bool) -> tuple[str, str]:
    """Return the path of the file and a hidden name; raise an error if the path is unavailable."""
    try:
        target = os.path.realpath(path)
        with suppress(FileNotFoundError):
            mode = os.stat(target).st_mode
            if stat.S_ISDIR(mode):
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            if not stat.S_ISREG(mode):
                raise FileError(
                    f"cannot write {path}: it is not a regular file; choose another name, or "
                    "give - to write CSV to standard output"
                )
            if not force:
                raise exists(path)
    except OSError as error:
        raise write_failure(path, error) from error
    except ValueError as error:  # not a valid file name
        raise FileError(f"cannot write {path!r}: {error}") from None
    hidden = f".lagcli-{os.getpid()}-{os.urandom(8).hex()}"
    return target, os.path.join(os.path.dirname(target), hidden)


def _open_unnamed(folder: str) -> BinaryIO | None:
    """Return an unnamed file in the folder; None if the system does not support it."""
    if not hasattr(os, "O_TMPFILE") or not os.path.isdir("/proc/self/fd"):
        return None
    try:
        return os.fdopen(os.open(folder, os.O_TMPFILE | os.O_RDWR, 0o666), "w+b")
    except OSError:
        # Kernels and file systems report this differently. Other causes (permission, disk space)
        # also affect opening the hidden file, which reports them.
        return None


def _open_hidden(hidden: str) -> BinaryIO:
    """Return a new file of this name."""
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    return os.fdopen(os.open(hidden, flags, 0o666), "w+b")


def _name_unnamed(file: BinaryIO, hidden: str, target: str, force: bool) -> bool:
    """Give the unnamed file its name; return False if the system cannot link it."""
    source = f"/proc/self/fd/{file.fileno()}"
    try:
        _link_followed(source, target)
    except FileExistsError:
        if not force:
            raise
        _link_followed(source, hidden)
        os.replace(hidden, target)
    except OSError:
        # A sandbox may hide /proc or forbid linking from it: the bytes can still be copied.
        return False
    return True


def _link_followed(source: str, target: str) -> None:
    """Link the file to which a symbolic link in /proc points."""
    # Python calls linkat(AT_SYMLINK_FOLLOW) only when it gets a dir_fd; plain link() would try
    # to link the symbolic link itself.
    folder = os.open(os.path.dirname(target), os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.link(source, os.path.basename(target), dst_dir_fd=folder, follow_symlinks=True)
    finally:
        os.close(folder)


def _copy(file: BinaryIO, hidden: str) -> None:
    """Copy the whole file under the hidden name and sync it."""
    import shutil  # compression libraries, which are rarely needed

    file.seek(0)
    with _open_hidden(hidden) as copy:
        shutil.copyfileobj(file, copy, 1 << 20)
        copy.flush()
        os.fsync(copy.fileno())


def _name_hidden(hidden: str, target: str, force: bool) -> None:
    """Give the closed hidden file its name."""
    if force:
        os.replace(hidden, target)
        return
    try:
        os.link(hidden, target)
    except FileExistsError:
        raise
    except OSError:
        # No hard links here (FAT, some network file systems): reserve the name, which fails if
        # it is taken, then replace the reservation. A kill in between leaves an empty file.
        os.close(os.open(target, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        try:
            os.replace(hidden, target)
        except OSError:
            os.unlink(target)
            raise


def sync_folder(folder: str) -> None:
    """Sync new names in a folder to the disk, if the system supports it."""
    # The file is in place and synced; that a folder cannot be synced (some network file systems,
    # Windows) is nothing the user could fix.
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
