"""The cost of a sweep from the shell: a loop of simulations compared with bare interpreters.

    python tests/benchmark/shell_loop.py [RUNS]

Each loop is one of `sh`; its interpreters import what a simulation needs. They take turns, ten
processes at a time, so that what else the machine does falls on both alike. The promise is that 100
runs cost at most 2.2 times as much (docs/shell-sweeps.md).
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass

from startup import IMPORTS, MODEL, ROOT

LIMIT = 2.2
TURN = 10


@dataclass(frozen=True)
class ShellLoop:
    """Sums over all runs, s."""

    runs: int
    simulate: float
    interpreters: float

    @property
    def ratio(self) -> float:
        """What the loop costs, in units of bare interpreters."""
        return self.simulate / self.interpreters


def measure(runs: int = 100) -> ShellLoop:
    """Measure the slider-crank as it is shipped, another mass in each run, to HDF5."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPATH"] = os.pathsep.join(
        filter(None, (str(ROOT), os.environ.get("PYTHONPATH")))
    )
    simulate = shlex.join([sys.executable, "-m", "lagcli", "simulate", str(MODEL)])
    simulate += " --set m=$i -o 'run_{m}.h5' --quiet"

    with tempfile.TemporaryDirectory() as folder:

        def seconds(command: str, first: int) -> float:
            values = " ".join(str(first + i) for i in range(TURN))
            loop = f"for i in {values}; do {command} || exit; done"
            began = time.perf_counter()
            subprocess.run(["sh", "-c", loop], cwd=folder, env=environment, check=True)
            return time.perf_counter() - began

        commands = (simulate, shlex.join(IMPORTS))
        for command in commands:  # warms the disk
            seconds(command, runs + TURN)
        sums = [0.0, 0.0]
        for first in range(1, runs + 1, TURN):
            for k, command in enumerate(commands):
                sums[k] += seconds(command, first)
    return ShellLoop(-(-runs // TURN) * TURN, *sums)


def main() -> None:
    """Print the ratio."""
    found = measure(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
    print(
        f"shell loop: {found.runs} simulations {found.simulate:.1f} s, {found.runs} interpreters"
        f" with the same imports {found.interpreters:.1f} s: ratio {found.ratio:.2f}"
        f" (limit {LIMIT})"
    )


if __name__ == "__main__":
    main()
