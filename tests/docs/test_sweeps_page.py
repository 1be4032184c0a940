"""The examples of docs/sweeps.md are run as they stand."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "sweeps.md").read_text(encoding="utf-8")
VOLATILE = ("time", "file", "model", "options", "seconds", "  time", "     ")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the models and, for the shell to find, lagcli."""
    place = tmp_path_factory.mktemp("page")
    shutil.copytree(ROOT / "models", place / "models")
    program = place / "bin" / "lagcli"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m lagcli "$@"\n')
    program.chmod(0o755)
    return place


def run(place: Path, *command: str) -> str:
    environment = {
        **os.environ,
        "PATH": f"{place / 'bin'}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    done = subprocess.run(
        command, cwd=place, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_all_examples_in_their_order(place: Path) -> None:
    found = re.findall(r"```(console|sh|python)\n(.*?)```", PAGE, re.S)
    assert [kind for kind, _ in found].count("console") == 2
    said = {}
    for kind, text in found:
        if kind == "python":
            said[text] = run(place, sys.executable, "-c", text)
        elif kind == "sh":
            said[text] = run(place, "sh", "-c", text)
        else:
            command, _, expected = text.removeprefix("$ ").partition("\n")
            alike(run(place, "sh", "-c", command), expected)
    out = list(said.values())
    assert len(out[1].strip("[]\n").split()) == 3  # the largest force for each of three rods
    assert out[3].endswith("status 3\n")
    assert out[-1] == "18 {}\n"
    written = {"sweep.h5", "sample.h5", "sweep.csv", "some.h5", "long.h5", "python.h5"}
    assert written == {x.name for x in place.iterdir() if x.is_file()}


def alike(got: str, shown: str) -> None:
    """Hold a command's lines to those of the page, but for times and sizes."""
    lines, expected = got.rstrip().split("\n"), shown.rstrip().split("\n")
    kept = [x for x in lines if not x.startswith(VOLATILE)]
    wanted = [x for x in expected if not x.startswith(VOLATILE)]
    assert [x.split() for x in kept] == [x.split() for x in wanted]
