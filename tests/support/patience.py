"""Waiting for what another process or thread does, on a machine that may have much else to do."""

from __future__ import annotations

import os
import resource
import time
from collections.abc import Callable
from pathlib import Path

#: Seconds after which a test gives up. No test waits for them to pass.
PATIENCE = 300.0


def wait_until(condition: Callable[[], object], said: Callable[[], object] = lambda: None) -> None:
    """Ask for a condition now and then until it holds; `said` explains why it does not."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, said()
        time.sleep(0.01)


def processor_time(pid: int) -> float:
    """Return the processor time of a running process, s, as Linux reports it."""
    # the second field is the name in parentheses; user and system time are the 14th and 15th
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def children_time() -> float:
    """Return the processor time of the processes that have been waited for, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
