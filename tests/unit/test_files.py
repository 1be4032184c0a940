"""Regular files, and the errors of others."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from lagcli.errors import FileError, UsageError
from lagcli.files import (
    check_readable,
    check_regular,
    read_failure,
    refuse_same_file,
    write_failure,
)


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


@pytest.mark.parametrize(
    ("number", "remedy"),
    [
        (errno.EEXIST, "--force"),
        (errno.ENOSPC, "free some space"),
        (errno.EROFS, "read-only file system"),
        (errno.EACCES, "choose a folder of your own"),
        (errno.ENAMETOOLONG, "shorter"),
        (errno.EIO, "choose another place"),
    ],
)
def test_a_write_that_fails_names_the_file_and_a_remedy(number: int, remedy: str) -> None:
    message = str(write_failure("out/run.h5", OSError(number, "said by the system")))
    assert "out/run.h5" in message
    assert remedy in message


def test_a_missing_folder_is_distinguished_from_other_missing_things(tmp_path: Path) -> None:
    error = OSError(errno.ENOENT, "no such file")
    missing = str(write_failure(str(tmp_path / "my runs" / "run.h5"), error))
    assert f"mkdir -p '{tmp_path}/my runs'" in missing
    assert "mkdir" not in str(write_failure(str(tmp_path / "run.h5"), error))


def test_an_empty_file_is_not_readable(tmp_path: Path) -> None:
    (tmp_path / "run.csv").touch()
    with pytest.raises(FileError, match="it is empty"):
        check_readable(str(tmp_path / "run.csv"))
    (tmp_path / "run.csv").write_text("t\n")
    check_readable(str(tmp_path / "run.csv"))


def test_a_model_is_not_overwritten_by_its_result(tmp_path: Path) -> None:
    model = tmp_path / "model.yaml"
    model.write_text("T: 0")
    (tmp_path / "link.h5").symlink_to(model)
    with pytest.raises(UsageError, match="is the model itself"):
        refuse_same_file(str(model), str(tmp_path / "link.h5"))
    for output in (None, "-", str(tmp_path / "other.h5")):
        refuse_same_file(str(model), output)
