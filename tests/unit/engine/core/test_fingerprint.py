"""What the core's library is compiled from."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from lagcli.engine.core import fingerprint

ROOT = Path(__file__).parents[4]


def test_sources_are_all_c_files_and_headers_that_are_not_generated() -> None:
    listed = {path for path in fingerprint.sources() if path.endswith((".c", ".h"))}
    there = {str(path.relative_to(fingerprint.CORE)) for path in fingerprint.CORE.rglob("*.[ch]")}
    assert listed == there - set(fingerprint.GENERATED)


def test_all_that_the_headers_are_made_of_is_a_source() -> None:
    """Also what the modules import that `headers` imports."""
    code = "import sys; import lagcli.engine.core.headers; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    tables = {
        path.name
        for path in (ROOT / f"{name.replace('.', '/')}.py" for name in done.stdout.split())
        if path.is_relative_to(ROOT / "lagcli") and path.exists()
    }
    assert tables - {"version.py"} == {Path(path).name for path in fingerprint._tables()}


def test_a_record_is_true_until_a_file_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fingerprint, "CORE", tmp_path)
    for name in ("a.c", "b.h"):
        (tmp_path / name).write_text("1\n")
    assert not fingerprint.unchanged()
    text = fingerprint.record(["a.c", "b.h"])
    fingerprint.record_in(tmp_path).write_text(text)
    assert fingerprint.unchanged()
    (tmp_path / "b.h").write_text("12\n")
    assert not fingerprint.unchanged()
    fingerprint.record_in(tmp_path).write_text(fingerprint.record(["a.c", "b.h"]))
    assert fingerprint.unchanged()
    (tmp_path / "a.c").unlink()
    assert not fingerprint.unchanged()
