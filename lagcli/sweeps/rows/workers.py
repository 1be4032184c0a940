"""Execution of rows on this machine, in one process or several."""

from __future__ import annotations

import gc
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from multiprocessing import connection, get_context
from pathlib import Path
from typing import Any

from lagcli.arrays import Numbers
from lagcli.errors import NumericalError
from lagcli.sweeps.plan.plan import Spec
from lagcli.sweeps.row_results import MissingRows, Results
from lagcli.sweeps.rows.rows import run_rows

#: Target duration of a chunk of rows, s: the loss if a sweep is killed.
_CHUNK = 0.5
_TOGETHER = 8  # number of rows in a batch: fewer take nearly as long
_LONG = 10.0  # duration of a batch above which chunks are smaller, s
_FIRST = 16  # number of rows of the first chunk
_MOST = 4096  # largest number of rows of a chunk
_MOST_BYTES = 1 << 25  # largest size of the stored samples of a chunk
_GROWTH = 4
#: Seconds that it takes to start processes: a fork, or an interpreter that imports lagcli, to which
#: the first chunk adds an upper bound of the time for loading and deriving.
_FORK, _SPAWN = 0.1, 1.0
_PATIENCE = 0.05  # s between two checks for cancellation


class Chunks:
    """Divides rows into chunks of about equal duration.

    Parameters
    ----------
    missing : MissingRows
    row_bytes : int
        Size of a row's stored samples, bytes.
    jobs : int
    """

    def __init__(self, missing: MissingRows, row_bytes: int, jobs: int):
        self.missing, self.jobs = missing, jobs
        self.most = max(1, min(_MOST, _MOST_BYTES // max(1, row_bytes)))
        self.size = min(_FIRST, self.most)
        self.seconds_per_row = 0.0
        self.first = 0.0  # duration of the first chunk, s
        self.timed = 0  # number of chunks

    def next(self) -> Numbers:
        """Return the numbers of the next rows; none at the end."""
        # small chunks towards the end, so that all processes end at the same time
        fair = max(_TOGETHER, self.missing.left // (2 * self.jobs))
        return self.missing.take(_filled(min(self.size, fair)))

    def took(self, rows: int, seconds: float) -> None:
        """Record the duration of a chunk."""
        self.seconds_per_row = seconds / rows
        self.first = self.first if self.timed else seconds
        self.timed += 1
        wanted = int(_CHUNK / max(self.seconds_per_row, 1e-9))
        if wanted < _TOGETHER and _TOGETHER * self.seconds_per_row <= _LONG:
            wanted = _TOGETHER
        self.size = max(1, min(wanted, _GROWTH * self.size, self.most))

    @property
    def left(self) -> float:
        """Estimated remaining work of one process, s; 0 if unknown.

        The first chunk is not representative: it includes the derivation.
        """
        return self.missing.left * self.seconds_per_row if self.timed > 1 else 0.0


def _filled(rows: int) -> int:
    """Return a number of rows that fills complete batches, if possible."""
    return rows // _TOGETHER * _TOGETHER or rows


def run_here(
    spec: Spec, chunks: Chunks, check_cancelled: Callable[[], None], jobs: int
) -> Iterator[Results]:
    """Run all rows; yield results as they are completed.

    Parameters
    ----------
    spec : Spec
    chunks : Chunks
    check_cancelled : callable
        Called several times per 0.1 s; an exception ends the runs.
    jobs : int
        The number of processes. The result of a row does not depend on it.
    """
    while len(numbers := chunks.next()):
        began = time.monotonic()
        yield run_rows(spec, numbers, check_cancelled)
        chunks.took(len(numbers), time.monotonic() - began)
        forked = _can_fork()
        started = _FORK if forked else _SPAWN + chunks.first
        if chunks.left * (1 - 1 / jobs) > started:
            with _Processes(spec, min(jobs, chunks.missing.left), forked) as processes:
                yield from processes.run(chunks, check_cancelled)


def _can_fork() -> bool:
    """Whether this process may be forked: on Linux, if it has no other threads, whose locks would
    stay locked in the copy."""
    tasks = Path("/proc/self/task")
    return sys.platform == "linux" and tasks.is_dir() and len(list(tasks.iterdir())) == 1


class _Processes:
    """Processes that run rows, each with a pipe.

    Forked processes have what is imported and derived here. Spawned ones start from nothing. Both
    keep no open files, and end with their pipe, even if this process is killed.
    """

    def __init__(self, spec: Spec, jobs: int, forked: bool):
        context: Any = get_context("fork" if forked else "spawn")
        target = _work_forked if forked else _work
        self.workers: dict[Any, Any] = {}
        blocked = _blocking(signal.SIGINT)  # only this process handles Ctrl-C
        try:
            for _ in range(jobs):
                ours, theirs = context.Pipe()
                process = context.Process(target=target, args=(theirs, spec), daemon=True)
                process.start()
                theirs.close()
                self.workers[ours] = process
        finally:
            _unblock(blocked)

    def __enter__(self) -> _Processes:
        return self

    def __exit__(self, *error: object) -> None:
        for pipe, process in self.workers.items():
            pipe.close()
            process.terminate()
        for process in self.workers.values():
            process.join()

    def run(self, chunks: Chunks, check_cancelled: Callable[[], None]) -> Iterator[Results]:
        busy: set[Any] = set()
        idle = list(self.workers)
        while True:
            while idle and len(numbers := chunks.next()):
                pipe = idle.pop()
                self._talk(pipe, pipe.send, numbers)
                busy.add(pipe)
            if not busy:
                return
            check_cancelled()
            ready: list[Any] = connection.wait(list(busy), _PATIENCE)
            for pipe in ready:
                answer, seconds = self._talk(pipe, pipe.recv)
                busy.remove(pipe)
                idle.append(pipe)
                if isinstance(answer, BaseException):
                    raise answer
                chunks.took(len(answer.numbers), seconds)
                yield answer

    def _talk(self, pipe: Any, action: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return action(*arguments)
        except (EOFError, OSError):
            process = self.workers[pipe]
            process.join(1)
            raise NumericalError(
                f"a process of the sweep died (exit status {process.exitcode}): it was killed, or"
                " memory ran out; use fewer --jobs, and continue with --resume"
            ) from None


def _work_forked(pipe: Any, spec: Spec) -> None:
    """Run chunks of rows in a copy of the process, without its files, pipes and signal handlers."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    gc.freeze()  # nothing of the original is finalized here: HDF5 would write into its file
    os.closerange(3, pipe.fileno())
    os.closerange(pipe.fileno() + 1, os.sysconf("SC_OPEN_MAX"))
    _work(pipe, spec)


def _work(pipe: Any, spec: Spec) -> None:
    """Run chunks of rows until the pipe is closed."""
    try:
        while True:
            numbers = pipe.recv()
            began = time.monotonic()
            try:
                answer: Any = run_rows(spec, numbers)
            except Exception as error:
                answer = error
            pipe.send((answer, time.monotonic() - began))
    except (EOFError, OSError):
        pass


def _blocking(number: signal.Signals) -> Any:
    if not hasattr(signal, "pthread_sigmask"):
        return None
    return signal.pthread_sigmask(signal.SIG_BLOCK, {number})


def _unblock(before: Any) -> None:
    if before is not None:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
