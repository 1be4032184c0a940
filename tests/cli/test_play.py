"""`lagcli play`: the address, who may use it, several clients, and how it ends."""

from __future__ import annotations

import asyncio
import http.client
import json
import os
import signal
import socket
import stat
import struct
import subprocess
import sys
import threading
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import aiohttp
import numpy as np
import pytest
from patience import PATIENCE, wait_until

import lagcli
import lagcli.play
from lagcli.cli.app import run

MODELS = Path(__file__).parents[2] / "models"
CRANK = str(MODELS / "slider_crank.yaml")


class Program:
    """`lagcli play`, running."""

    def __init__(self, *arguments: str, **options: Any):
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "lagcli", "play", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**environment, **options.pop("env", {})},
            **options,
        )
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().strip()
        place = urlsplit(self.address)
        self.host, self.port, self.path = place.netloc, place.port or 0, place.path

    def end(self, number: int = signal.SIGINT) -> tuple[int, str]:
        """Return the exit status, and what was said on standard error."""
        self.process.send_signal(number)
        try:
            _, said = self.process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise
        return self.process.returncode, said


@pytest.fixture(scope="module")
def program() -> Iterator[Program]:
    running = Program(CRANK, "--no-browser")
    yield running
    assert running.end() == (0, "Press Ctrl-C to stop the server\n")


def asked(program: Program, path: str | None = None, **headers: str) -> tuple[int, bytes]:
    """Ask for a path with headers of one's own choice."""
    connection = http.client.HTTPConnection("127.0.0.1", program.port, timeout=PATIENCE)
    connection.putrequest("GET", program.path if path is None else path, skip_host=True)
    for name, value in ({"Host": program.host} | headers).items():
        if value:
            connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, content


def decoded(frame: bytes) -> Any:
    (length,) = struct.unpack_from("<I", frame)
    numbers = np.frombuffer(frame, "<f8", offset=4 + length)

    def restored(found: dict[str, Any]) -> Any:
        place = found.get("$array")
        return numbers[place[0] : place[0] + place[1]] if place else found

    return json.loads(frame[4 : 4 + length], object_hook=restored)


Talk = Callable[[aiohttp.ClientWebSocketResponse], Awaitable[Any]]


def talked(program: Program, talk: Talk, **headers: str) -> Any:
    """Talk through a socket; in a thread, because a browser of other tests has a loop in this."""

    async def session() -> Any:
        own = {"Origin": f"http://{program.host}"} | headers
        async with (
            aiohttp.ClientSession() as client,
            client.ws_connect(
                f"ws://127.0.0.1:{program.port}{program.path}socket",
                headers={k: v for k, v in own.items() if v},
                max_msg_size=0,
            ) as ws,
        ):
            return await asyncio.wait_for(talk(ws), PATIENCE)

    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, session()).result()


async def heard(ws: aiohttp.ClientWebSocketResponse) -> Any:
    return decoded(await ws.receive_bytes())


# who may ask


def test_the_page_and_its_files_come_with_the_headers_that_keep_it_to_itself(
    program: Program,
) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", program.port, timeout=PATIENCE)
    for name in ("", "play.js", "uPlot.iife.min.js", "play.css"):
        connection.request("GET", program.path + name)
        answer = connection.getresponse()
        assert answer.status == 200
        assert len(answer.read()) > 300
        policy = answer.headers["Content-Security-Policy"]
        assert "default-src 'none'; script-src 'self'; style-src 'self'" in policy
        assert "unsafe" not in policy
        assert answer.headers["Referrer-Policy"] == "no-referrer"
        assert answer.headers["Cache-Control"] == "no-store"
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
    connection.close()


@pytest.mark.parametrize(
    "path",
    ["/", "/x/", "/x/socket", "/favicon.ico", "//", "/%00/", "/../", "/{}x/", "/{}", "/%C3%A9/"],
)
def test_without_the_token_there_is_nothing(program: Program, path: str) -> None:
    wrong = path.replace("{}", program.path.strip("/"))
    assert asked(program, wrong) == (404, b"")


@pytest.mark.parametrize(
    "name", ["nothing.js", "../play.js", "..%2fserver.py", "a/b", "play.html/x"]
)
def test_there_are_no_other_files(program: Program, name: str) -> None:
    assert asked(program, program.path + name) == (404, b"")


@pytest.mark.parametrize("host", ["evil.example", "evil.example:{}", "127.0.0.1", "[::1]:{}"])
def test_another_host_is_rejected(program: Program, host: str) -> None:
    assert asked(program, Host=host.replace("{}", str(program.port))) == (403, b"")


def test_what_is_no_request_is_told_so_and_reported_nowhere_else(program: Program) -> None:
    of_aiohttp = tuple(map(int, version("aiohttp").split(".")[:2])) >= (3, 14)
    assert asked(program, Host="")[0] == (400 if of_aiohttp else 403)
    with socket.create_connection(("127.0.0.1", program.port), timeout=PATIENCE) as other:
        other.sendall(b"nonsense\r\n\r\n")
        assert b" 400 " in other.recv(1000)


def test_localhost_is_a_name_of_the_host(program: Program) -> None:
    assert asked(program, Host=f"localhost:{program.port}")[0] == 200


@pytest.mark.parametrize("origin", ["", "null", "http://evil.example", "https://{}", "http://{}.x"])
def test_a_socket_of_another_origin_is_rejected(program: Program, origin: str) -> None:
    with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
        talked(program, heard, Origin=origin.replace("{}", program.host))
    assert refused.value.status == 403


def test_a_socket_without_the_token_is_rejected(program: Program) -> None:
    status, content = asked(
        program,
        "/wrong/socket",
        Origin=f"http://{program.host}",
        Upgrade="websocket",
        Connection="Upgrade",
        **{"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version": "13"},
    )
    assert (status, content) == (404, b"")


def test_only_this_machine_is_listened_to(program: Program) -> None:
    addresses = {x[4][0] for x in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    for address in addresses - {"127.0.0.1"}:
        with pytest.raises(OSError, match=r"."):
            socket.create_connection((address, program.port), timeout=2).close()


# what is answered


def test_a_client_is_told_what_can_be_moved_and_gets_the_numbers_of_simulate(
    program: Program,
) -> None:
    async def talk(ws: aiohttp.ClientWebSocketResponse) -> Any:
        hello = await heard(ws)
        await ws.send_json({"number": 1, "set": {"m": "2.5"}, "plots": ["multipliers"]})
        return hello, await heard(ws)

    hello, answer = talked(program, talk)
    assert hello["name"] == "Slider-crank"
    assert [c["name"] for c in hello["controls"]][:3] == ["m", "r", "l"]
    model = lagcli.load(CRANK, set={"m": "2.5"})
    trajectory = lagcli.simulate(model)
    (series,) = answer["plots"]["multipliers"]["series"]
    assert np.array_equal(series["values"], trajectory.multipliers[:, 0])
    assert len(answer["scene"]["points"]["B"][0]) == len(trajectory.time)


def test_two_clients_do_not_disturb_each_other(program: Program) -> None:
    async def talk(ws: aiohttp.ClientWebSocketResponse, mass: str) -> list[float]:
        await heard(ws)
        found = []
        for number in range(1, 9):
            await ws.send_json({"number": number, "set": {"m": mass}, "t_end": "0.2"})
            found.append((await heard(ws))["values"]["m"])
        return found

    results: dict[str, Any] = {}

    def client(mass: str) -> None:
        results[mass] = talked(program, lambda ws: talk(ws, mass))

    threads = [threading.Thread(target=client, args=[m]) for m in ("2", "3")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
    assert results == {"2": [2.0] * 8, "3": [3.0] * 8}


def test_errors_are_the_models_and_the_file_can_be_saved(program: Program) -> None:
    async def talk(ws: aiohttp.ClientWebSocketResponse) -> Any:
        await heard(ws)
        await ws.send_json({"number": 1, "set": {"m": "0"}})
        wrong = await heard(ws)
        values = {"set": {"m": "2"}, "set_initial": {"phi": "0.2"}, "t_end": "1"}
        await ws.send_json({"number": 2, "save": True, **values})
        saved = await heard(ws)
        await ws.send_json({"number": 3, "save": True, "set": {"m": "0 0"}})
        return wrong, saved, await heard(ws)

    wrong, saved, unsaved = talked(program, talk)
    assert "no inertia" in wrong["error"]
    assert "--set m=0" in wrong["command"]
    model = lagcli.load_text(saved["file"])
    assert (model.parameters["m"].value, model.initial["phi"].value) == (2.0, 0.2)
    assert "# the other solution of the constraint" in saved["file"]
    assert "m = 0 0" in unsaved["error"]


@pytest.mark.parametrize(
    "text", ["", "[]", "null", "{", '"x"', "[" * 100_000, '{"number": 1, "set": 3}', "1e999"]
)
def test_nonsense_ends_the_talk_and_nothing_else(program: Program, text: str) -> None:
    async def talk(ws: aiohttp.ClientWebSocketResponse) -> Any:
        await heard(ws)
        await ws.send_str(text)
        return (await ws.receive()).type

    assert talked(program, talk) is aiohttp.WSMsgType.CLOSE
    assert asked(program)[0] == 200


def test_clients_that_leave_without_a_word_leave_the_program_running(program: Program) -> None:
    async def talk(ws: aiohttp.ClientWebSocketResponse, seconds: float) -> None:
        await heard(ws)
        for number in range(1, 4):
            await ws.send_json({"number": number, "plots": ["coordinates", "energies", "powers"]})
            await asyncio.sleep(seconds)
        ws._response.connection.transport.abort()  # type: ignore[union-attr]

    for i in range(30):
        talked(program, lambda ws, i=i: talk(ws, i * 1e-3))  # type: ignore[misc]
    assert asked(program)[0] == 200
    assert program.process.poll() is None


# how it begins and ends


Fails = Callable[..., tuple[int, str]]


@pytest.fixture
def fails(capsys: pytest.CaptureFixture[str]) -> Fails:
    """Run a command that ends before it serves; return its status and what it says."""

    def call(*arguments: str) -> tuple[int, str]:
        status = run(["play", "--no-browser", *arguments])
        out, said = capsys.readouterr()
        assert "Traceback" not in said
        assert not out
        return status, said

    return call


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        ([CRANK, "--set", "mm=2"], 2, "did you mean `m`"),
        ([CRANK, "--set", "mm"], 2, "NAME=VALUE"),
        ([CRANK, "--set-initial", "psi=0.3"], 2, "violate the constraint"),
        ([CRANK, "--set", "m=0"], 3, "no inertia"),
        ([CRANK, "--t-end", "-1"], 2, "t_end"),
        ([CRANK, "--timeout", "0"], 2, "timeout"),
        ([CRANK, "--port", "70000"], 2, "70000"),
        (["nowhere.yaml"], 4, "nowhere.yaml"),
    ],
)
def test_what_is_wrong_is_reported_before_anything_is_served(
    fails: Fails, arguments: list[str], status: int, words: str
) -> None:
    found, said = fails(*arguments)
    assert found == status
    assert words in said


def test_without_aiohttp_it_says_what_to_install(
    fails: Fails, monkeypatch: pytest.MonkeyPatch
) -> None:
    # the package of the import below takes this one's place as an attribute, too
    monkeypatch.setattr(lagcli, "play", lagcli.play, raising=False)
    for name in [m for m in sys.modules if m.startswith(("aiohttp", "lagcli.play"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    assert fails(CRANK) == (
        2,
        "error: lagcli play needs aiohttp, which is not installed:"
        " pip install 'lagcli[pictures]'\n",
    )


def test_a_port_that_is_taken_is_reported(fails: Fails, program: Program) -> None:
    assert fails(CRANK, "--port", str(program.port)) == (
        4,
        f"error: port {program.port} of 127.0.0.1 cannot be opened: Address already in use;"
        " choose another one, or none for a free one\n",
    )


def test_a_chosen_port_is_free_again_at_once_under_another_token() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    tokens = set()
    for _ in range(2):
        running = Program(CRANK, "--no-browser", "--quiet", "--port", str(port))
        assert running.port == port
        assert asked(running)[0] == 200
        tokens.add(running.path.strip("/"))
        assert running.end() == (0, "")
    assert len(tokens) == 2
    assert all(len(token) >= 32 for token in tokens)


def test_it_ends_immediately_while_a_client_waits_for_a_long_run() -> None:
    running = Program(CRANK, "--no-browser", "--timeout", "100000")

    async def talk(ws: aiohttp.ClientWebSocketResponse) -> Any:
        await heard(ws)
        await ws.send_json({"number": 1, "t_end": "1e9"})
        await asyncio.sleep(0.3)  # until it has begun, where little else runs
        ended = await asyncio.to_thread(running.end, signal.SIGTERM)
        return ended, (await ws.receive()).data

    ended, code = talked(running, talk)
    assert ended == (0, "Press Ctrl-C to stop the server\n")
    assert code == aiohttp.WSCloseCode.GOING_AWAY


@pytest.mark.slow
def test_a_model_from_standard_input_in_the_readers_browser(tmp_path: Path) -> None:
    browser, seen = tmp_path / "browser", tmp_path / "seen"
    browser.write_text(f"#!/bin/sh\nprintf %s \"$1\" > '{seen}'\n")
    browser.chmod(browser.stat().st_mode | stat.S_IXUSR)
    with open(CRANK, encoding="utf-8") as text:
        running = Program("-", "--set", "m=4", stdin=text, env={"BROWSER": f"{browser} %s"})

    async def talk(ws: aiohttp.ClientWebSocketResponse) -> Any:
        await heard(ws)
        await ws.send_json({"number": 1, "t_end": "0.1"})
        return await heard(ws)

    answer = talked(running, talk)
    assert answer["values"]["m"] == 4
    assert answer["command"] == "lagcli simulate - --set m=4 --t-end 0.1 -o run.h5"
    wait_until(lambda: seen.exists() and seen.read_text())
    assert seen.read_text() == running.address
    assert running.end()[0] == 0
