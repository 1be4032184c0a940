"""Examples of the documentation, run in this process where no shell is needed."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from lagcli.cli.app import run

_SHELL = re.compile(r"[|<>&;$`]")


class Examples:
    """Runs examples in a folder with the models and, for a shell to find, lagcli.

    Parameters
    ----------
    place : Path
        The folder, which is the current one.
    output : pytest.CaptureFixture
        What is printed.
    """

    def __init__(self, place: Path, output: pytest.CaptureFixture[str]):
        self.place, self.output = place, output
        program = place / "bin" / "lagcli"
        program.parent.mkdir()
        program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m lagcli "$@"\n')
        program.chmod(0o755)

    def run(self, kind: str, text: str) -> str:
        """Run an example that must succeed, without warnings; return what it prints."""
        lines = text.replace("\\\n", " ").splitlines()
        if kind == "python":
            exec(compile(text, "example", "exec"), {"__name__": "__main__"})
        elif not _SHELL.search(text) and all(line.startswith("lagcli ") for line in lines):
            for line in lines:
                assert run(shlex.split(line)[1:]) == 0, self.output.readouterr().err
        else:
            return self._in_a_shell(text)
        printed = self.output.readouterr()
        assert "warning" not in printed.err
        return printed.out

    def _in_a_shell(self, text: str) -> str:
        path = f"{self.place / 'bin'}{os.pathsep}{os.environ['PATH']}"
        found = os.pathsep.join(filter(None, sys.path))
        done = subprocess.run(
            ["sh", "-ec", text],
            env={**os.environ, "PATH": path, "PYTHONPATH": found},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert "warning" not in done.stderr
        return done.stdout
