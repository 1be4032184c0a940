"""What a person sees in a terminal: lines that fit, numbers that stay whole, colour."""

from __future__ import annotations

import fcntl
import io
import os
import re
import struct
import subprocess
import sys
import termios
from contextlib import suppress
from pathlib import Path

import pytest

from lagcli.cli.app import run
from lagcli.cli.streams import has_colour
from lagcli.cli.styles import print_listing
from lagcli.errors import display_width

MODELS = ["slider_crank", "chain", "parallelogram", "rolling_disk"]


@pytest.mark.parametrize("columns", [80, 100])
@pytest.mark.parametrize("name", MODELS)
def test_summaries_fit_the_terminal(
    name: str, columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "60")  # this is no terminal
    assert run(["simulate", name, "--t-end", "0.05"]) == 0
    whole = capsys.readouterr().out
    assert max(map(len, whole.splitlines())) > 60
    assert max(map(len, whole.splitlines())) <= 100
    screen = Screen()
    monkeypatch.setattr("sys.stdout", screen)
    monkeypatch.setenv("COLUMNS", str(columns))
    assert run(["simulate", name, "--t-end", "0.05", "--no-color"]) == 0
    text = screen.getvalue()
    assert max(map(len, text.splitlines())) <= columns
    for line in text.splitlines():
        assert not re.search(r"( =| at t| at| min| max|→)$", line), line  # a number follows
    assert "\x1b" not in text  # no terminal, no colour
    assert "\u00a0" not in text


def test_long_lists_say_where_the_rest_is(
    tmp_path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    masses = [f"x_{name}" for name in "abcdefghijklmnopqrstuvwxy"]
    (tmp_path / "many.yaml").write_text(
        f"coordinates: [{', '.join(masses)}]\nparameters: {{m: 1 kg}}\n"
        f"T: m/2*({' + '.join(x + chr(39) + '^2' for x in masses)})\nV: 0\n"
        "constraints:\n" + "".join(f"  hold_{x}: {x} = 0\n" for x in masses)
        + "initial:\n" + "".join(f"  {x}: 0\n  {x}': 0\n" for x in masses)
    )  # fmt: skip
    few = ["simulate", "many.yaml", "--t-end", "0.01"]
    assert run(few) == 0
    assert "… 5 more (--json)" in capsys.readouterr().out
    assert run([*few, "-o", "run.h5"]) == 0
    said = capsys.readouterr()
    assert "… 5 more (lagcli info run.h5)" in said.out + said.err


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_colour_is_for_terminals_that_do_not_disable_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    assert has_colour(Terminal())
    assert not has_colour(io.StringIO())
    assert not has_colour(Terminal(), refused=True)
    monkeypatch.setenv("NO_COLOR", "1")
    assert not has_colour(Terminal())
    monkeypatch.delenv("NO_COLOR")
    monkeypatch.setenv("TERM", "dumb")
    assert not has_colour(Terminal())


def in_terminal(arguments: list[str], columns: int, cwd: Path, **env: str) -> tuple[str, int]:
    """Run lagcli in a terminal of some columns; return what it shows and its exit status."""
    environment = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "NO_COLOR")}
    environment |= {"TERM": "xterm", "PYTHONIOENCODING": "utf-8", **env}
    ours, theirs = os.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 50, columns, 0, 0))
    command = [sys.executable, "-m", "lagcli", *arguments]
    with subprocess.Popen(
        command, stdin=theirs, stdout=theirs, stderr=theirs, cwd=cwd, env=environment
    ) as process:
        os.close(theirs)
        shown = b""
        with suppress(OSError):  # the other end is closed
            while part := os.read(ours, 65536):
                shown += part
    os.close(ours)
    return shown.decode().replace("\r\n", "\n"), process.returncode


RUN = ["simulate", "slider_crank", "--t-end", "0.05"]


def test_the_status_is_coloured_in_a_terminal(tmp_path: Path) -> None:
    shown, status = in_terminal(RUN, 80, tmp_path)
    assert status == 0
    assert "slider_crank: \x1b[32mcompleted\x1b[0m, t = 0" in shown
    assert "  \x1b[1mmultipliers\x1b[0m\n" in shown
    assert "lambda.guide \x1b[2m[N]\x1b[0m" in shown
    for options, env in (([], {"NO_COLOR": "1"}), (["--no-color"], {})):
        shown, status = in_terminal([*RUN, *options], 80, tmp_path, **env)
        assert status == 0
        assert "slider_crank: completed, t = 0" in shown
        assert "\x1b" not in shown
        assert "\\x1b" not in shown


@pytest.mark.parametrize("columns", [60, 80, 120])
@pytest.mark.parametrize("command", [["check", "parallelogram"], ["info", "run.h5"]])
def test_styles_change_no_character(
    command: list[str], columns: int, files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(files)
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TERM", "xterm")
    shown = {}
    for value in ("", "1"):
        monkeypatch.setenv("NO_COLOR", value)
        monkeypatch.setattr("sys.stdout", screen := Screen())
        assert run(command) == 0
        shown[value] = screen.getvalue()
    assert "\x1b[1m" in shown[""]
    assert "\x1b" not in shown["1"]
    assert re.sub(r"\x1b\[\d+m", "", shown[""]) == shown["1"]


def test_errors_break_between_words_and_show_their_marks(tmp_path: Path) -> None:
    energy = "T: m/2*x'^2 " + "+ 0*x*m" * 18 + " + mm*x^2\n"
    start = "coordinates: [x]\nparameters: {m: 1 kg}\ninitial: {x: 0, x': 0}\n"
    (tmp_path / "wrong.yaml").write_text(f"{start}{energy}V: 0\n")
    shown, status = in_terminal(["check", "wrong.yaml"], 60, tmp_path, NO_COLOR="1")
    assert status == 2
    lines = shown.splitlines()
    assert max(map(len, lines)) <= 60
    under = next(i for i, line in enumerate(lines) if line.endswith("^^"))
    assert lines[under - 1][lines[under].index("^") :].startswith("mm*")
    coloured, _ = in_terminal(["check", "wrong.yaml"], 60, tmp_path)
    assert "\x1b[31merror[unknown-name]\x1b[0m" in coloured
    assert re.sub(r"\x1b\[\d+m", "", coloured) == shown


class Screen(Terminal):
    """A terminal of the test's own process, instead of standard output."""

    encoding = "utf-8"


def test_styles_of_tables_change_no_character(monkeypatch: pytest.MonkeyPatch) -> None:
    # column 20, where labels end, is anywhere in a table
    text = "status              completed\n\nmultiplier: min … max\n"
    text += "pin_x [N]  -665.314 (0.232 s) …  592.936 (0.555 s)\nflat [N]   -"
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    print_listing(text, 20, screen := Screen())
    shown = screen.getvalue()
    assert re.sub(r"\x1b\[\d+m", "", shown) == f"{text}\n"
    assert "\npin_x \x1b[2m[N]\x1b[0m  -665" in shown


COMMANDS = [
    ["info", "chain.h5"],
    ["info", "run.h5"],
    ["info", "sweep.h5"],
    ["simulate", "parallelogram", "--t-end", "0.05", "--no-color"],
    ["check", "heavy_top"],
    ["derive", "andrews_squeezer"],
    ["equilibrium", "pendulum_cartesian", "--all", "--starts", "8"],
    ["linearize", "chain", "--set", "N=5", "--equilibrium"],
    ["modes", "chain", "--set", "N=5", "--equilibrium"],
    ["compare", "slider_crank", "slider_crank_textbook", "--t-end", "0.2"],
    ["compare", "slider_crank", "--method", "DOP853,Radau", "--t-end", "0.1"],
    ["models"],
]


@pytest.fixture(name="files", scope="module")
def _files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("terminal")
    quiet = ["--t-end", "0.01", "--quiet"]
    chain, crank, rows = (str(folder / x) for x in ("chain.h5", "run.h5", "sweep.h5"))
    assert run(["simulate", "chain", "--set", "N=100", "-o", chain, *quiet]) == 0
    assert run(["simulate", "slider_crank", "-o", crank, *quiet]) == 0
    vary = ["--vary", "l=0.2:0.4:0.1", "--measure", "peak=max(abs(lambda.guide))"]
    assert run(["sweep", "slider_crank", *vary, "-o", rows, *quiet]) == 0
    return folder


@pytest.mark.parametrize(
    ("arguments", "columns"),
    [
        *((command, 80) for command in COMMANDS[3:-1]),
        *(
            pytest.param(command, 80, marks=pytest.mark.slow)
            for command in (*COMMANDS[:3], COMMANDS[-1])
        ),
        *((command, 120) for command in COMMANDS[:3]),
        *((command, 60) for command in (*COMMANDS[:2], COMMANDS[-1])),
    ],
    ids=lambda x: " ".join(x) if isinstance(x, list) else str(x),
)
def test_commands_fit_the_terminal(
    arguments: list[str], columns: int, files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(files)
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("NO_COLOR", "1")
    screen = Screen()
    monkeypatch.setattr("sys.stdout", screen)
    assert run(arguments) == 0
    shown = screen.getvalue().rstrip("\n").split("\n")
    assert len(shown) > 2
    for line, after in zip(shown, [*shown[1:], ""], strict=True):
        assert display_width(line) <= columns, line
        assert not re.search(r" (=|->|→|at t)$", line), line  # a value follows
        assert not re.match(r" *(\[\S+\]|kg|rad)(,|$)", after), after  # a unit of the line before
    assert "\x1b" not in screen.getvalue()


def test_info_names_families_once(
    files: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(files)
    assert run(["info", "chain.h5"]) == 0
    text = capsys.readouterr().out
    assert "x[1..100] [m], y[1..100] [m]\n" in text
    assert "N = 100, l = 1 m, m[1..100] = 0.01 kg" in text
    assert re.search(r"atol at end +x\[1\.\.100\] = \S+ … \S+, y\[1\.\.100\] = ", text)
    residuals, forces = (x for x in text.splitlines() if x.startswith("rod[1..100] "))
    assert re.fullmatch(r"rod\[1\.\.100\] \[m\^2\] +(\S+ +){3}\S+", residuals)
    assert re.search(r" -\S+ \(rod\[\d+\], \S+ s\) … -\S+ \(rod\[\d+\], \S+ s\)$", forces)


HELP = ["", "simulate", "sweep", "derive", "check", "fit", "compare", "plot", "play", "info"]


@pytest.mark.parametrize("command", HELP)
def test_help_fits_the_terminal(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert run([*command.split(), "--help"]) == 0
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80
