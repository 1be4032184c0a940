"""What a person waits for at a prompt: processor time of commands, as whole processes.

    python tests/benchmark/prompt_times.py [ROUNDS]

The least of some rounds, imports included, beside the aim. `sweep` is measured with one process and
with two, which together must not take much more.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from startup import ROOT

HERE = Path(__file__).parent / "prompts"
BRICARD, CHAIN = HERE / "bricard_joint_angles.yaml", HERE / "closed_chain.yaml"
MASSES = ROOT / "models" / "chain.yaml"
SWEEP = (
    *("sweep", ROOT / "models" / "slider_crank.yaml", "--vary", "m=0.5..2", "--sample"),
    *("random:2000", "--measure", "max(phi)", "--t-end", "10", "-o", "rows.csv", "--force", "-q"),
)


class Prompt(NamedTuple):
    """A command, and the processor time that it may take, s."""

    words: tuple[object, ...]
    aim: float | None


PROMPTS = (
    Prompt(("derive", BRICARD), 2.0),
    Prompt(("derive", CHAIN), 2.0),
    Prompt(("check", CHAIN), 2.0),
    Prompt(("check", MASSES, "--set", "N=100"), 2.0),
    Prompt(("modes", MASSES, "--set", "N=200", "--equilibrium"), 3.0),
    Prompt((*SWEEP, "-j", "1"), None),
    Prompt((*SWEEP, "-j", "2"), None),
)


def seconds(words: tuple[object, ...], folder: str) -> float:
    """Return the processor time of a command with its child processes, s."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    before = os.times()
    command = [sys.executable, "-m", "lagcli", *map(str, words)]
    subprocess.run(command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, check=True)
    after = os.times()
    return sum(after[2:4]) - sum(before[2:4])


def main() -> None:
    """Print a table."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    with tempfile.TemporaryDirectory() as folder:
        for words, aim in PROMPTS:
            taken = min(seconds(words, folder) for _ in range(rounds))
            shown = " ".join(x.stem if isinstance(x, Path) else str(x) for x in words)
            said = "" if aim is None else f" (aim {aim:g} s{'' if taken <= aim else ', not met'})"
            print(f"{taken:6.2f} s{said:22} {shown}", flush=True)


if __name__ == "__main__":
    main()
