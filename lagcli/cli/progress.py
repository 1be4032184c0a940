"""The progress bar: on a terminal only, and only for runs that take a moment."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Any

_PATIENCE = 0.5  # s before a bar appears: a short run should leave nothing on the screen
_PERIOD = 0.1  # s between two looks at it: engines report more often than anybody can read
_LOG_PERIOD = 30.0  # s between two lines in a log, where there is no terminal


class Progress:
    """Shows how far a run has come; call it with the time reached.

    Parameters
    ----------
    start, end : float
        The run's ends, s.
    enabled, color : bool
    doing : str
        What is under way.
    """

    def __init__(
        self,
        start: float,
        end: float | None,
        enabled: bool,
        color: bool,
        doing: str = "simulating",
    ):
        self.start, self.end = start, end if end is not None else start
        self.enabled = enabled and sys.stderr.isatty() and self.end > self.start
        self.color, self.doing = color, doing
        self.due = time.monotonic() + _PATIENCE
        self.bar: Any = None
        self.task: Any = None

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.bar is not None:
            self.bar.stop()

    def __call__(self, t: float) -> None:
        """Show that the run has reached t."""
        if not self.enabled:
            return
        now = time.monotonic()
        if now < self.due:
            return
        self.due = now + _PERIOD
        if self.bar is None:
            self._open()
        self.bar.update(self.task, completed=t - self.start)

    def _open(self) -> None:
        from rich import progress
        from rich.console import Console

        console = Console(stderr=True, no_color=not self.color or None)
        self.bar = progress.Progress(
            progress.TextColumn(self.doing),
            progress.BarColumn(),
            progress.TextColumn("{task.percentage:>3.0f} %"),
            progress.TextColumn("t = {task.completed:.4g} of {task.total:.4g} s"),
            progress.TimeRemainingColumn(),
            console=console,
            transient=True,
        )
        self.task = self.bar.add_task("", total=self.end - self.start)
        self.bar.start()


class RowProgress:
    """Shows how many rows of a sweep are done; call it with their number and that of all.

    On a terminal a bar with rate and time left; elsewhere, as in the logs of batch systems, a line
    every half minute.

    Parameters
    ----------
    enabled, color : bool
    """

    def __init__(self, enabled: bool, color: bool):
        self.enabled, self.color = enabled, color
        self.terminal = sys.stderr.isatty()
        self.began = time.monotonic()
        self.due = self.began + (_PATIENCE if self.terminal else _LOG_PERIOD)
        self.first: int | None = None  # rows done before the first report
        self.bar: Any = None
        self.task: Any = None

    def __enter__(self) -> RowProgress:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.bar is not None:
            self.bar.stop()

    def __call__(self, done: int, rows: int) -> None:
        """Show that so many rows of all are done."""
        if self.first is None:
            self.first = done
        now = time.monotonic()
        if not self.enabled or now < self.due:
            return
        self.due = now + (_PERIOD if self.terminal else _LOG_PERIOD)
        rate = (done - self.first) / (now - self.began)
        if not self.terminal:
            left = f", {_duration((rows - done) / rate)} left" if rate else ""
            text = f"{done} of {rows} rows ({100 * done // rows} %), {rate:.4g} rows/s{left}"
            print(text, file=sys.stderr, flush=True)
            return
        if self.bar is None:
            self._open(done, rows)
        self.bar.update(self.task, completed=done, rate=f"{rate:.4g}")

    def _open(self, done: int, rows: int) -> None:
        from rich import progress
        from rich.console import Console

        console = Console(stderr=True, no_color=not self.color or None)
        self.bar = progress.Progress(
            progress.TextColumn("sweeping"),
            progress.BarColumn(),
            progress.TextColumn("{task.completed:.0f} of {task.total:.0f} rows"),
            progress.TextColumn("{task.fields[rate]} rows/s"),
            progress.TimeRemainingColumn(),
            console=console,
            transient=True,
        )
        self.task = self.bar.add_task("", total=rows, completed=done, rate="")
        self.bar.start()


def _duration(seconds: float) -> str:
    """Return a time as h:mm:ss."""
    minutes, rest = divmod(int(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"
