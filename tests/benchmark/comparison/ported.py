"""Models that others wrote: the default run beside the best peer, and `auto` beside each method.

All in processor time, the least of several runs that take turns. Peers are given the equations that
lagcli derived (`comparison.tape_equations`).
"""

from __future__ import annotations

import gc
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

import lagcli
from comparison import ported_cases
from comparison.machine import installed
from comparison.measure import Effort, Failure, Result, Worker, measure
from comparison.peers import OF_PORTED
from comparison.ported_cases import PortedCase
from lagcli.settings.methods import METHOD_NAMES
from lagcli.simulations import simulation

#: How many times the model's duration the methods are compared over.
LONGER = (1, 10)
#: Seconds of processor time after which a run of one method, or a process, is given up.
_MOST_RUN, _MOST_PROCESS = 20.0, 60
#: A method that takes as many times as long as `auto` is not run again.
_FAR = 2.0
#: What the ratios should not exceed: default integration over the best peer, in the median and at
#: most, and `auto` over the best method.
MEDIAN, WORST, OF_METHODS = 1.5, 3.0, 1.2


@dataclass
class Ported:
    """One model.

    Parameters
    ----------
    unknowns : int
        Coordinates and constraints.
    peers : list of Result
        The default run first.
    difference : float
        Between references of lagcli and of C at their tightest; NaN without a second one.
    methods : dict
        Seconds of runs by duration and method, from the model to the samples; a word where a run
        does not end.
    process : float or str
        Processor time of `lagcli simulate`, s, or how it ended.
    """

    unknowns: int
    peers: list[Result] = field(default_factory=list)
    difference: float = math.nan
    methods: dict[int, dict[str, float | str]] = field(default_factory=dict)
    process: float | str = ""

    @property
    def error(self) -> float:
        """The error of the default run."""
        points = self.peers[0].points if self.peers else []
        return points[0].error if points else math.nan

    @property
    def integration(self) -> float | None:
        """The default run's time of integration, s."""
        points = self.peers[0].points if self.peers else []
        return points[0].least if points else None

    def best_peer(self, *, total: bool = False) -> tuple[float, Result] | None:
        """Return the least time of a peer to the error of the default run, and the peer."""
        found = []
        for peer in self.peers[1:]:
            seconds = peer.seconds_at(self.error)
            if seconds is not None:
                found.append((seconds + (peer.setup if total else 0.0), peer))
        return min(found, key=lambda x: x[0], default=None)

    @property
    def total(self) -> float | None:
        """The default run's time from the model to the samples, s."""
        seconds = self.methods.get(1, {}).get("auto", "")
        return None if isinstance(seconds, str) else seconds

    def over_peer(self, *, total: bool = False) -> float | None:
        """Return the default run's time over that of the best peer."""
        best, own = self.best_peer(total=total), self.total if total else self.integration
        return None if best is None or own is None else own / best[0]

    def best_method(self, longer: int) -> tuple[float, str] | None:
        """Return the least time of a method that was requested, and its name."""
        runs = self.methods.get(longer, {})
        found = [(x, m) for m, x in runs.items() if m != "auto" and not isinstance(x, str)]
        return min(found, default=None)

    def over_method(self, longer: int) -> float | None:
        """Return the time of `auto` over that of the best method."""
        best, own = self.best_method(longer), self.methods.get(longer, {}).get("auto", "")
        return None if best is None or isinstance(own, str) else own / best[0]


Models = Mapping[str, Ported]


def measure_ported(
    rounds: int,
    say: Callable[[str], None] = lambda text: None,
    names: Sequence[str] | None = None,
) -> Iterator[dict[str, Ported]]:
    """Measure models (all if None); yield what there is after each."""
    found: dict[str, Ported] = {}
    for name in names or ported_cases.CASES:
        say(f"ported: {name}")
        found[name] = _measured(ported_cases.CASES[name], rounds, say)
        yield found


def _measured(case: PortedCase, rounds: int, say: Callable[[str], None]) -> Ported:
    model = case.load()
    ported = Ported(len(model.coordinates) + len(model.constraints))
    reference, ported.difference = _reference(case)
    programs = [m for m in OF_PORTED if all(map(installed, m.packages))]
    effort = Effort(prepare=120.0, run=60.0, total=2.0, rounds=rounds)
    ported.peers = measure(case, programs, reference, effort)
    for longer in LONGER:
        say(f"ported: {case.name}, methods, {longer} times its duration")
        ported.methods[longer] = _in_a_process(case, longer, rounds)
    ported.process = _least([_process(case) for _ in range(min(rounds, 2))])
    return ported


def _reference(case: PortedCase):  # type: ignore[no-untyped-def]
    """Return q of lagcli at its tightest, and how far that of C is from it."""
    run = lagcli.simulate(case.load(), case.settings(rtol=1e-13))
    if run.status != "completed":
        raise RuntimeError(f"{case.name}: {run.message}")
    worker = Worker(OF_PORTED[1], case)
    try:
        worker.ask("prepare", 1e-5, timeout=120.0)
        _, other = worker.ask("run", 1e-13, True, timeout=60.0)
        return run.q, float(abs(other - run.q).max())
    except Failure:
        return run.q, math.nan
    finally:
        worker.close()


def _in_a_process(case: PortedCase, longer: int, rounds: int) -> dict[str, float | str]:
    """Return `compare_methods`, from a process of its own."""
    code = "from comparison import ported; ported.print_methods()"
    done = subprocess.run(
        [sys.executable, "-c", code, case.name, str(longer), str(rounds)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


def print_methods() -> None:
    """Print `compare_methods` as JSON, of a model, a duration and a number of rounds."""
    name, longer, rounds = sys.argv[1:]
    json.dump(compare_methods(ported_cases.CASES[name], int(longer), int(rounds)), sys.stdout)


def compare_methods(case: PortedCase, longer: int, rounds: int) -> dict[str, float | str]:
    """Return the processor time of each method, from the model to the samples, s."""
    methods = sorted(METHOD_NAMES, key=lambda name: name != "auto")
    taken: dict[str, list[float | str]] = {name: [] for name in methods}
    for round_ in range(rounds):
        for name in methods:
            auto = _least(taken["auto"])
            known = _least(taken[name]) if round_ else 0.0
            far = isinstance(known, str) or (isinstance(auto, float) and known > _FAR * auto)
            if not far:
                taken[name].append(_run(case, name, longer))
    return {name: _least(seconds) for name, seconds in taken.items()}


def _run(case: PortedCase, method: str, longer: int) -> float | str:
    """Return the processor time of one run, or how it ends."""
    gc.collect()  # what earlier runs left is not theirs
    began = time.process_time()
    prepared = simulation.prepare(case.load(), case.settings(longer, method=method))

    class Deadline:
        def requested(self) -> bool:
            return time.process_time() - began > _MOST_RUN

    record = prepared.run(lambda samples: None, None, Deadline())  # type: ignore[arg-type]
    spent = time.process_time() - began
    if record.status == "completed":
        return spent
    return f"> {_MOST_RUN:.0f} s" if spent > _MOST_RUN else "stops"


def _least(values: Sequence[float | str]) -> float | str:
    return min((x for x in values if isinstance(x, float)), default=[*values, ""][0])


def _process(case: PortedCase) -> float | str:
    """Return the processor time of a process with default options, or how it ended."""
    # as from a shell that sets nothing
    free = {
        k: v
        for k, v in os.environ.items()
        if not k.endswith("_NUM_THREADS") and k != "PYTHONDONTWRITEBYTECODE"
    }
    options = [x for item in (case.values or {}).items() for x in ("--set", "{}={}".format(*item))]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "model.yaml").write_text(case.text, encoding="utf-8")
        command = [sys.executable, "-m", "lagcli", "simulate", "model.yaml", *options]
        began = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            [*command, "--samples", str(len(case.times)), "-o", "run.h5"],
            env=free,
            cwd=folder,
            capture_output=True,
            check=False,
            preexec_fn=lambda: resource.setrlimit(
                resource.RLIMIT_CPU, (_MOST_PROCESS, _MOST_PROCESS)
            ),
        )
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode < 0:
        return f"> {_MOST_PROCESS} s"
    if done.returncode:
        return "fails"
    return ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime


def verdicts(models: Models) -> list[tuple[str, str, bool]]:
    """Return the goals, what was measured, and whether that meets them."""
    rows = []
    over = {name: x for name, m in models.items() if (x := m.over_peer()) is not None}
    if over:
        middle = median(over.values())
        text = f"{middle:.2f}, of {len(over)} models"
        rows.append((f"default integration / best peer: median {MEDIAN}", text, middle <= MEDIAN))
        text, met = _most(over, WORST)
        rows.append((f"default integration / best peer: at most {WORST:g}", text, met))
    over = {name: x for name, m in models.items() if (x := m.over_peer(total=True)) is not None}
    if over:
        text, met = _most(over, 1.0)
        rows.append(("default total / least total of a peer: below 1", text, met))
    for longer in LONGER:
        over = {n: x for n, m in models.items() if (x := m.over_method(longer)) is not None}
        if over:
            duration = "" if longer == 1 else f", {longer} times the duration"
            text, met = _most(over, OF_METHODS)
            text = f"median {median(over.values()):.2f}; {text}"
            rows.append((f"`auto` / best method: at most {OF_METHODS}{duration}", text, met))
    return rows


def _most(over: Mapping[str, float], goal: float) -> tuple[str, bool]:
    """Return the largest ratio, and all that miss the goal."""
    worst = max(over, key=lambda name: over[name])
    missed = [name for name in over if over[name] > goal]
    text = f"worst {over[worst]:.2f} ({worst})"
    if missed:
        text += "; missed by " + ", ".join(f"{n} {over[n]:.2f}" for n in missed)
    return text, not missed
