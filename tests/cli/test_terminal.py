"""What a person sees in a terminal: lines that fit, numbers that stay whole, colour."""

from __future__ import annotations

import io
import re

import pytest

from lagcli.cli.app import run
from lagcli.cli.streams import has_colour
from lagcli.cli.summary import coloured, fitted

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
    text = fitted(whole, columns)
    assert max(map(len, text.splitlines())) <= columns
    for line in text.splitlines():
        assert not re.search(r"( =| at t| at| min| max|→)$", line), line  # a number follows
    assert "\x1b" not in text  # no terminal, no colour
    assert "\u00a0" not in text


def test_numbers_keep_their_names_and_units() -> None:
    text = "  energy      balance within 3.4e-09 J, 1.4e-09 of 2.449 J, and then t = 2.34 at last"
    for width in range(60, len(text)):
        lines = fitted(text, width).split("\n")
        assert " ".join(" ".join(lines).split()) == " ".join(text.split())
        assert all(line.startswith(" " * 14) for line in lines[1:])
        assert not any(re.search(r"(\d|=)$", x) and not x.endswith("2.34") for x in lines[:-1])


def test_long_lists_say_where_the_rest_is(
    tmp_path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    few = ["simulate", "chain", "--set", "N=25", "--t-end", "0.01"]
    assert run(few) == 0
    assert "… 5 more (--json)" in capsys.readouterr().out
    assert run([*few, "-o", "run.h5"]) == 0
    said = capsys.readouterr()
    assert "… 5 more (lagcli info run.h5)" in said.out + said.err


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_colour_is_for_terminals_that_do_not_refuse_it(monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_the_status_is_coloured() -> None:
    assert coloured("a: completed, t = 0", "completed") == "a: \x1b[32mcompleted\x1b[0m, t = 0"
    assert "\x1b[31mfailed" in coloured("a: failed, t = 0", "failed")
