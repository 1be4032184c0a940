"""Measuring: every method in its own process, the least processor time of interleaved runs.

A method that hangs or crashes loses its process and nothing else.
"""

from __future__ import annotations

import gc
import math
import multiprocessing
import resource
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from importlib import import_module
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparison.cases import CASES, Case, Start
from comparison.methods import Method

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Effort:
    """How long to measure, s.

    ``prepare`` and ``run`` are limits of one preparation and one run; a method's further rounds
    end when it has run for ``total``. So many methods are prepared ``at_once``; runs never are.
    """

    prepare: float = 60.0
    run: float = 10.0
    total: float = 2.0
    rounds: int = 5
    at_once: int = 2


@dataclass
class Point:
    """The runs of a method at one setting.

    ``error`` is the largest deviation of q from the reference at the sample times, in m or rad;
    ``error_at_end`` that at the last of them.
    """

    setting: float
    error: float
    error_at_end: float
    seconds: list[float] = field(default_factory=list)

    @property
    def least(self) -> float:
        """The least of the run times, s: other work of the machine only adds to it."""
        return min(self.seconds)


@dataclass
class Result:
    """A method on a case. ``note`` says why points are missing, if any are."""

    program: str
    name: str
    unit: str
    setup: float = math.nan
    points: list[Point] = field(default_factory=list)
    note: str = ""

    @property
    def title(self) -> str:
        """What the table calls the method."""
        return f"{self.program} {self.name}".strip()

    def seconds_at(self, error: float) -> float | None:
        """Return the least time in which an error is reached, or None.

        Interpolated in log-log between neighbouring settings.
        """
        found = [p.least for p in self.points if p.error <= error]
        for a, b in zip(self.points, self.points[1:], strict=False):
            if min(a.error, b.error) < error < max(a.error, b.error):
                x = math.log(error / a.error) / math.log(b.error / a.error)
                found.append(a.least * (b.least / a.least) ** x)
        return min(found, default=None)

    @property
    def best_error(self) -> float:
        """The least error of all settings."""
        return min((p.error for p in self.points), default=math.inf)


class Failure(Exception):
    """A method failed; the message says how."""


class Worker:
    """A process that holds one method, prepared for one case."""

    def __init__(self, method: Method, case: Case):
        context = multiprocessing.get_context("spawn")
        self.connection, other = context.Pipe()
        arguments = (other, method.program, method.name, case.name, case.start)
        self.process = context.Process(target=_serve, args=arguments, daemon=True)
        self.process.start()
        other.close()

    def ask(self, *question: Any, timeout: float) -> Any:
        """Ask the process; raise Failure if it does not answer, or answers that it failed."""
        try:
            self.connection.send(question)
            if not self.connection.poll(timeout):
                raise Failure(f"no result within {timeout:g} s")
            kind, answer = self.connection.recv()
        except (EOFError, BrokenPipeError, ConnectionResetError):
            raise Failure("the process ended") from None
        if kind == "failed":
            raise Failure(answer)
        return answer

    def close(self) -> None:
        """End the process."""
        self.process.kill()
        self.process.join()
        self.connection.close()


def _serve(connection: Connection, program: str, name: str, case_name: str, start: Start) -> None:
    """Answer a parent's questions about one method; runs in its own process."""
    from comparison import ported_cases
    from comparison.peers import METHODS, OF_PORTED

    method = next(m for m in (*METHODS, *OF_PORTED) if (m.program, m.name) == (program, name))
    case: Any = CASES.get(case_name) or ported_cases.CASES[case_name]
    case.__dict__["start"] = start  # already found by the parent
    if method in OF_PORTED and method.program != "lagcli":
        case.equations  # noqa: B018 - given
        for package in method.packages:
            import_module(package)
    runs: dict[float, Any] = {}
    solver: Any = None
    while True:
        question, *rest = connection.recv()
        try:
            if question == "prepare":
                began = _spent()
                solver = method.prepare(case)
                (loosest,) = rest
                run = runs[loosest] = solver.at(loosest)
                took = _spent() - began
                # the first run compiles what is compiled on demand: set-up, too
                first = _timed(run)[0]
                took += getattr(run, "before", 0.0) + getattr(run, "within", 0.0)
                second = _timed(run)[0]
                connection.send(("done", took + max(0.0, first - second)))
                continue
            setting, with_positions = rest
            if setting not in runs:
                runs[setting] = solver.at(setting)
            seconds, result = _timed(runs[setting])
            positions = solver.positions(result) if with_positions else None
            connection.send(("done", (seconds, positions)))
        except Exception as error:
            first_line = (str(error).strip() or type(error).__name__).splitlines()[0]
            connection.send(("failed", f"fails: {first_line[:120]}"))


def _spent() -> float:
    """Return the processor time of this process and of those that it has started, s."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def _timed(run: Any) -> tuple[float, Any]:
    # others' integrators can run again as they are; what ours has to do before that is set-up
    if hasattr(run, "make_ready"):
        run.make_ready()
    gc.collect()
    gc.disable()
    began = time.process_time()
    result = run()
    seconds = time.process_time() - began
    gc.enable()
    # programs and Jacobians that a run of ours makes on its way are set-up, as compiling is
    return seconds - getattr(run, "within", 0.0), result


def measure(
    case: Case, methods: Sequence[Method], reference: Array, effort: Effort
) -> list[Result]:
    """Measure methods on a case, round by round."""
    results = [Result(method.program, method.name, method.unit) for method in methods]

    def prepared(method: Method, result: Result) -> Worker | None:
        result.note = method.unfit(case)
        if result.note:
            return None
        worker = Worker(method, case)
        try:
            loosest = method.settings(case)[0]
            result.setup = worker.ask("prepare", loosest, timeout=effort.prepare)
        except Failure as failure:
            result.note = str(failure)
            worker.close()
            return None
        return worker

    case.start  # noqa: B018 - found once, before the processes need it
    with ThreadPoolExecutor(effort.at_once) as pool:
        found = list(pool.map(prepared, methods, results))
    workers = [
        (worker, method.settings(case), result)
        for worker, method, result in zip(found, methods, results, strict=True)
        if worker is not None
    ]
    for round_ in range(effort.rounds):
        for worker, settings, result in list(workers):
            spent = sum(sum(p.seconds) for p in result.points)
            if round_ and spent + spent / round_ > effort.total:
                continue
            try:
                _round(worker, settings, result, reference, effort, first=round_ == 0)
            except Failure as failure:
                result.note = str(failure)
    for worker, _, _ in workers:
        worker.close()
    return results


def _round(
    worker: Worker,
    settings: Sequence[float],
    result: Result,
    reference: Array,
    effort: Effort,
    first: bool,
) -> None:
    if not first:
        for point in result.points:
            point.seconds.append(worker.ask("run", point.setting, False, timeout=effort.run)[0])
        return
    for setting in settings:
        try:
            seconds, q = worker.ask("run", setting, True, timeout=effort.run)
        except Failure as failure:
            if not worker.process.is_alive() or "no result" in str(failure):
                raise
            result.note = str(failure)
            continue
        if q.shape != reference.shape:
            raise Failure(f"returned {q.shape[0]} of {reference.shape[0]} samples")
        deviation = np.abs(q - reference).max(axis=1)
        if not np.isfinite(deviation).all():
            result.note = "not finite"
            continue
        result.points.append(Point(setting, deviation.max(), deviation[-1], [seconds]))
        if sum(sum(p.seconds) for p in result.points) > effort.total:
            return
