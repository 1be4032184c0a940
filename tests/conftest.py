"""What all tests need of the process that runs them."""

import gc
import signal
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from lagcli.simulations.threads import limit_process

TESTS = Path(__file__).parent

# A job that a shell starts in the background ignores SIGINT, and so would the programs that tests
# start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Little of what collection allocates is garbage, and looking for it takes a fifth of its time.
gc.disable()

# As the command does. Without it, BLAS takes the cores from the other tests, and each run looks for
# the libraries of the process.
limit_process()


#: Tests that fork, while the process is small: a fork copies its page tables. Then folders whose
#: tests share a browser, results of every model, or start processes. They come first and in one
#: piece, so that one process runs them while another begins with the rest.
FIRST = ("unit/results/test_atomic.py", "docs", "cli", "pictures")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Order tests for `--dist worksteal`, which takes from the end of another process's tests."""
    first = [TESTS / name for name in FIRST]

    @cache
    def place(path: Path) -> int:
        holding = (i for i, one in enumerate(first) if path.is_relative_to(one))
        return next(holding, len(first))

    items.sort(key=lambda item: place(item.path))


def pytest_collection_finish(session: pytest.Session) -> None:
    """Keep the collected tests, which stay to the end, out of every later garbage collection.

    Collection has put each folder of tests before the other places of modules. Without them, later
    imports, and programs that tests start with these places, search sixty folders less.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 20, 20)
    gc.enable()
    kept = {str(place) for place in session.config.getini("pythonpath")}
    sys.path[:] = [place for place in sys.path if place in kept or TESTS not in Path(place).parents]


@pytest.fixture
def cores(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The cores of switching runs, as they are made."""
    from lagcli.engine.core.switching import SwitchingIntegrator

    made: list[SwitchingIntegrator] = []
    original = SwitchingIntegrator.__init__

    def kept(self: SwitchingIntegrator, *arguments: Any, **named: Any) -> None:
        original(self, *arguments, **named)
        made.append(self)

    monkeypatch.setattr(SwitchingIntegrator, "__init__", kept)
    return made
