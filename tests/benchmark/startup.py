"""The price of starting: short commands, as whole processes, against the imports that they need.

    python tests/benchmark/startup.py [ROUNDS]

All run in turn, so that what else the machine does falls on all alike; processor time is counted,
and the least of each is compared. `tests/benchmark/test_startup.py` limits the instructions
(docs/decisions/2026-11-start-up.md).
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
MODEL = ROOT / "models" / "slider_crank.yaml"
IMPORTS = (sys.executable, "-c", "import numpy, h5py, yaml, symengine")
_WITHOUT_HDF5 = (sys.executable, "-c", "import numpy, yaml, symengine")
_PYTHON = (sys.executable, "-c", "pass")
_RUN = ("simulate", "{model}", "--t-end", "10", "--samples", "1001", "--quiet", "--force")

#: Words of each command, and what it cannot do without.
COMMANDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "--version": (("--version",), _PYTHON),
    "--help": (("--help",), _PYTHON),
    "simulate --help": (("simulate", "--help"), _PYTHON),
    "simulate": (_RUN, _WITHOUT_HDF5),
    "simulate -o run.csv": ((*_RUN, "-o", "run.csv"), _WITHOUT_HDF5),
    "simulate -o run.h5": ((*_RUN, "-o", "run.h5"), IMPORTS),
    "derive": (("derive", "{model}"), _WITHOUT_HDF5),
    "check": (("check", "{model}"), _WITHOUT_HDF5),
    "info": (("info", "run.h5"), IMPORTS),
}


class StartUp(NamedTuple):
    """Least processor times of a command and of what it cannot do without, s."""

    command: float
    imports: float


def measure(rounds: int = 20) -> dict[str, StartUp]:
    """Measure all commands; models are ones that no run has seen before."""
    # as installed: with the bytecode that pip, or else the first run, has written
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPATH"] = os.pathsep.join(
        filter(None, (str(ROOT), os.environ.get("PYTHONPATH")))
    )
    environment.setdefault("OPENBLAS_NUM_THREADS", "1")  # as lagcli sets it
    text = MODEL.read_text(encoding="utf-8")

    def seconds(command: tuple[str, ...], folder: str) -> float:
        with subprocess.Popen(
            command, cwd=folder, env=environment, stdout=subprocess.DEVNULL
        ) as process:
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        assert process.returncode == 0, command
        return used.ru_utime + used.ru_stime

    found: dict[tuple[str, ...], float] = {}
    for i in range(rounds + 1):
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "model.yaml").write_text(f"{text}# {time.time_ns()}\n", "utf-8")
            for words, imports in COMMANDS.values():
                given = (word.format(model="model.yaml") for word in words)
                for key, command in (
                    (words, (sys.executable, "-m", "lagcli", *given)),
                    (imports, imports),
                ):
                    taken = seconds(command, folder)
                    if i:  # the first round warms the disk
                        found[key] = min(taken, found.get(key, taken))
    return {name: StartUp(found[words], found[imp]) for name, (words, imp) in COMMANDS.items()}


def main() -> None:
    """Print a table."""
    for name, taken in measure(int(sys.argv[1]) if len(sys.argv) > 1 else 20).items():
        beyond = taken.command - taken.imports
        print(
            f"{name:20} {taken.command * 1e3:6.1f} ms, imports {taken.imports * 1e3:6.1f} ms:"
            f" {beyond * 1e3:6.1f} ms above, ratio {taken.command / taken.imports:.2f}"
        )


if __name__ == "__main__":
    main()
