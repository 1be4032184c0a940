"""Rows on the workers of a Dask scheduler, sent in chunks."""

from __future__ import annotations

import logging
import os
import pydoc
import queue
import re
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lagcli.arrays import Numbers
from lagcli.engine.contract import Interrupted
from lagcli.errors import FileError, UsageError
from lagcli.prose import counted
from lagcli.sweeps.plan.plan import Spec
from lagcli.sweeps.row_results import FAILED, Results
from lagcli.sweeps.rows.rows import Runner
from lagcli.sweeps.rows.workers import Chunks
from lagcli.version import __version__

if TYPE_CHECKING:
    from distributed import Client, Future


#: Timeout of the connection to a scheduler, s.
PATIENCE = 10.0
_LOOK = 1.0  # s between two queries of the workers
_TICK = 0.1  # s between two checks for cancellation


class Cluster:
    """Context manager for the workers of a scheduler; `run` runs rows on them.

    Parameters
    ----------
    address : str
        ``tcp://HOST:PORT`` (or another protocol of Dask's), or ``local:N`` for a scheduler and N
        worker processes on this machine, which end with the context.
    say : callable
        Receives messages for the user: a lost worker, waiting for workers.

    Raises
    ------
    UsageError
        The address is invalid, `distributed` is not installed, or a worker has another version of
        lagcli.
    FileError
        No scheduler answers.
    """

    def __init__(self, address: str, say: Callable[[str], None] = lambda text: None):
        self.address, self.say = address, say
        self._workers_wanted = _local_workers(address)
        self._opened = ExitStack()
        self._client: Client
        self._threads: dict[str, int] = {}
        self._waiting = False

    def __enter__(self) -> Cluster:
        with ExitStack() as stack:
            self._client = stack.enter_context(_connected(self.address, self._workers_wanted))
            self._look()
            self._opened = stack.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._opened.close()

    def run(
        self, spec: Spec, chunks: Chunks, check_cancelled: Callable[[], None]
    ) -> Iterator[Results]:
        """Run rows; yield results as they are completed, in any order.

        Parameters
        ----------
        spec : Spec
        chunks : Chunks
            Iterated as workers take rows, so that few are in flight.
        check_cancelled : callable
            Called several times a second; an exception ends the runs.

        Yields
        ------
        Results
            Of each row once. A row that terminates its processes is a failed row.

        Raises
        ------
        UsageError
            A worker has another version of lagcli.
        FileError
            The scheduler no longer answers.
        """
        flight = Flight(self._client, spec, chunks)
        looked = time.monotonic()
        try:
            while flight.fill(sum(self._threads.values())):
                check_cancelled()
                if time.monotonic() - looked > _LOOK:
                    self._look()
                    looked = time.monotonic()
                ended = flight.wait(_TICK)
                if ended is not None:
                    yield from self._received(flight, *ended)
        finally:
            flight.cancel()

    def _received(self, flight: Flight, future: Future[Any], numbers: Numbers) -> Iterator[Results]:
        """Return the results of a chunk, or handle its failure."""
        from distributed import KilledWorker

        if future.status == "cancelled":
            raise self._gone()
        if future.status == "lost":  # lost with its worker; it is repeated
            flight.expect(future, numbers)
            return
        try:
            answer = future.result(timeout=PATIENCE)
        except KilledWorker as error:
            deaths = error.allowed_failures + 1
            if flight.alone:
                yield _lost(numbers, flight.spec, deaths)
                return
            again = "it runs again alone" if len(numbers) == 1 else "they run again in parts"
            self.say(f"{_processes(deaths)} died with {_rows(numbers)}; {again}")
            flight.again(numbers)
        except TimeoutError:
            self._look()
            flight.expect(future, numbers)
        except Exception:
            self._check_versions(self._client.nthreads())  # a bug, or another version?
            raise
        else:
            if answer.version != __version__:
                raise _other_version(answer.worker, answer.version)
            if answer.results is None:
                raise RuntimeError(f"on the worker {answer.worker}:\n{answer.bug}")
            flight.chunks.took(len(numbers), answer.seconds)
            yield answer.results

    def _look(self) -> None:
        """Report workers that have left."""
        try:
            threads = dict(self._client.nthreads())
        except (OSError, TimeoutError):
            raise self._gone() from None
        before, self._threads = self._threads, threads
        if new := threads.keys() - before.keys():
            self._check_versions(new)
        for worker in sorted(before.keys() - threads.keys()):
            self.say(f"the worker {worker} was lost; its unfinished rows are run again")
        if not threads and not self._waiting:
            self.say(f"the scheduler at {self.address} has no workers; waiting for workers")
        self._waiting = not threads

    def _check_versions(self, workers: Iterable[str]) -> None:
        # a function of the standard library: a worker may not even have lagcli
        versions = self._client.run(
            pydoc.locate, "lagcli.__version__", workers=list(workers), on_error="return"
        )
        for worker, version in versions.items():
            if version != __version__ and not isinstance(version, OSError):
                raise _other_version(worker, version)

    def _gone(self) -> FileError:
        return FileError(
            f"the scheduler at {self.address} no longer answers; the rows so far are kept,"
            " and --resume runs the others"
        )


# connecting


def _local_workers(address: str) -> int | None:
    """Return N of ``local:N``, or None for the address of a scheduler."""
    match = re.fullmatch(r"local:([0-9]{1,4})", address)
    if match and int(match[1]):
        return int(match[1])
    if not re.fullmatch(r"[a-z]+://[^/]+:[0-9]+", address):
        raise UsageError(
            f"--scheduler {address!r} is not an address; give that of a Dask scheduler,"
            " tcp://HOST:PORT, or local:N for N processes on this machine"
        )
    return None


@contextmanager
def _connected(address: str, local_workers: int | None) -> Iterator[Client]:
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise UsageError(
            f"--scheduler needs packages that are not installed ({error.name}); install them with:"
            " pip install 'lagcli[cluster]'"
        ) from None
    # messages of its loggers are replaced by those of `say`
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with ExitStack() as stack:
        if local_workers is not None:
            # a chunk that terminates its process is returned immediately, to be divided
            stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": 0}))
            cluster = LocalCluster(
                n_workers=local_workers, threads_per_worker=1, host="127.0.0.1",
                dashboard_address="127.0.0.1:0", silence_logs=logging.CRITICAL, preload=[_QUIET],
            )  # fmt: skip
            address = stack.enter_context(cluster).scheduler_address
        _check_scheduler(address)
        yield stack.enter_context(Client(address, timeout=PATIENCE, set_as_default=False))


def _check_scheduler(address: str) -> None:
    """Raise an error unless a scheduler answers; a client would wait for any other service."""
    import asyncio
    from concurrent.futures import ThreadPoolExecutor

    from distributed import rpc

    async def identity() -> str:
        async with rpc(address, timeout=PATIENCE) as there:
            return str((await there.identity())["type"])

    try:
        # in a separate thread: the caller's may have a running loop, as in a notebook
        with ThreadPoolExecutor(1) as thread:
            role = thread.submit(
                lambda: asyncio.run(asyncio.wait_for(identity(), PATIENCE))
            ).result()
    except (OSError, TimeoutError):
        raise FileError(
            f"no scheduler answers at {address} within {PATIENCE:g} s; start one with"
            " `dask scheduler`, or check host and port"
        ) from None
    if role != "Scheduler":
        raise FileError(
            f"{address} is the address of a Dask {role.lower()}; give that of the scheduler"
        )


#: Workers ignore Ctrl-C; the client ends them.
_QUIET = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"


def _other_version(worker: str, version: object) -> UsageError:
    other = f"lagcli {version}" if isinstance(version, str) else "no lagcli that can be imported"
    return UsageError(
        f"the worker {worker} has {other}, and this is lagcli {__version__}; install the"
        " same version there, and restart the worker"
    )


# messages


def _rows(numbers: Numbers) -> str:
    if len(numbers) == 1:
        return f"row {numbers[0]}"
    return f"{len(numbers)} rows, {numbers.min()} to {numbers.max()}"


def _processes(n: int) -> str:
    return counted(n, "worker process", "worker processes")


def _lost(numbers: Numbers, spec: Spec, deaths: int) -> Results:
    """Return failed results for rows that crash every process."""
    n = len(numbers)
    message = f"{_processes(deaths)} died while this row ran alone: killed, or out of memory"
    return Results(
        numbers,
        np.full(n, FAILED, dtype=np.int8),
        [message] * n,
        np.zeros((n, 3), dtype=np.int64),
        np.full((n, len(spec.measures)), np.nan),
        np.empty((n, 0, 0)),
    )


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
        numbers = self.chunks.next()
        if not len(numbers) and self.suspects and not self.under_way:
            self.alone = True
            return self.suspects.popleft()
        return numbers

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
