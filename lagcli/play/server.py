"""The server of the page: files, and a WebSocket for each client."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import signal
import socket
from collections.abc import Callable
from importlib.resources import files
from pathlib import PurePosixPath
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from lagcli.errors import FileError, LagcliError
from lagcli.model.model import Model
from lagcli.pictures.plots.style import PALETTE
from lagcli.play.access import HOST, Access
from lagcli.play.client import Client
from lagcli.play.frames import encode
from lagcli.play.messages import on_page
from lagcli.play.runs import Played, PlayRequest

#: Largest message of the page, bytes; all values of a thousand bodies take a tenth.
MOST_BYTES = 1 << 20
#: Time to wait for running threads at the end, s.
PATIENCE = 0.5

_TYPES = {".js": "text/javascript", ".css": "text/css", ".html": "text/html"}


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
    found = {}
    for package, folder in (
        ("lagcli.play", "assets"),
        ("lagcli.pictures", "assets"),
        ("lagcli.pictures", "assets/vendor/uplot"),
    ):
        for file in files(package).joinpath(*folder.split("/")).iterdir():
            if PurePosixPath(file.name).suffix in _TYPES:
                found[file.name] = file.read_bytes()
    return found
