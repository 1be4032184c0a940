"""Which requests the server of the page answers."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from aiohttp import web
from aiohttp.test_utils import make_mocked_request
from multidict import CIMultiDict

from lagcli.play.server import Access

ACCESS = Access(8123)


def request(path: str | None = None, **headers: str) -> web.Request:
    given = {"Host": "127.0.0.1:8123", **headers}
    return make_mocked_request("GET", path or f"/{ACCESS.token}/", headers=given)


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200),
        ({"Host": "localhost:8123"}, 200),
        ({"Origin": "http://127.0.0.1:8123"}, 200),
        ({"Upgrade": "websocket", "Origin": "http://localhost:8123"}, 200),
        ({"Host": "example.org:8123"}, 403),  # a name that leads here (DNS rebinding)
        ({"Host": "127.0.0.1"}, 403),
        ({"Origin": "http://example.org"}, 403),
        ({"Origin": "https://127.0.0.1:8123"}, 403),
        ({"Upgrade": "websocket"}, 403),  # a socket must say where it comes from
    ],
)
def test_host_and_origin_are_ours(headers: dict[str, str], status: int) -> None:
    assert ACCESS.status(request(**headers)) == status


OURS, OTHER = "http://127.0.0.1:8123", "http://example.org"


@pytest.mark.parametrize("kind", [{}, {"Upgrade": "websocket"}])
@pytest.mark.parametrize(
    "origins", [[OURS, OURS], [OURS, OTHER], [OTHER, OURS], [OURS, ""], [f"{OURS}, {OTHER}"]]
)
def test_only_one_origin_is_accepted(kind: dict[str, str], origins: list[str]) -> None:
    given = CIMultiDict({"Host": "127.0.0.1:8123", **kind})
    for origin in origins:
        given.add("Origin", origin)
    asked = make_mocked_request("GET", f"/{ACCESS.token}/", headers=given)
    assert ACCESS.status(asked) == 403


@pytest.mark.parametrize("path", ["/", "/token/", "//", "/?x"])
def test_a_path_without_the_token_is_not_found(path: str) -> None:
    assert ACCESS.status(request(path)) == 404
    assert ACCESS.status(request(path, Host="example.org")) == 403


def test_each_server_has_its_token() -> None:
    assert Access(8123).token != ACCESS.token
    assert len(ACCESS.token) >= 32
    assert ACCESS.address == f"http://127.0.0.1:8123/{ACCESS.token}/"
    # browsers leave out the port of http
    assert Access(80).status(make_mocked_request("GET", "/", headers={"Host": "localhost"})) == 404


def finished(coroutine: Coroutine[Any, Any, Any]) -> Any:
    # in a thread: tests of pages leave an event loop running in this one
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, coroutine).result()


def test_refusals_have_only_a_status() -> None:
    async def answer(_: web.Request) -> web.StreamResponse:
        return web.Response(text="the page")

    async def missing(_: web.Request) -> web.StreamResponse:
        raise web.HTTPNotFound(text="what was asked for")

    def got(handler: Any, **headers: str) -> tuple[int, Any]:
        response = finished(ACCESS.middleware()(request(**headers), handler))
        return response.status, response.text

    assert got(answer) == (200, "the page")
    assert got(answer, Origin="http://example.org") == (403, None)
    assert got(missing) == (404, None)


def test_responses_are_for_this_page_alone() -> None:
    response = web.Response()
    finished(ACCESS.mark(request(), response))
    policy = response.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "connect-src 'self' ws://127.0.0.1:8123 ws://localhost:8123" in policy
    assert response.headers["Referrer-Policy"] == "no-referrer"
    assert response.headers["Cache-Control"] == "no-store"
