"""A client of the page, which runs the newest request."""

from __future__ import annotations

import sys
import threading
import time
import traceback
from collections.abc import Callable
from typing import Any

from lagcli.errors import LagcliError
from lagcli.play.messages import on_page
from lagcli.play.runs import Played, PlayRequest
from lagcli.simulations.cancellation import Interruption

#: Time for which a run may continue while a newer one waits, s, so that plots are updated while a
#: slider moves.
GRACE = 0.25


class _Superseded(Interruption):
    """Cancels a run whose client has left, or for which a newer request has waited long enough."""

    def __init__(self) -> None:
        super().__init__()
        self.began = time.monotonic()
        self.closed = self.newer = False

    def requested(self) -> bool:
        """Return whether to end the run."""
        return self.closed or (self.newer and time.monotonic() - self.began > GRACE)


class Client(threading.Thread):
    """Runs the requests of one client in its own thread.

    Parameters
    ----------
    played : Played
        The client's model.
    answer : callable
        Called in the thread with messages for the page.
    """

    def __init__(self, played: Played, answer: Callable[[dict[str, Any]], None]):
        # a thread that derives equations cannot be stopped: it must not block the program's exit
        super().__init__(name="lagcli play", daemon=True)
        self._played, self._answer = played, answer
        self._change = threading.Condition()
        self._waiting: PlayRequest | None = None
        self._running: _Superseded | None = None
        self._closed = False

    def ask(self, request: PlayRequest) -> None:
        """Replace the pending request and stop the current one."""
        with self._change:
            self._waiting = request
            if self._running is not None:
                self._running.newer = True
            self._change.notify()

    def close(self) -> None:
        """Stop the current run and the thread."""
        with self._change:
            self._closed = True
            if self._running is not None:
                self._running.closed = True
            self._change.notify()

    def run(self) -> None:
        """Process requests until the client is closed."""
        while True:
            with self._change:
                self._change.wait_for(lambda: self._closed or self._waiting is not None)
                if self._closed:
                    return
                request, self._waiting = self._waiting, None
                self._running = running = _Superseded()
            assert request is not None
            answer = self._answered(request, running)
            with self._change:
                self._running = None
                dropped = self._closed or answer.get("status") == "interrupted"
            if not dropped:
                self._answer(answer)

    def _answered(self, request: PlayRequest, running: Interruption) -> dict[str, Any]:
        try:
            return self._played.run(request, running)
        except LagcliError as error:
            text = on_page(str(error))
        except Exception as error:
            traceback.print_exception(error, file=sys.stderr)
            text = f"a bug in lagcli: {type(error).__name__}; the terminal shows where"
        command = self._played.command(request)
        return {"number": request.number, "error": text, "command": command}
