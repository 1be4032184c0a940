"""Completion: the candidates, and the scripts in real shells."""

import os
import pty
import re
import select
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from patience import PATIENCE

from lagcli.cli.app import COMMANDS, run

MODELS = Path(__file__).parents[2] / "models"


@pytest.fixture
def words(monkeypatch, capsys):
    """Return what a shell completes at the end of a line."""

    def candidates(*line):
        monkeypatch.setenv("_LAGCLI_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", " ".join(["lagcli", *line]))
        monkeypatch.setenv("COMP_CWORD", str(len(line)))
        assert run([]) == 0
        return capsys.readouterr().out.split()

    return candidates


def test_commands(words):
    assert words("") == list(COMMANDS)
    assert words("sim") == ["simulate"]


def test_options_and_their_values(words):
    assert {"--set", "--samples"} < set(words("simulate", "--s"))
    assert words("info", "--") == ["--quantiles", "--json", "--help"]
    assert words("simulate", "--method", "Rad") == ["Radau"]
    assert words("derive", "--format", "") == ["text", "latex", "markdown", "json", "pdf"]
    assert words("simulate", "--samples", "") == []


def test_models_and_files(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("mine.yaml", "run.h5", "run.csv", "notes.txt", ".hidden.yaml", "a b.yaml"):
        (tmp_path / name).touch()
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "other.yml").touch()
    assert words("derive", "")[:3] == ["folder/", "mine.yaml", "andrews_squeezer"]
    assert words("derive", "fo") == ["folder/", "four_bar"]
    assert words("derive", "folder/") == ["folder/other.yml"]
    assert words("info", "") == ["folder/", "run.csv", "run.h5"]
    assert words("new", "x.yaml", "--from", "fo") == ["four_bar"]
    assert words("plot", "run.h5", "r") == ["run.csv", "run.h5"]
    # left to the shell, which appends no blank to a folder and quotes names
    assert words("info", "fo") == words("derive", "a\\ b") == []


def test_names_of_the_model(words, tmp_path):
    line = ("simulate", "slider_crank")
    assert words(*line, "--set", "") == ["m=", "r=", "l=", "g=", "tau=", "c="]
    assert words(*line, "--set-initial", "ps") == ["psi=", "psi_dot="]
    assert words(*line, "--set", "m=2", "--set", "t") == ["tau="]
    assert words("simulate", "four_bar", "--preset", "") == ["slow", "motor", "crossed"]
    assert words("export", "slider_crank", "--set", "t") == ["tau="]
    assert words("sweep", str(MODELS / "chain.yaml"), "--vary", "m") == ["m["]
    assert words("simulate", "--set", "") == []
    broken = tmp_path / "broken.yaml"
    broken.write_text("parameters: {")
    assert words("simulate", str(broken), "--set", "") == []


class Terminal:
    """A shell on its own terminal."""

    def __init__(self, *command, folder, environment):
        self.pid, self.master = pty.fork()
        if self.pid == 0:
            os.chdir(folder)
            os.execvpe(command[0], command, environment)
        self.text = ""

    def send(self, text):
        os.write(self.master, text.encode())

    def wait_for(self, pattern):
        end = time.monotonic() + PATIENCE
        # shells redraw what they complete: with backspaces and control sequences
        while not re.search(pattern, re.sub(r"\x1b\[[?\d;]*\w|.\x08", "", self.text)):
            ready, _, _ = select.select([self.master], [], [], 0.2)
            if ready:
                self.text += os.read(self.master, 65536).decode(errors="replace")
            assert time.monotonic() < end, self.text

    def close(self):
        os.close(self.master)
        os.waitpid(self.pid, 0)


@pytest.fixture
def environment(tmp_path):
    """An environment in which `lagcli` is this one, and no start-up file is read."""
    program = tmp_path / "bin" / "lagcli"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m lagcli "$@"\n')
    program.chmod(0o755)
    (tmp_path / "mine.yaml").write_text((MODELS / "slider_crank.yaml").read_text())
    return {
        **os.environ,
        "PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        "HOME": str(tmp_path),
        "TERM": "dumb",
        "PS1": "> ",
    }


@pytest.mark.parametrize(
    ("shell", "start"),
    [
        ("bash", ["bash", "--norc", "--noprofile", "-i"]),
        ("zsh", ["zsh", "-f", "-i"]),
    ],
)
def test_in_a_terminal(shell, start, environment, tmp_path):
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    terminal = Terminal(*start, folder=tmp_path, environment=environment)
    try:
        if shell == "zsh":
            terminal.send("autoload -U compinit; compinit -u; unsetopt beep\n")
        terminal.send(
            f'eval "$(_LAGCLI_COMPLETE=source_{shell} lagcli)"; stty columns 200; echo rea""dy\n'
        )
        terminal.wait_for(r"ready\r?\n")
        line = "lagcli simulate "
        for typed, completed in [
            ("lagcli simu", ""),
            ("mi", "mine.yaml "),
            ("--set ta", "--set tau= "),
            ("--meth", "--method "),
            ("Tay", "Taylor "),
        ]:
            terminal.send(f"{typed}\t")
            line += completed
            terminal.wait_for(re.escape(line))
        terminal.send("\x03")
    finally:
        terminal.close()


def test_in_fish(environment, tmp_path):
    if shutil.which("fish") is None:
        pytest.skip("fish is not installed")

    def complete(line):
        load = "_LAGCLI_COMPLETE=source_fish lagcli | source"
        done = subprocess.run(
            ["fish", "--no-config", "-c", f"{load}; complete -C '{line}'"],
            env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE,
            check=True,
        )  # fmt: skip
        return [row.partition("\t")[0] for row in done.stdout.splitlines()]

    assert complete("lagcli simu") == ["simulate"]
    assert "mine.yaml" in complete("lagcli derive m")
    assert complete("lagcli simulate mine.yaml --set ta") == ["tau="]
    assert "mine.yaml" not in complete("lagcli simulate mine.yaml --set ")  # only names
    assert complete("lagcli simulate --method Tay") == ["Taylor"]
