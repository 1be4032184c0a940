"""The server of `lagcli play`, as a user starts it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

from patience import PATIENCE


def serving(*arguments):
    """Yield the address of a page, and stop its server."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-m", "lagcli", "play", "--no-browser", "-q", *map(str, arguments)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    yield process.stdout.readline().strip()
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
