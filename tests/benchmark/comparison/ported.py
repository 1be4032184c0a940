"""Models ported from textbooks and other tools: the whole process, in seconds of processor time.

Where a checkout of an earlier revision is given, `lagcli simulate` of that one stands beside.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[3]
FOUND = ROOT / "tests" / "found"

#: What is run, by the name in the table.
COMMANDS: Mapping[str, tuple[str, ...]] = {
    "net_rods, 3 a side": ("simulate", "net_rods.yaml", "--set", "N=3"),
    "net_rods, 4 a side": ("simulate", "net_rods.yaml", "--set", "N=4"),
    "net_rods, 5 a side": ("simulate", "net_rods.yaml", "--set", "N=5"),
    "ring100": ("simulate", "ring100.yaml"),
    "beam40": ("simulate", "beam40.yaml"),
    "stewart": ("simulate", "stewart.yaml"),
    "stewart, sweep of 101 rows": (
        *("sweep", "stewart.yaml", "--vary", "L0=1.45:1.55:0.001"),
        *("--measure", "max(abs(lambda.leg[1]))", "--jobs", "1"),
    ),
    "door_two_hinges": ("simulate", "door_two_hinges.yaml"),
    "bricard_a04": ("simulate", "bricard_a04.yaml"),
    "bennett": ("simulate", "bennett.yaml"),
    "condenser_microphone": ("simulate", "condenser_microphone.yaml"),
    "mems_duffing": ("simulate", "mems_duffing.yaml"),
    "whipple_bicycle, derive": ("derive", "whipple_bicycle.yaml"),
}
#: Seconds of processor time after which a process is ended.
MOST = 20


@dataclass(frozen=True)
class Ported:
    """Processor time of whole processes, s; a word where a run did not complete.

    Parameters
    ----------
    now, before : float or str or None
        This revision and the earlier one; None where it was not measured.
    """

    now: float | str
    before: float | str | None


@dataclass
class PortedModels:
    """All of them, by name, and the revision that ``before`` is."""

    rows: dict[str, Ported] = field(default_factory=dict)
    revision: str = ""


def measure_ported(
    before: Path | None, rounds: int, say: Callable[[str], None] = lambda text: None
) -> Iterator[PortedModels]:
    """Measure all commands; yield what there is after each.

    Parameters
    ----------
    before : path, optional
        A checkout of an earlier revision, with its core built in place.
    rounds : int
        Runs of each, in turn, of which the least counts: other work only adds to it.
    say : callable
        Takes what is being done.
    """
    found = PortedModels(revision=_revision(before) if before else "")
    with tempfile.TemporaryDirectory() as folder:
        for name, command in COMMANDS.items():
            say(f"ported: {name}")
            sides = [ROOT] if before is None else [ROOT, before]
            seconds = [[_seconds(side, command, folder) for side in sides] for _ in range(rounds)]
            now, *earlier = (_least(column) for column in zip(*seconds, strict=True))
            found.rows[name] = Ported(now, earlier[0] if earlier else None)
            yield found


def _least(values: tuple[float | str, ...]) -> float | str:
    return min((x for x in values if isinstance(x, float)), default=values[0])


def _seconds(root: Path, command: tuple[str, ...], folder: str) -> float | str:
    """Return the processor time of a command, or how it ended."""
    kind, model, *options = command
    output = [] if kind == "derive" else ["--force", "-o", str(Path(folder) / "run.h5")]
    # as from a shell that sets nothing
    free = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    began = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-m", "lagcli", kind, str(FOUND / model), *options, *output],
        env={**free, "PYTHONPATH": str(root)},
        cwd=folder,
        capture_output=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (MOST, MOST)),
    )
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode < 0:
        return f"> {MOST} s"
    if done.returncode:
        return "fails"
    return ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime


def _revision(root: Path) -> str:
    mark = root / "REVISION"
    return mark.read_text(encoding="utf-8").strip() if mark.exists() else root.name
