"""Dispatch of chunks of rows to workers, and their execution there."""

from __future__ import annotations

import os
import queue
import threading
import time
import traceback
from collections import deque
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lagcli.arrays import Numbers
from lagcli.engine.contract import Interrupted
from lagcli.sweeps.plan.spec import Spec
from lagcli.sweeps.row_results import Results
from lagcli.sweeps.rows.rows import Runner
from lagcli.sweeps.rows.workers import Chunks
from lagcli.version import __version__

if TYPE_CHECKING:
    from distributed import Client, Future


#: Chunks in flight per thread of a worker: one running, one waiting.
_AHEAD = 2
_PARTS = 8  # number of parts of a chunk that has crashed processes


class Flight:
    """The chunks in flight: just enough to keep the workers busy.

    Parameters
    ----------
    client : Client
    spec : Spec
    chunks : Chunks
    """

    def __init__(self, client: Client, spec: Spec, chunks: Chunks):
        self.client, self.spec, self.chunks = client, spec, chunks
        # the sweep is sent to the scheduler once; workers fetch it from there, or from each other
        self.sent = client.submit(_itself, spec, key=f"lagcli-sweep-{spec.sha256}")
        self.name, self.count = f"lagcli-rows-{os.urandom(8).hex()}", 0
        self.repeated: deque[Numbers] = deque()
        self.suspects: deque[Numbers] = deque()
        self.alone = False
        self.ended: queue.SimpleQueue[Future[Any]] = queue.SimpleQueue()
        self.under_way: dict[Any, tuple[Future[Any], Numbers]] = {}

    def fill(self, threads: int) -> bool:
        """Send chunks to all idle threads; return whether any are in flight."""
        # one chunk even without workers, for adaptive clusters
        self.chunks.jobs = max(1, threads)
        while len(self.under_way) < (1 if self.alone else _AHEAD * self.chunks.jobs):
            numbers = self.next()
            if not len(numbers):
                return bool(self.under_way)
            self.count += 1
            future = self.client.submit(
                _run, self.sent, numbers, __version__, key=f"{self.name}-{self.count}"
            )
            self.expect(future, numbers)
        return True

    def expect(self, future: Future[Any], numbers: Numbers) -> None:
        """Track a chunk."""
        self.under_way[future.key] = future, numbers
        future.add_done_callback(self.ended.put)

    def next(self) -> Numbers:
        """Return the rows to run next; none if there are none, or none until others have ended.

        A row that may have crashed processes runs last, and alone, so that no other row is
        suspected.
        """
        if self.repeated:
            return self.repeated.popleft()
        found = self.chunks.next()
        if not len(found) and self.suspects and not self.under_way:
            self.alone = True
            return self.suspects.popleft()
        return found

    def wait(self, seconds: float) -> tuple[Future[Any], Numbers] | None:
        """Wait for a chunk and return it."""
        try:
            future = self.ended.get(timeout=seconds)
        except queue.Empty:
            return None
        return self.under_way.pop(future.key)

    def again(self, numbers: Numbers) -> None:
        """Repeat the rows of a chunk whose process crashed."""
        if len(numbers) == 1:
            self.suspects.append(numbers)
        else:
            self.repeated.extend(np.array_split(numbers, min(_PARTS, len(numbers))))

    def cancel(self) -> None:
        """Cancel the chunks in flight."""
        with suppress(OSError, TimeoutError, RuntimeError):
            self.client.cancel([future for future, _ in self.under_way.values()])


# on the worker


class Answer(NamedTuple):
    """Reply of a worker: results, a different version, or the traceback of a bug."""

    worker: str
    version: str
    results: Results | None = None
    seconds: float = 0.0
    bug: str = ""


def _itself(spec: Spec) -> Spec:
    return spec


def _run(spec: Spec, numbers: Numbers, version: str) -> Answer:
    """Run rows on a worker if its lagcli has the client's version."""
    from distributed import get_worker

    worker = get_worker()
    done = Answer(worker.address, __version__)
    if done.version != version:
        return done
    key = worker.get_current_task()

    def check_cancelled() -> None:
        task = worker.state.tasks.get(key)
        if task is None or task.state == "cancelled":
            raise Interrupted

    began = time.perf_counter()
    try:
        results = _runner(spec).run(numbers, check_cancelled)
    except Interrupted:
        return done._replace(bug="cancelled")  # the client no longer waits
    except Exception:
        # as text, because an exception that cannot be pickled would block the client
        return done._replace(bug=traceback.format_exc())
    return done._replace(results=results, seconds=max(time.perf_counter() - began, 1e-6))


_mine = threading.local()


def _runner(spec: Spec) -> Runner:
    """Return this thread's runner, created once: threads must not share scratch memory."""
    if getattr(_mine, "sha256", None) != spec.sha256:
        _mine.runner, _mine.sha256 = Runner(spec), spec.sha256
    runner: Runner = _mine.runner
    return runner
