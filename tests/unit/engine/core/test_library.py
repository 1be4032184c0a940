"""A library that is not that of the sources is refused, with what to do."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lagcli.engine.core import fingerprint
from lagcli.engine.core.library import AVX2, KERNEL, LIBRARY, NATIVE, PORTABLE, check

ROOT = Path(__file__).parents[4]
PACKAGE = Path("lagcli") / "engine" / "core"


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A copy of the package with its library, without the record of the files' times."""
    without = shutil.ignore_patterns("*.sources")
    shutil.copytree(ROOT / "lagcli", tmp_path / "lagcli", ignore=without)
    return tmp_path


def loaded(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command that needs the core."""
    return subprocess.run(
        [sys.executable, "-m", "lagcli", "simulate", ROOT / "models" / "slider_crank.yaml"],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
    )


def test_the_library_of_the_same_sources_is_loaded(checkout: Path) -> None:
    assert loaded(checkout).returncode == 0


@pytest.mark.parametrize(
    "changed",
    [
        "step.c",
        "lagcore.h",
        "batch/batch_tape.h",
        "../tape/operations.py",
    ],
)
def test_a_library_of_other_sources_is_refused(checkout: Path, changed: str) -> None:
    with (checkout / PACKAGE / changed).open("a") as file:
        file.write("\nLONGEST += 1\n" if changed.endswith(".py") else "\n")
    done = loaded(checkout)
    assert done.returncode == 4
    assert done.stderr.startswith("error[core]: ")
    assert "was compiled from other sources than those beside it" in done.stderr
    assert f"python -m pip install --no-deps --editable .` in {checkout}" in done.stderr


@pytest.mark.parametrize("changed", ["headers.py", "../layout.py", "../../errors.py"])
def test_modules_that_write_the_same_headers_are_the_same_sources(
    checkout: Path, changed: str
) -> None:
    with (checkout / PACKAGE / changed).open("a") as file:
        file.write("\n# a comment\n")
    done = loaded(checkout)
    assert done.returncode == 0, done.stderr


def test_the_record_of_times_does_not_hide_a_change(checkout: Path) -> None:
    """The record is that of the build; a file that has changed since is another."""
    folder = checkout / PACKAGE
    fingerprint.record_in(folder).write_text(fingerprint.record(fingerprint.sources()))
    assert loaded(checkout).returncode == 0
    with (folder / "step.c").open("a") as file:
        file.write("\n")
    assert loaded(checkout).returncode == 4


def test_without_the_library_the_remedy_is_named(checkout: Path) -> None:
    fingerprint.library_in(checkout / PACKAGE).unlink()
    done = loaded(checkout)
    assert done.returncode == 4
    assert "the numerical core was not compiled: there is no" in done.stderr
    assert "python -m pip install --no-deps --editable ." in done.stderr


def test_a_library_that_cannot_be_loaded_is_named(checkout: Path) -> None:
    fingerprint.library_in(checkout / PACKAGE).write_bytes(b"no library")
    done = loaded(checkout)
    assert done.returncode == 4
    assert "the numerical core cannot be loaded: " in done.stderr


def test_a_library_without_sources_beside_it_is_loaded(checkout: Path) -> None:
    """As a wheel installs it."""
    for path in (checkout / PACKAGE).rglob("*.[ch]"):
        path.unlink()
    assert loaded(checkout).returncode == 0


def test_the_library_is_that_of_this_folder() -> None:
    assert fingerprint.library_in(fingerprint.CORE) == LIBRARY
    assert KERNEL in (PORTABLE, AVX2, NATIVE)


def test_a_function_without_memory_raises() -> None:
    check(0)
    check(None)
    with pytest.raises(MemoryError):
        check(1)
