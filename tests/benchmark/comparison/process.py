"""The whole process: `lagcli simulate` compared with the imports that it needs."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from comparison.cases import MODELS

IMPORTS = "import numpy, h5py, yaml, symengine"


@dataclass(frozen=True)
class WholeProcess:
    """Median wall times, s, from the start of a process to its end."""

    simulate: float
    imports: float


def whole_process(rounds: int) -> WholeProcess:
    """Measure both, interleaved."""
    program = Path(sys.executable).with_name("lagcli")
    with tempfile.TemporaryDirectory() as folder:
        result = str(Path(folder) / "run.h5")
        model = str(MODELS / "slider_crank.yaml")
        commands = {
            "simulate": [str(program), "simulate", model, "--force", "-o", result],
            "imports": [sys.executable, "-c", IMPORTS],
        }
        # modules are compiled once and kept, as where lagcli is installed
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        seconds: dict[str, list[float]] = {name: [] for name in commands}
        for round_ in range(rounds + 1):
            for name, command in commands.items():
                began = time.perf_counter()
                subprocess.run(command, check=True, capture_output=True, env=environment)
                if round_:  # the first reads from the disk
                    seconds[name].append(time.perf_counter() - began)
    return WholeProcess(*(statistics.median(seconds[name]) for name in commands))
