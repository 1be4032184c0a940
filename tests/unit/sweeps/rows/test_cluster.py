"""Chunks under way: how many there are, and what becomes of those that end processes.

Against a client that runs each chunk on the spot; that of a real scheduler is in
tests/cli/test_sweep_cluster.py.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.errors import FileError, UsageError
from lagcli.sweeps.row_results import COMPLETED, FAILED, Results
from lagcli.sweeps.rows import cluster
from lagcli.sweeps.rows.cluster import Answer, Cluster
from lagcli.sweeps.rows.workers import Chunks

distributed = pytest.importorskip("distributed", reason="lagcli[cluster] is not installed")


class Future:
    """A chunk that ended as soon as it was sent."""

    def __init__(self, client: Client, key: str, status: str, value: object):
        self.client, self.key, self.status, self.value = client, key, status, value
        self.waited_for = 0

    def result(self, timeout: float) -> Any:
        self.client.under_way -= 1
        if isinstance(self.value, Exception):
            raise self.value
        return self.value

    def add_done_callback(self, called: Callable[[Future], None]) -> None:
        self.waited_for += 1
        if self.status == "lost" and self.waited_for > 1:  # it was run again
            self.status = "finished"
        called(self)


class Client:
    """Runs chunks; processes die of some rows, and take chunks that are beside these with them."""

    def __init__(self, deadly: set[int] = frozenset(), threads: int = 2, beside: int = 0):  # type: ignore[assignment]
        self.deadly, self.threads, self.beside = deadly, threads, beside
        self.sent: list[np.ndarray] = []
        self.deaths = self.cancelled = self.under_way = 0
        self.version = lagcli.__version__
        self.first = "finished"

    def submit(self, function: Callable, *arguments: Any, key: str) -> Future:
        if len(arguments) == 1:
            return Future(self, key, "finished", arguments[0])
        numbers = arguments[1]
        self.under_way += 1
        self.sent.append(numbers)
        status, self.first = self.first, "finished"
        if self.deadly & set(numbers.tolist()):
            self.deaths += 1
            self.beside = 3
        elif self.beside and self.under_way > 1:  # innocent, but on the same worker
            self.beside -= 1
        else:
            n = len(numbers)
            results = Results(
                numbers, np.zeros(n, np.int8), [""] * n, np.zeros((n, 3), np.int64),
                numbers[:, None] * 1.0, np.empty((n, 0, 0)),
            )  # fmt: skip
            return Future(self, key, status, Answer("tcp://w:1", self.version, results, 0.01))
        error = distributed.KilledWorker(key, SimpleNamespace(address="tcp://w:1"), 3)
        return Future(self, key, status, error)

    def nthreads(self) -> dict[str, int]:
        return {"tcp://w:1": self.threads}

    def run(self, function: Callable, *arguments: Any, **options: Any) -> dict[str, object]:
        return dict.fromkeys(options["workers"], self.version)

    def cancel(self, futures: list[Future]) -> None:
        self.cancelled += len(futures)


class Missing:
    """Rows 0 to n."""

    def __init__(self, count: int):
        self.left, self.next = count, 0

    def take(self, count: int) -> np.ndarray:
        count = min(count, self.left)
        self.left, self.next = self.left - count, self.next + count
        return np.arange(self.next - count, self.next)


SPEC: Any = SimpleNamespace(sha256="0", measures=(("a", "a"),))


def run(
    client: Client,
    rows: int,
    said: list[str] | None = None,
    check_cancelled: Callable = lambda: None,
) -> list[Results]:
    there = Cluster("tcp://h:1", (said if said is not None else []).append)
    there._client = client  # type: ignore[assignment]
    there._look()
    return list(there.run(SPEC, Chunks(Missing(rows), 0, 1), check_cancelled))  # type: ignore[arg-type]


def test_every_row_comes_back_once() -> None:
    found = run(Client(), 1000)
    assert sorted(np.concatenate([r.numbers for r in found]).tolist()) == list(range(1000))
    assert all((r.measures[:, 0] == r.numbers).all() for r in found)


@pytest.mark.parametrize("threads", [1, 3, 16])
def test_few_chunks_are_under_way_however_many_rows_there_are(threads: int) -> None:
    client, under_way = Client(threads=threads), []
    there = Cluster("tcp://h:1")
    there._client = client  # type: ignore[assignment]
    there._look()
    chunks = Chunks(Missing(10**6), 0, 1)  # type: ignore[arg-type]
    for i, results in enumerate(there.run(SPEC, chunks, lambda: None)):
        under_way.append(len(client.sent) - i)
        if i == 50:
            assert sum(map(len, client.sent)) < 90 * 4096
        assert len(results.numbers) <= 4096
    assert max(under_way) == 2 * threads
    assert sum(map(len, client.sent)) == 10**6


@pytest.mark.parametrize("deadly", [{37}, {0, 399}, {5, 6, 7, 100}])
def test_rows_that_end_processes_are_found_and_the_others_are_run(deadly: set[int]) -> None:
    client, said = Client(deadly), []
    found = run(client, 400, said)
    status = np.full(400, -1)
    for r in found:
        assert (status[r.numbers] == -1).all()
        status[r.numbers] = r.status
    assert set(np.flatnonzero(status == FAILED)) == deadly
    assert np.count_nonzero(status == COMPLETED) == 400 - len(deadly)
    messages = {text for r in found for text in r.messages}
    assert messages == {"", "4 worker processes died while this row ran alone: killed, or out of"
                        " memory"}  # fmt: skip
    assert any("died with" in text and "they run again in parts" in text for text in said)
    assert client.deaths <= 4 * len(deadly)  # by 8: 400 rows in a few rounds


def test_a_result_that_was_lost_is_waited_for() -> None:
    client = Client()
    client.first = "lost"
    assert [len(r.numbers) for r in run(client, 8)] == [8]
    assert len(client.sent) == 1  # the scheduler runs it again by itself


def test_what_the_scheduler_dropped_ends_the_sweep() -> None:
    client = Client()
    client.first = "cancelled"
    with pytest.raises(FileError, match=r"no longer answers; .* --resume"):
        run(client, 100)
    assert client.cancelled


def test_another_version_is_rejected_though_it_came_late() -> None:
    client = Client()
    looked = []

    def check_cancelled() -> None:
        looked.append(1)
        client.version = "0.0.9"

    with pytest.raises(UsageError, match=r"tcp://w:1 has lagcli 0\.0\.9, and this is lagcli"):
        run(client, 10**5, check_cancelled=check_cancelled)
    assert looked


def test_what_a_bug_says_on_a_worker_is_told() -> None:
    client = Client()
    submit = client.submit

    def broken(*arguments: Any, **options: Any) -> Future:
        future = submit(*arguments, **options)
        if isinstance(future.value, Answer):
            future.value = Answer("tcp://w:1", lagcli.__version__, bug="ZeroDivisionError: …")
        return future

    client.submit = broken  # type: ignore[method-assign]
    with pytest.raises(RuntimeError, match="on the worker tcp://w:1:\nZeroDivisionError"):
        run(client, 10)


def test_an_interrupt_leaves_nothing_under_way() -> None:
    client, seen = Client(), []

    def check_cancelled() -> None:
        seen.append(1)
        if len(seen) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(client, 10**6, check_cancelled=check_cancelled)
    assert client.cancelled == 4
    assert len(client.sent) == 6


@pytest.mark.parametrize(
    "address", ["localhost", "local:0", "local:٢", "local:", "tcp://", "tcp://h", "", "h:1"]
)
def test_addresses_that_are_none(address: str) -> None:
    with pytest.raises(UsageError, match="is not an address; give that of a Dask scheduler"):
        Cluster(address)


def test_without_distributed_the_error_names_the_extra(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UsageError, match=r"pip install 'lagcli\[cluster\]'"), Cluster("local:1"):
        pass


def test_nobody_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "PATIENCE", 0.3)

    def ask() -> None:
        with pytest.raises(FileError, match=r"no scheduler answers at tcp://127\.0\.0\.1:1 within"):
            Cluster("tcp://127.0.0.1:1").__enter__()

    async def notebook() -> None:  # which has its own loop
        ask()

    with ThreadPoolExecutor(1) as thread:
        thread.submit(ask).result()
        thread.submit(lambda: asyncio.run(notebook())).result()
