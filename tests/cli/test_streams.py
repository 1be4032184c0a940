"""Standard streams that are closed or full, and text that holds commands to the terminal."""

from __future__ import annotations

import csv
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from lagcli.cli.streams import visible, visible_json

ROOT = Path(__file__).parents[2]
CRANK = str(ROOT / "models" / "slider_crank.yaml")
HOSTILE = str(ROOT / "tests" / "found" / "hostile" / "terminal-escapes.yaml")
SHORT = "--t-end 0.1 --samples 3"
FULL = pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")


def shell(
    arguments: str, streams: str = "", **variables: str
) -> subprocess.CompletedProcess[bytes]:
    """Run the program in a shell that leads its streams elsewhere."""
    return subprocess.run(
        f"{shlex.quote(sys.executable)} -m lagcli {arguments} {streams}",
        shell=True,
        capture_output=True,
        env={**os.environ, "PYTHONPATH": str(ROOT), **variables},
        check=False,
    )


def test_formulas_are_readable_in_an_encoding_without_greek_letters() -> None:
    found = shell("derive pendulum_cartesian", PYTHONIOENCODING="ascii")
    assert found.returncode == 0
    text = found.stdout.decode("ascii")
    assert "  rod:  x^2 + y^2" in text
    assert "  y:  m y'' + m g = 2 lambda y" in text
    wrong = shell("derive slider_crank --set m=½½", PYTHONIOENCODING="cp437")
    assert wrong.returncode == 2
    assert b"Traceback" not in wrong.stderr


@pytest.mark.parametrize(
    "streams", [">&- 2>&- <&-", pytest.param(">/dev/full 2>/dev/full", marks=FULL)]
)
def test_a_result_file_needs_no_streams(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, streams: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert shell(f"simulate {CRANK} {SHORT} -o run.h5", streams).returncode == 0
    with h5py.File("run.h5") as root:
        assert root.attrs["status"] in ("completed", b"completed")
        np.testing.assert_array_equal(root["time"], [0, 0.05, 0.1])
    assert os.listdir() == ["run.h5"]


def test_a_sweep_needs_no_streams(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    peak = "--measure 'max(phi)' --vary m=1,0 -o s.csv --jobs 2"
    assert shell(f"sweep {CRANK} {SHORT} {peak}", ">&- 2>&-").returncode == 3
    with open("s.csv", newline="") as file:
        assert [row["status"] for row in csv.DictReader(file)] == ["completed", "failed"]


@pytest.mark.parametrize(
    ("arguments", "streams"),
    [
        pytest.param(f"derive {CRANK}", ">/dev/full", marks=FULL),
        (f"simulate {CRANK} {SHORT} -o -", ">&-"),
        (f"play {CRANK} --no-browser", ">&-"),
    ],
)
def test_a_result_that_cannot_be_printed_is_an_error(arguments: str, streams: str) -> None:
    found = shell(arguments, streams)
    assert found.returncode == 4
    reason = b"it is closed" if streams == ">&-" else b"the disk is full"
    assert found.stderr.startswith(b"error: cannot write standard output: " + reason)


@pytest.mark.parametrize(
    ("arguments", "streams", "status"),
    [
        ("simulate --nonsense", "2>&-", 2),
        pytest.param("simulate nothing.yaml", "2>/dev/full", 4, marks=FULL),
        pytest.param("simulate nothing.yaml --json", ">/dev/full 2>/dev/full", 4, marks=FULL),
    ],
)
def test_errors_that_cannot_be_printed_keep_their_status(
    arguments: str, streams: str, status: int
) -> None:
    found = shell(arguments, streams)
    assert (found.returncode, found.stdout, found.stderr) == (status, b"", b"")


# text that a terminal would obey

OBEYED = re.compile(rb"[\x00-\x08\x0b-\x1f\x7f]")


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (f"derive $'{CRANK}\\e[31m'", 4),
        (f"simulate {CRANK} {SHORT} -o $'x\\e[31m.csv'", 0),
        (f"simulate {CRANK} --set $'m\\e[31m=1'", 2),
    ],
)
def test_escape_sequences_are_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: str, status: int
) -> None:
    monkeypatch.chdir(tmp_path)
    found = shell(arguments.replace("$'", "'").replace("\\e", "\x1b"))
    assert found.returncode == status
    assert not OBEYED.search(found.stdout + found.stderr)
    assert rb"\x1b[31m" in found.stdout + found.stderr


def test_escape_sequences_of_a_model_are_refused() -> None:
    found = shell(f"derive {HOSTILE}")
    assert (found.returncode, found.stdout) == (2, b"")
    assert not OBEYED.search(found.stderr)
    assert b"U+001B" in found.stderr


def test_what_is_visible() -> None:
    assert visible("a\tb\nλ₁ é 高 ½") == "a\tb\nλ₁ é 高 ½"
    assert visible("\x1b[2J\r\x07\x9b\u202e\u2066\u200f\x7f") == (
        r"\x1b[2J\r\x07\x9b\u202e\u2066\u200f\x7f"
    )
    assert visible("\ud800\u2028") == r"\ud800\u2028"
    text = "\x1b\x9b\u202e\x7fλ"
    shown = visible_json(json.dumps(text, ensure_ascii=False))
    assert json.loads(shown) == text
    assert shown == r'"\u001b\u009b\u202e\u007fλ"'


def test_python_may_leave_assertions_and_docstrings_out() -> None:
    found = shell(f"simulate slider_crank {SHORT} -o -", PYTHONOPTIMIZE="2")
    assert found.returncode == 0, found.stderr
    assert found.stdout == shell(f"simulate slider_crank {SHORT} -o -").stdout
