"""Random models whose events are known, and the comparison of a run with them.

The events follow from closed forms of the motion and of the conditions. Nothing here uses the
search that is tested: a case is the text of a model, the options of its run, and the instants at
which each event occurs.
"""

from __future__ import annotations

import signal
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import lagcli
from lagcli.arrays import Array
from lagcli.trajectory.trajectory import Trajectory

#: The methods of runs.
METHODS = ("DOP853", "Taylor", "Radau", "Rodas5P")
#: Seconds after which a run counts as hanging; the longest of these take a few tenths of one.
PATIENCE = 30.0


@dataclass(frozen=True, eq=False)
class Case:
    """A model, and what its run must give.

    Parameters
    ----------
    kind : str
    seed : int
    text : str
        The model file.
    options : mapping
        Settings of the run.
    events : mapping of str to array
        Instants of each event, s, increasing.
    slack : mapping of str to float or array
        Largest errors of these instants, s.
    end : mapping of str to (value, error)
        Coordinates, velocities (``x'``) and outputs at the end of the run.
    bounds : mapping of str to (lowest, highest)
        Limits of multipliers at every sample.
    samples : mapping of str to (function of time, error)
        Coordinates and velocities at every sample.
    """

    kind: str
    seed: int
    text: str
    options: Mapping[str, Any]
    events: Mapping[str, Array] = field(default_factory=dict)
    slack: Mapping[str, Any] = field(default_factory=dict)
    end: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    samples: Mapping[str, tuple[Callable[[Array], Array], float]] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.kind}({self.seed}), {dict(self.options)}\n{self.text}"


@dataclass(frozen=True)
class Verdict:
    """How a run differs from what is known.

    Parameters
    ----------
    expected, missed, doubled : int
        Numbers of events: those that occur, those not found, and those found that do not occur.
    worst : float
        Largest error of an instant, relative to what is allowed.
    faults : tuple of str
        What else is wrong: the status, warnings, values at the end or at samples.
    """

    expected: int = 0
    missed: int = 0
    doubled: int = 0
    worst: float = 0.0
    faults: tuple[str, ...] = ()

    @property
    def right(self) -> bool:
        """Whether nothing is wrong."""
        return not (self.missed or self.doubled or self.faults)

    def __str__(self) -> str:
        counts = f"{self.missed} missed and {self.doubled} doubled of {self.expected}"
        return "; ".join([counts, *self.faults])


class Hangs(Exception):
    """A run takes longer than any of these should."""


def run(case: Case) -> Trajectory:
    """Simulate a case, for at most `PATIENCE` seconds."""

    def stop(*_: object) -> None:
        raise Hangs

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return lagcli.simulate(lagcli.load_text(case.text), **case.options)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def judge(case: Case) -> Verdict:
    """Compare the run of a case with what is known."""
    expected = sum(len(x) for x in case.events.values())
    try:
        found = run(case)
    except Hangs:
        return Verdict(expected, expected, faults=(f"no end after {PATIENCE} s",))
    except lagcli.errors.LagcliError as error:  # type: ignore[attr-defined]
        return Verdict(expected, expected, faults=(str(error).splitlines()[0],))
    faults = []
    if found.status != "completed":
        faults.append(f"{found.status}: {found.message}")
    missed = doubled = 0
    worst = 0.0
    for name, instants in case.events.items():
        times = instants_of(found, name)
        lost, extra, error = matched(instants, times, case.slack[name])
        missed, doubled, worst = missed + lost, doubled + extra, max(worst, error)
    faults += _values(case, found)
    return Verdict(expected, missed, doubled, worst, tuple(faults))


def instants_of(run: Trajectory, name: str) -> Array:
    """Return the instants of an event, or of the changes ``NAME KIND`` of a contact."""
    log = run.events
    if log is None:
        return np.empty(0)
    name, _, kind = name.partition(" ")
    chosen = [
        n == name and k == (kind or "event") for n, k in zip(log.names, log.kinds, strict=True)
    ]
    return np.asarray(log.time[np.array(chosen, dtype=bool)], dtype=float)


def matched(expected: Array, found: Array, slack: float | Array) -> tuple[int, int, float]:
    """Return how many instants are missed and doubled, and the largest error of the others."""
    room = np.broadcast_to(np.asarray(slack, dtype=float), expected.shape)
    missed, worst = 0, 0.0
    free = list(found)
    for instant, allowed in zip(expected, room, strict=True):
        near = [t for t in free if abs(t - instant) <= allowed]
        if not near:
            missed += 1
            continue
        nearest = min(near, key=lambda t: abs(t - instant))
        free.remove(nearest)
        worst = max(worst, abs(nearest - instant) / allowed)
    return missed, len(free), worst


def _values(case: Case, run: Trajectory) -> Iterable[str]:
    """Yield what is wrong with the values of a run."""
    series = {
        n + p: x[:, i]
        for p, x in (("", run.q), ("'", run.v))
        for i, n in enumerate(run.coordinates)
    }
    series |= run.outputs
    for name, (value, error) in case.end.items():
        last = float(series[name][-1]) if len(run.time) else np.nan
        if not abs(last - value) <= error:
            yield f"{name} = {last:.10g} at the end, not {value:.10g}"
    for name, (low, high) in case.bounds.items():
        values = run.multipliers[:, run.constraints.index(name)]
        if not (values.min(initial=low) >= low and values.max(initial=high) <= high):
            yield f"lambda.{name} from {values.min():.6g} to {values.max():.6g}"
    for name, (function, error) in case.samples.items():
        off = float(np.abs(series[name] - function(run.time)).max(initial=0.0))
        if not off <= error:
            yield f"{name} is off by {off:.3g}"


def summary(verdicts: Iterable[tuple[Case, Verdict]]) -> str:
    """Return a table of the verdicts by kind."""
    rows: dict[str, Counter[str]] = {}
    worst: dict[str, float] = {}
    for case, verdict in verdicts:
        row = rows.setdefault(case.kind, Counter())
        row.update(cases=1, wrong=not verdict.right, events=verdict.expected)
        row.update(missed=verdict.missed, doubled=verdict.doubled, faults=bool(verdict.faults))
        worst[case.kind] = max(worst.get(case.kind, 0.0), verdict.worst)
    names = ("cases", "wrong", "events", "missed", "doubled", "faults")
    total = sum(rows.values(), Counter())
    lines = [f"{'kind':24}" + "".join(f"{n:>9}" for n in names) + "  time error / allowed"]
    for kind, row in sorted(rows.items()):
        counts = "".join(f"{row[n]:9}" for n in names)
        lines.append(f"{kind:24}{counts}  {worst[kind]:.1g}")
    lines.append(f"{'all':24}" + "".join(f"{total[n]:9}" for n in names))
    return "\n".join(lines)
