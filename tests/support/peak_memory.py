"""The most memory that the program has at once, as Linux reports it."""

from __future__ import annotations

import re
import resource
import subprocess
import sys

from trajectories import environment

RUN = """
import re, sys
from lagcli.cli.app import run
status = run(sys.argv[1:])
found = re.search(r"VmHWM:\\s+(\\d+) kB", open("/proc/self/status").read())
print("peak", found[1], file=sys.stderr)
sys.exit(status)
"""


def peak(*arguments: str, seconds: int = 200) -> float:
    """Run the program, for so much time of the processor; return the most memory it had, MB."""
    done = subprocess.run(
        [sys.executable, "-c", RUN, *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
        timeout=3600,  # of a machine that does much besides; the time of the processor is bounded
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds)),
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = re.search(r"^peak (\d+)$", done.stderr, re.MULTILINE)
    assert found, done.stderr
    return int(found[1]) / 1024
