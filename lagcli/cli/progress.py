"""The progress bar, shown only on a terminal and for runs that take more than a moment."""

from __future__ import annotations

import os
import sys
import time
from typing import Any, Self

from lagcli.prose import counted

_PATIENCE = 0.5  # s before a bar appears, so that a short run shows none
_PERIOD = 0.1  # s between two updates: runs report more often
_LOG_PERIOD = 30.0  # s between two lines in a log, without a terminal


class _Bar:
    """A temporary bar on standard error."""

    def __init__(self, color: bool):
        self.color = color
        self.bar: Any = None
        self.task: Any = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if self.bar is not None:
            self.bar.stop()
            self.file.close()

    def open(self, doing: str, *texts: str, **task: Any) -> None:
        """Show the bar: description, bar, additional columns of rich, remaining time."""
        from rich import progress
        from rich.console import Console

        stream = sys.stderr
        self.file = os.fdopen(stream.fileno(), "w", encoding=stream.encoding, closefd=False)
        self.bar = progress.Progress(
            progress.TextColumn(doing),
            progress.BarColumn(),
            *map(progress.TextColumn, texts),
            progress.TimeRemainingColumn(),
            # a separate stream object, because standard error escapes control sequences
            console=Console(file=self.file, no_color=not self.color or None),
            transient=True,
        )
        self.task = self.bar.add_task("", **task)
        self.bar.start()


class Progress(_Bar):
    """Shows the progress of a run; called with the current time.

    Parameters
    ----------
    start, end : float
        Start and end time of the run, s.
    enabled, color : bool
    doing : str
        Description.
    """

    def __init__(
        self,
        start: float,
        end: float | None,
        enabled: bool,
        color: bool,
        doing: str = "simulating",
    ):
        super().__init__(color)
        self.start, self.end = start, end if end is not None else start
        self.enabled = enabled and sys.stderr.isatty() and self.end > self.start
        self.doing = doing
        self.due = time.monotonic() + _PATIENCE

    def __call__(self, t: float) -> None:
        """Show the progress at time t."""
        if not self.enabled:
            return
        now = time.monotonic()
        if now < self.due:
            return
        self.due = now + _PERIOD
        if self.bar is None:
            self.open(
                self.doing,
                "{task.percentage:>3.0f} %",
                "t = {task.completed:.4g} of {task.total:.4g} s",
                total=self.end - self.start,
            )
        self.bar.update(self.task, completed=t - self.start)


class RowProgress(_Bar):
    """Shows the progress of a sweep; called with the numbers of completed and of all rows.

    On a terminal, a bar with rate and remaining time; otherwise, as in logs of batch systems, a
    line every half minute.
    """

    def __init__(self, enabled: bool, color: bool):
        super().__init__(color)
        self.enabled = enabled
        self.terminal = sys.stderr.isatty()
        self.began = time.monotonic()
        self.due = self.began + (_PATIENCE if self.terminal else _LOG_PERIOD)
        self.first: int | None = None  # rows completed before the first report

    def __call__(self, done: int, rows: int) -> None:
        """Show the number of completed rows."""
        if self.first is None:
            self.first = done
        now = time.monotonic()
        if not self.enabled or now < self.due:
            return
        self.due = now + (_PERIOD if self.terminal else _LOG_PERIOD)
        rate = (done - self.first) / (now - self.began)
        if not self.terminal:
            left = f", {_duration((rows - done) / rate)} left" if rate else ""
            part = f"{done} of {counted(rows, 'row')} ({100 * done // rows} %)"
            print(f"{part}, {rate:.4g} rows/s{left}", file=sys.stderr, flush=True)
            return
        if self.bar is None:
            self.open(
                "sweeping",
                "{task.completed:.0f} of {task.total:.0f} rows",
                "{task.fields[rate]} rows/s",
                total=rows,
                completed=done,
                rate="",
            )
        self.bar.update(self.task, completed=done, rate=f"{rate:.4g}")


def _duration(seconds: float) -> str:
    """Return a time as h:mm:ss."""
    minutes, rest = divmod(int(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"
