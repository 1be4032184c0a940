"""The program in this process, which is faster than one of its own."""

from __future__ import annotations

import pytest

from lagcli.cli.app import run


class Here:
    """Runs the program in this process; keeps what it printed."""

    def __init__(self, capture: pytest.CaptureFixture[str]):
        self.capture = capture
        self.out = self.err = ""

    def __call__(self, *arguments: str) -> int:
        self.capture.readouterr()
        status = run(list(arguments))
        self.out, self.err = self.capture.readouterr()
        assert "Traceback" not in self.out + self.err
        return status
