"""Whatever is sent to `lagcli play`: an answer or a closed connection, and no traceback."""

from __future__ import annotations

import asyncio
import json
import os
import random
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple
from urllib.parse import urlsplit

import aiohttp
import pytest
from patience import PATIENCE
from random_cases import FUZZ_COUNT

MODEL = """\
name: ball
coordinates: [y]
parameters: {m: 1, g: 9.81}
T: m*y'^2/2
V: m*g*y
initial: {y: 0, y': 3}
simulation: {t_end: 0.1, samples: 3}
"""


class Served(NamedTuple):
    """A running server."""

    host: str
    port: int
    path: str


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    model = tmp_path_factory.mktemp("play") / "ball.yaml"
    model.write_text(MODEL)
    process = subprocess.Popen(
        [sys.executable, "-m", "lagcli", "play", str(model), "--no-browser"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    assert process.stdout is not None
    place = urlsplit(process.stdout.readline().strip())
    try:
        yield Served(place.netloc, place.port or 0, place.path)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    assert (process.returncode, said) == (0, "Press Ctrl-C to stop the server\n")


def status(served: Served, request: bytes, patience: float = PATIENCE) -> int:
    """Send bytes and return the status of the answer; 0 where there is none."""
    with socket.create_connection(("127.0.0.1", served.port), timeout=patience) as client:
        try:
            client.sendall(request)
            answer = client.recv(1 << 16)
        except (ConnectionError, TimeoutError):
            return 0
    return int(answer[9:12]) if answer else 0


REQUESTS = [
    ("OPTIONS * HTTP/1.1\r\nHost: {host}\r\n\r\n", 404),
    ("OPTIONS / HTTP/1.1\r\nHost: {host}\r\n\r\n", 404),
    ("OPTIONS {path} HTTP/1.1\r\nHost: {host}\r\n\r\n", 405),
    ("CONNECT {host} HTTP/1.1\r\nHost: {host}\r\n\r\n", 404),
    ("CONNECT elsewhere:443 HTTP/1.1\r\nHost: {host}\r\n\r\n", 404),
    ("CONNECT elsewhere:443 HTTP/1.1\r\nHost: elsewhere:443\r\n\r\n", 403),
    ("GET http://{host}{path} HTTP/1.1\r\nHost: {host}\r\n\r\n", 200),
    ("GET http://{host} HTTP/1.1\r\nHost: {host}\r\n\r\n", 404),
    ("GET ? HTTP/1.1\r\nHost: {host}\r\n\r\n", 400),
    ("GET //x HTTP/1.1\r\nHost: {host}\r\n\r\n", 404),
    ("GET {path}%00%ff HTTP/1.1\r\nHost: {host}\r\n\r\n", 404),
    ("GET {path}../play.js HTTP/1.1\r\nHost: {host}\r\n\r\n", 404),
    ("GET {path}socket HTTP/1.1\r\nHost: {host}\r\n\r\n", 400),
    ("PUT {path} HTTP/1.1\r\nHost: {host}\r\nContent-Length: 3\r\n\r\nabc", 405),
    ("POST {path} HTTP/1.1\r\nHost: {host}\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n", 400),
    ("GET {path} HTTP/1.1\r\nHost: {host}\r\nHost: {host}\r\n\r\n", None),
    ("GET {path} HTTP/1.1\r\nHost: [::1\r\n\r\n", 403),
    ("GET {path} HTTP/1.1\r\nHost: {host}\r\nX: {long}\r\n\r\n", 400),
    ("GET {path} HTTP/1.1\r\nHost: {host}\r\nContent-Length: -1\r\n\r\n", 400),
    ("GET {path} HTTP/7.5\r\nHost: {host}\r\n\r\n", 400),
    ("\0\0\0\r\n\r\n", 400),
    ("\x16\x03\x01\x02\x00\x01\x00\r\n\r\n", 400),  # the beginning of TLS
]


def written(served: Served, request: str) -> bytes:
    text = request.replace("{host}", served.host).replace("{path}", served.path)
    return text.replace("{long}", "x" * 100_000).encode("latin-1")


@pytest.mark.parametrize(("request_", "expected"), REQUESTS)
def test_odd_requests(served: Served, request_: str, expected: int | None) -> None:
    found = status(served, written(served, request_))
    assert found == expected if expected is not None else found < 500


WAIT = 0.05  # s: many of them wait for more
PIECES = [
    *(b"GET ", b"OPTIONS ", b"CONNECT ", b"POST ", b"*", b"/", b"//", b"?", b"#", b" HTTP/1.1"),
    *(b"\r\n", b"\r\n\r\n", b"\n", b"Host: ", b"Content-Length: 9", b"Upgrade: websocket"),
    *(b"Transfer-Encoding: chunked", b"Connection: upgrade", b"Origin: null", b"%00", b"\xff"),
    *(b"Expect: 100-continue", b"Cookie: a=b", b"Sec-WebSocket-Version: 13", b":", b"\0", b" "),
]


def mutated(served: Served, r: random.Random) -> bytes:
    """Return one of the requests with a few pieces cut out, put in or doubled."""
    data = written(served, r.choice([x for x, _ in REQUESTS if "{long}" not in x]))
    for _ in range(r.randint(1, 4)):
        i, j = sorted(r.randrange(len(data) + 1) for _ in range(2))
        piece = r.choice([*PIECES, served.host.encode(), served.path.encode(), r.randbytes(3)])
        data = r.choice([data[:i] + data[j:], data[:i] + piece + data[i:], data[:j] + data[i:]])
    return data


def test_mutated_requests(served: Served) -> None:
    r = random.Random(1)
    assert max(status(served, mutated(served, r), WAIT) for _ in range(100)) < 500


@pytest.mark.fuzz
def test_many_mutated_requests(served: Served) -> None:
    r = random.Random(2)
    for _ in range(FUZZ_COUNT):
        data = mutated(served, r)
        assert status(served, data, WAIT) < 500, data


VALUES = [
    *(None, True, 0, -1, 10**400, 1e308, "", "1", "y", "x'", "\ud800", "\0", "é" * 100, [], {}),
    *(["energy"], ["\ud800"], ["y:"], [[]], {"m": "2"}, {"m": "\ud800"}, {"\ud800": "1"}),
    *({"m": ""}, {"": ""}, {"m": "1e999"}, {"m": 1}, {"y": "{guess: 1}"}, {"y'": "nan"}),
]
KEYS = ["number", "set", "set_initial", "t_end", "members", "plots", "save"]


def message(r: random.Random) -> str:
    """Return what a page might send, or not."""
    if r.random() < 0.1:
        return r.choice(["", "[]", "1", "{", '"x"', "null", "[" * 10_000, "\ufeff{}", "NaN"])
    value = {"number": 1, **{key: r.choice(VALUES) for key in r.sample(KEYS, r.randint(0, 3))}}
    return json.dumps(value)


def talk(served: Served, messages: list[str]) -> None:
    """Send each message in its own session, and wait for what follows."""

    async def session(client: aiohttp.ClientSession, text: str) -> None:
        async with client.ws_connect(
            f"ws://127.0.0.1:{served.port}{served.path}socket",
            headers={"Origin": f"http://{served.host}"},
        ) as ws:
            assert (await ws.receive()).type is aiohttp.WSMsgType.BINARY
            await ws.send_str(text)
            answer = await asyncio.wait_for(ws.receive(), PATIENCE)
            assert answer.type in (aiohttp.WSMsgType.BINARY, aiohttp.WSMsgType.CLOSE), text
            if answer.type is aiohttp.WSMsgType.BINARY:
                assert b"a bug in lagcli" not in answer.data, text

    async def all_() -> None:
        async with aiohttp.ClientSession() as client:
            for text in messages:
                await session(client, text)

    # in a thread, because a browser of other tests has a loop in this one
    with ThreadPoolExecutor(1) as pool:
        pool.submit(asyncio.run, all_()).result()


def test_odd_messages(served: Served) -> None:
    r = random.Random(3)
    talk(served, [message(r) for _ in range(40)])


@pytest.mark.fuzz
def test_many_odd_messages(served: Served) -> None:
    r = random.Random(4)
    talk(served, [message(r) for _ in range(FUZZ_COUNT)])
