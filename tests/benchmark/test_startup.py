"""Instructions of short commands, counted by Valgrind: docs/decisions/2026-11-start-up.md."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from startup import MODEL

#: Largest numbers of instructions with Python 3.11.
LIMITS = {"--help": 400_000_000, f"simulate {MODEL} -q": 1_046_000_000}


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
@pytest.mark.parametrize("words", LIMITS)
def test_commands_start_quickly(words: str, tmp_path: Path) -> None:
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPYCACHEPREFIX"] = str(tmp_path)
    command = [sys.executable, "-m", "lagcli", *words.split()]
    subprocess.run(command, env=environment, check=True, capture_output=True)  # writes bytecode
    counter = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={tmp_path / 'calls'}"]
    done = subprocess.run(
        [*counter, *command], env=environment, check=True, capture_output=True, text=True
    )
    found = re.search(r"Collected : (\d+)", done.stderr)
    assert found is not None
    assert int(found[1]) <= LIMITS[words]
