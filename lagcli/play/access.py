"""Access control: only the page opened with the printed address is served."""

from __future__ import annotations

import secrets
import traceback
from collections.abc import Awaitable, Callable
from typing import Any

from aiohttp import web

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]

HOST = "127.0.0.1"

#: Content security policy: nothing is loaded from elsewhere.
POLICY = (
    "default-src 'none'",
    "script-src 'self'",
    "style-src 'self'",
    "img-src data:",
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

    Parameters
    ----------
    port : int

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
        origin = request.headers.get("Origin")
        socket = request.headers.get("Upgrade") is not None
        if (socket or origin is not None) and origin not in {f"http://{h}" for h in self._hosts}:
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
