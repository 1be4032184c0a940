"""Regular files, and the errors of others."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from lagcli.errors import FileError
from lagcli.files import check_regular, read_failure


def test_a_regular_file_has_its_size(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes(b"12345")
    assert check_regular(str(path)) == 5


def test_what_is_no_regular_file_is_rejected_without_waiting_for_it(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path, message in (
        (pipe, "not a regular file"),
        (tmp_path, "it is a folder"),
        (tmp_path / "none", "there is no such file"),
        ("a\0b", "null"),
    ):
        with pytest.raises(FileError, match=message):
            check_regular(str(path))


def test_a_path_in_a_remedy_is_one_word_for_a_shell() -> None:
    error = read_failure("my run.h5", PermissionError(errno.EACCES, "denied"))
    assert "chmod u+r 'my run.h5'" in str(error)
    assert str(read_failure("x", OSError(errno.EIO, "bad disk"))).endswith(": bad disk")
