"""Ctrl-C during a run: heeded between two pieces of work, so that the samples so far are kept."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any


class Interruption:
    """While it is entered, a signal is a wish that is noted; a second one is ``KeyboardInterrupt``.

    So is a first one until somebody asks for wishes: what lasts long before a run has samples need
    not ask.

    Signals that are ignored, or that the program around handles in its own way, are left alone,
    and so are all outside the main thread, where Python allows no handlers.

    Parameters
    ----------
    *signals : signal numbers
        ``SIGINT`` where none is given.
    """

    def __init__(self, *signals: signal.Signals):
        self._wished = self._asked = False
        self._signals = signals or (signal.SIGINT,)
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():
            for number in self._signals:
                if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                    self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def wished(self) -> bool:
        """Return whether a signal has come."""
        self._asked = True
        return self._wished

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._wished or not self._asked:
            raise KeyboardInterrupt
        self._wished = True
