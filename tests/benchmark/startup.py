"""The price of starting: a short simulation, as a whole process, against the imports that it needs.

    python tests/benchmark/startup.py [PAIRS]

Both run in turn, so that what else the machine does falls on both alike; the medians are compared.
The promise is a ratio of at most 1.6 (docs/decisions/2026-11-start-up.md).
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

ROOT = Path(__file__).parents[2]
MODEL = ROOT / "models" / "slider_crank.yaml"
IMPORTS = (sys.executable, "-c", "import numpy, h5py, yaml, symengine")
LIMIT = 1.6


@dataclass(frozen=True)
class StartUp:
    """Medians over all pairs of runs, s."""

    simulate: float
    imports: float

    @property
    def ratio(self) -> float:
        """What the simulation costs, in units of its imports."""
        return self.simulate / self.imports


def measure(pairs: int = 20) -> StartUp:
    """Measure 10 s of the slider-crank, 1001 samples to HDF5, against its imports.

    Every run has its own model that no run has seen before.
    """
    # as installed: with the bytecode that pip, or else the first run, has written
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPATH"] = os.pathsep.join(
        filter(None, (str(ROOT), os.environ.get("PYTHONPATH")))
    )
    text = MODEL.read_text(encoding="utf-8")

    def seconds(command: tuple[str, ...], folder: str) -> float:
        began = time.perf_counter()
        subprocess.run(command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, check=True)
        return time.perf_counter() - began

    times: list[tuple[float, float]] = []
    for i in range(pairs + 1):
        with tempfile.TemporaryDirectory() as folder:
            model = Path(folder) / f"model_{i}.yaml"
            model.write_text(f"{text}# {time.time_ns()}\n", encoding="utf-8")
            simulate = (
                *(sys.executable, "-m", "lagcli", "simulate", str(model)),
                *("--t-end", "10", "--samples", "1001", "-o", "run.h5"),
            )
            times.append((seconds(simulate, folder), seconds(IMPORTS, folder)))
    simulate_times, import_times = zip(*times[1:], strict=True)  # the first pair warms the disk
    return StartUp(median(simulate_times), median(import_times))


def main() -> None:
    """Print the ratio."""
    pairs = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    found = measure(pairs)
    print(
        f"simulate {found.simulate * 1e3:.0f} ms, imports {found.imports * 1e3:.0f} ms:"
        f" ratio {found.ratio:.2f} over {pairs} pairs (limit {LIMIT})"
    )


if __name__ == "__main__":
    main()
