"""Cancellation by a signal, checked between pieces of work so that completed samples are kept."""

from __future__ import annotations

import signal
from contextlib import suppress
from types import FrameType
from typing import Any


class Interruption:
    """Context manager that records signals as requests for cancellation.

    The first signal is recorded, a second one raises ``KeyboardInterrupt``. Until `requested` has
    been called, the first one raises it too, so that long work before the first sample need not
    check.

    Signals that are ignored, or handled by the calling program, are not changed. The same holds
    outside of the main thread, where Python permits no handlers.

    Parameters
    ----------
    *signals : signal numbers
        Signals to record; ``SIGINT`` by default.
    """

    def __init__(self, *signals: signal.Signals):
        self._requested = self._asked = False
        self._signals = signals or (signal.SIGINT,)
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Interruption:
        with suppress(ValueError):  # raised outside of the main thread
            for number in self._signals:
                if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                    self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def requested(self) -> bool:
        """Return whether a signal has been received."""
        self._asked = True
        return self._requested

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._requested or not self._asked:
            raise KeyboardInterrupt
        self._requested = True
