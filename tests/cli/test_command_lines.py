"""Command lines: words of options and arguments, their values, and the messages on mistakes."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from lagcli.cli.app import COMMANDS, run

MODELS = Path(__file__).parents[2] / "models"
CRANK = str(MODELS / "slider_crank.yaml")
SHORT = ["--t-end", "0.01", "--samples", "3"]

Printed = Callable[..., tuple[int, str, str]]


@pytest.fixture
def printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Printed:
    """Run a command line in an empty folder; return its status, output and messages."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")

    def call(*words: str) -> tuple[int, str, str]:
        status = run(list(words))
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return call


@pytest.mark.parametrize(
    "words",
    [
        ["simulate", CRANK, *SHORT],
        ["simulate", *SHORT, CRANK],
        ["simulate", "--samples=3", CRANK, "--t-end=0.01"],
        ["simulate", *SHORT, "--", CRANK],
        ["simulate", CRANK, *SHORT, "--samples", "5", "--samples", "3"],  # the last counts
        ["simulate", CRANK, "--t-end", "10 ms", "--samples", "3"],
        ["simulate", CRANK, "--t-end", "10ms", "--dt", "5 ms"],
    ],
)
def test_options_may_stand_anywhere_and_in_other_units(printed: Printed, words: list[str]) -> None:
    status, out, _ = printed(words[0], "--json", *words[1:])
    assert status == 0
    found = json.loads(out)
    assert (found["t_end"], found["samples"]) == (0.01, 3)


@pytest.mark.parametrize(
    ("words", "file"),
    [
        (["-o", "run.csv", "-q"], "run.csv"),
        (["-orun.csv", "-q"], "run.csv"),
        (["-qo", "run.csv"], "run.csv"),
        (["-qorun.csv"], "run.csv"),
        (["--output=run.csv", "--quiet"], "run.csv"),
        (["-q", "-o", "-q.csv"], "-q.csv"),  # an option's value is the next word, whatever it is
    ],
)
def test_short_options_are_joined(
    printed: Printed, tmp_path: Path, words: list[str], file: str
) -> None:
    assert printed("simulate", CRANK, *SHORT, *words) == (0, "", "")
    assert [x.name for x in tmp_path.iterdir()] == [file]


def test_values_may_begin_with_a_minus_sign(printed: Printed) -> None:
    for words in (["--t-start", "-0.01", "--t-end", "0"], ["--t-start=-0.01", "--t-end=0"]):
        status, out, _ = printed("simulate", CRANK, "--samples", "3", *words, "--json")
        assert (status, json.loads(out)["t_end"]) == (0, 0)
    assert printed("simulate", CRANK, *SHORT, "--set", "tau=-2", "-q")[0] == 0


def test_results_go_to_standard_output(printed: Printed) -> None:
    status, out, err = printed("simulate", CRANK, *SHORT, "-o", "-")
    assert (status, len([x for x in out.splitlines() if x[0].isdigit()])) == (0, 3)
    assert "completed" in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["simulate"], "Missing argument 'MODEL'."),
        (["simulate", CRANK, "--t-ned", "1"], "No such option: --t-ned"),
        (["simulate", CRANK, "--sample", "1"], "(Possible options: --samples"),
        (["simulate", CRANK, "--t-e", "1"], "No such option: --t-e"),  # no abbreviations
        (["simulate", CRANK, "-qz"], "No such option: -z"),
        (["simulate", CRANK, "-o"], "Option '-o' requires an argument."),
        (["simulate", CRANK, "--quiet=1"], "Option '--quiet' does not take a value."),
        (["simulate", CRANK, "other"], "Got unexpected extra argument(s) (other)"),
        (["simulate", CRANK, "--", "--quiet"], "Got unexpected extra argument(s) (--quiet)"),
        (["simulate", CRANK, "--samples", "5.5"], "'--samples': '5.5' is not a valid int."),
        (["simulate", CRANK, "--rtol", "x"], "'--rtol': 'x' is not a valid float."),
        (["simulate", CRANK, "--t-end", "5 kg"], "'5 kg' is in kg, but must be in s."),
        (["simulate", CRANK, "--method", "dop"], "'--method': 'dop' is not one of 'auto', "),
        (["simulate", CRANK, "--set", "m"], "--set 'm' is not of the form NAME=VALUE"),
        (["sweep", CRANK, "--vary", "m=1,2"], "Missing option '--output' / '-o'."),
        (["sweep", CRANK, "-j", "0"], "'--jobs' / '-j': 0 is not in the range x>=1."),
        (["derive", CRANK, "-f", "html"], "'--format' / '-f': 'html' is not one of 'text', "),
        (["play", CRANK, "--port", "70000"], "70000 is not in the range 0<=x<=65535."),
        (["simulat", CRANK], "No such command 'simulat'. Did you mean 'simulate'?"),
        (["frobnicate"], "No such command 'frobnicate'."),
        (["--quiet"], "No such option: --quiet"),
    ],
)
def test_mistakes_have_status_2(printed: Printed, words: list[str], message: str) -> None:
    status, out, err = printed(*words)
    assert (status, out) == (2, "")
    assert message in err


def test_without_a_command_the_help_is_a_message(printed: Printed) -> None:
    status, out, err = printed()
    assert (status, out) == (2, "")
    assert printed("--help") == (0, err, "")


@pytest.mark.parametrize("columns", ["40", "80", "100", "200"])
def test_help_summarizes_every_command_in_full(
    printed: Printed, monkeypatch: pytest.MonkeyPatch, columns: str
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    _, out, err = printed("--help")
    assert not err
    assert max(map(len, out.splitlines())) <= max(int(columns), 50)
    listed = out.partition("Commands:\n")[2]
    assert all(f"\n  {name} " in f"\n{listed}" for name in COMMANDS)
    assert int(columns) < 80 or "..." not in listed


def test_help_of_a_command_comes_before_mistakes(printed: Printed) -> None:
    for words in (["simulate", "--help"], ["simulate", "-h", "a", "b"], ["simulate", "-qh"]):
        status, out, err = printed(*words)
        assert (status, err) == (0, "")
        assert out.startswith("Usage: lagcli simulate [OPTIONS] {MODEL}\n\n  Simulate the motion")


def test_errors_of_a_model_are_json_with_the_option(printed: Printed) -> None:
    status, out, err = printed("simulate", "none.yaml", "--json")
    assert (status, json.loads(out)["status"]) == (4, "error")
    assert err.startswith("error: there is no file none.yaml")
