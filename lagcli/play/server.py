"""The server of the page: files, access control, and a WebSocket and a thread for each client."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import secrets
import signal
import socket
import struct
import sys
import threading
import time
import traceback
from collections.abc import Awaitable, Callable, Mapping
from importlib.resources import files
from pathlib import PurePosixPath
from string import Template
from typing import Any

import numpy as np
from aiohttp import WSCloseCode, WSMsgType, web

from lagcli.arrays import Array
from lagcli.errors import FileError, LagcliError
from lagcli.json_values import json_values
from lagcli.model.model import Model
from lagcli.pictures.style import PALETTE
from lagcli.play.runs import Played, PlayRequest, on_page
from lagcli.simulations.cancellation import Interruption

#: Largest message of the page, bytes; all values of a thousand bodies take a tenth.
MOST_BYTES = 1 << 20
#: Time to wait for running threads at the end, s.
PATIENCE = 0.5

_TYPES = {".js": "text/javascript", ".css": "text/css", ".html": "text/html"}
#: The picture of the page for browsers without JavaScript, made when it is asked for.
_STILL = "still.svg"


def listen(port: int) -> socket.socket:
    """Return a socket on the loopback address; port 0 selects a free port.

    Raises
    ------
    FileError
        The port is in use, or requires privileges.
    """
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        if hasattr(socket, "SO_REUSEADDR") and hasattr(signal, "SIGKILL"):  # not on Windows
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((HOST, port))
        listening.listen()
    except OSError as error:
        listening.close()
        raise FileError(
            f"port {port} of {HOST} cannot be opened: {error.strerror}; choose another one, or none"
            " for a free one"
        ) from None
    return listening


class Server:
    """Serves the page of one model until it is stopped.

    Parameters
    ----------
    play : callable
        Returns a new `Played`: each client has its own.
    model : Model
    listening : socket
        From `listen`.
    """

    def __init__(self, play: Callable[[], Played], model: Model, listening: socket.socket):
        self._play, self._socket = play, listening
        self._title = {
            "name": model.title,
            "slug": model.name,
            "description": model.description or "",
            "palette": list(PALETTE),
        }
        self._access = Access(listening.getsockname()[1])
        self._clients: dict[web.WebSocketResponse, Client] = {}
        self._threads: list[Client] = []
        self._files = _files()

    @property
    def address(self) -> str:
        """The address of the page."""
        return self._access.address

    @property
    def busy(self) -> bool:
        """Whether a client's thread is still running."""
        return any(thread.is_alive() for thread in self._threads)

    def serve(self, ready: Callable[[], None]) -> None:
        """Serve until SIGINT or SIGTERM.

        Parameters
        ----------
        ready : callable
            Called when the page can be opened.
        """
        asyncio.run(self._serve(ready))

    async def _serve(self, ready: Callable[[], None]) -> None:
        if hasattr(signal, "SIGPIPE"):
            # a client that disconnects must not end the program with SIGPIPE
            signal.signal(signal.SIGPIPE, signal.SIG_IGN)
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:
                with contextlib.suppress(NotImplementedError):  # on Windows
                    loop.add_signal_handler(number, stop.set)
        application = web.Application(middlewares=[self._access.middleware()])
        application.on_response_prepare.append(self._access.mark)
        application.router.add_get("/{token}/socket", self._talk)
        application.router.add_get("/{token}/{file:[^/]*}", self._file)
        quiet = logging.Logger("lagcli play")  # invalid requests are not logged
        quiet.addHandler(logging.NullHandler())
        runner = web.AppRunner(application, access_log=None, shutdown_timeout=0.1, logger=quiet)
        await runner.setup()
        await web.SockSite(runner, self._socket).start()
        try:
            ready()
            await stop.wait()
        finally:
            for client in self._clients.values():
                client.close()
            closing = [ws.close(code=WSCloseCode.GOING_AWAY) for ws in self._clients]
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(asyncio.gather(*closing, return_exceptions=True), 0.2)
            await runner.cleanup()
            for thread in self._threads:
                thread.join(PATIENCE)

    async def _file(self, request: web.Request) -> web.Response:
        name = request.match_info["file"] or "play.html"
        if name == _STILL:
            return web.Response(
                text=await asyncio.to_thread(self._play().still), content_type="image/svg+xml"
            )
        if name not in self._files:
            raise web.HTTPNotFound
        kind = _TYPES[PurePosixPath(name).suffix]
        return web.Response(body=self._files[name], content_type=kind, charset="utf-8")

    async def _talk(self, request: web.Request) -> web.WebSocketResponse:
        """Communicate with one client: receive requests, send responses."""
        ws = web.WebSocketResponse(max_msg_size=MOST_BYTES, compress=False, heartbeat=30)
        await ws.prepare(request)
        loop = asyncio.get_running_loop()
        outbox: asyncio.Queue[bytes] = asyncio.Queue()

        def answer(value: dict[str, Any]) -> None:
            frame = encode(value)
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(outbox.put_nowait, frame)

        played = self._play()
        client = Client(played, answer)
        self._clients[ws] = client
        self._threads = [t for t in self._threads if t.is_alive()] + [client]
        client.start()
        sending = asyncio.create_task(_send(ws, outbox))
        try:
            outbox.put_nowait(encode({**self._title, **played.description()}))
            async for message in ws:
                if message.type is not WSMsgType.TEXT:
                    break
                try:
                    asked = json.loads(message.data)
                    wanted = PlayRequest.parsed(asked)
                except (ValueError, AttributeError, RecursionError):
                    await ws.close(code=WSCloseCode.POLICY_VIOLATION)
                    break
                if asked.get("save"):
                    outbox.put_nowait(encode(await asyncio.to_thread(_saved, played, wanted)))
                else:
                    client.ask(wanted)
        finally:
            client.close()
            sending.cancel()
            self._clients.pop(ws, None)
        return ws


async def _send(ws: web.WebSocketResponse, outbox: asyncio.Queue[bytes]) -> None:
    with contextlib.suppress(ConnectionError):  # the client has left
        while True:
            await ws.send_bytes(await outbox.get())


def _saved(played: Played, request: PlayRequest) -> dict[str, Any]:
    """Return the model file with the values of a request, or an error message."""
    try:
        return {"number": request.number, "file": played.text(request)}
    except LagcliError as error:
        return {"number": request.number, "error": on_page(str(error))}


def _files() -> dict[str, bytes]:
    """Return all files of the page."""
    contents = {}
    for package, folder in (
        ("lagcli.play", "assets"),
        ("lagcli.pictures", "assets"),
        ("lagcli.pictures", "assets/vendor/uplot"),
    ):
        for file in files(package).joinpath(*folder.split("/")).iterdir():
            if PurePosixPath(file.name).suffix in _TYPES:
                contents[file.name] = file.read_bytes()
    page, body = (Template(contents.pop(x).decode()) for x in ("play.html", "play_body.html"))
    body_of_play = body.substitute(name="lagcli play", description="")
    contents["play.html"] = page.substitute(body=body_of_play).encode()
    return contents


Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]

HOST = "127.0.0.1"

#: Content security policy: nothing is loaded from elsewhere.
POLICY = (
    "default-src 'none'",
    "script-src 'self'",
    "style-src 'self'",
    "img-src 'self' data:",
    "base-uri 'none'",
    "form-action 'none'",
    "frame-ancestors 'none'",
)
HEADERS = {
    "Referrer-Policy": "no-referrer",  # the address contains the token
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Server": "lagcli",
}


class Access:
    """Access rules of one server.

    A page of another site can make a browser send requests here, even under a name that
    leads to 127.0.0.1 (DNS rebinding). It does not have the token and cannot send this server's
    Host and Origin.

    Attributes
    ----------
    token : str
        The token, which is the first part of every path.
    """

    def __init__(self, port: int):
        self.token = secrets.token_urlsafe(24)
        self.port = port
        self._hosts = {f"{name}:{port}" for name in (HOST, "localhost")}
        if port == 80:
            self._hosts |= {HOST, "localhost"}

    @property
    def address(self) -> str:
        """The address of the page."""
        return f"http://{HOST}:{self.port}/{self.token}/"

    def status(self, request: web.Request) -> int:
        """Return 200 for an accepted request, else the status of its rejection."""
        if request.headers.getall("Host", []) not in [[host] for host in self._hosts]:
            return 403
        # OPTIONS may request *, and CONNECT no path at all
        given = request.path.removeprefix("/").partition("/")[0]
        if not secrets.compare_digest(given.encode(), self.token.encode()):
            return 404
        origins = request.headers.getall("Origin", [])
        socket = "Upgrade" in request.headers
        if (socket or origins) and origins not in [[f"http://{host}"] for host in self._hosts]:
            return 403
        return 200

    def middleware(self) -> Any:
        """Return the middleware that rejects requests; a rejection has only a status."""

        @web.middleware
        async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
            status = self.status(request)
            if status != 200:
                return web.Response(status=status)
            try:
                return await handler(request)
            except web.HTTPException as error:
                return web.Response(status=error.status)
            except Exception:
                traceback.print_exc()
                raise

        return guard

    async def mark(self, request: web.Request, response: web.StreamResponse) -> None:
        """Set the headers of a response that isolate the page."""
        policy = [*POLICY, f"connect-src 'self' ws://{HOST}:{self.port} ws://localhost:{self.port}"]
        response.headers["Content-Security-Policy"] = "; ".join(policy)
        response.headers.update(HEADERS)


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


def encode(value: Mapping[str, Any]) -> bytes:
    """Return a frame.

    Parameters
    ----------
    value : mapping
        JSON values and one-dimensional arrays. Outside of arrays, numbers that are not finite
        become null.
    """
    arrays: list[Array] = []

    def place(array: Array) -> dict[str, list[int]]:
        arrays.append(array)
        return {"$array": [sum(map(len, arrays[:-1])), len(array)]}

    text = json.dumps(json_values(value, place), ensure_ascii=False, allow_nan=False)
    header = text.encode(errors="replace")  # a message of a page may contain lone surrogates
    header += b" " * (-(4 + len(header)) % 8)
    body = b"".join(np.ascontiguousarray(a, dtype="<f8").tobytes() for a in arrays)
    return struct.pack("<I", len(header)) + header + body
