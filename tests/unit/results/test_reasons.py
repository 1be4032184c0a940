"""Errors of the system as messages with a remedy."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from lagcli.errors import FileError
from lagcli.results.reasons import check_readable, write_failure


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
