"""The manual page lists every command with its options, and man(1) reads it without warnings."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from lagcli.cli.app import COMMANDS, command

PAGE = Path(__file__).parents[2] / "docs" / "lagcli.1"


def test_every_command_and_option_is_listed():
    text = PAGE.read_text(encoding="utf-8").replace("\\-", "-")
    sections = dict(
        section.split(" ", 1) for section in re.split(r"^\.SS lagcli ", text, flags=re.M)[1:]
    )
    assert list(sections) == list(COMMANDS)
    for name in COMMANDS:
        listed = re.findall(r"^\.B .*?(--[\w-]+)", sections[name], flags=re.M)
        options = [p.opts for p in command(name).params if p.param_type_name == "option"]
        expected = [next(n for n in names if n.startswith("--")) for names in options]
        assert listed == expected, f"{name}: run python docs/man.py"


def test_man_reads_it_without_warnings():
    if shutil.which("man") is None or shutil.which("groff") is None:
        pytest.skip("man and groff are not installed")
    done = subprocess.run(
        ["man", "--warnings", "-l", str(PAGE)], capture_output=True, text=True, check=True,
        env={"LC_ALL": "C.UTF-8", "MANWIDTH": "80", "PATH": "/usr/bin:/bin"},
    )  # fmt: skip
    assert not done.stderr
    assert "lagcli simulate" in done.stdout
