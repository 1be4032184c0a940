"""The examples of docs/check.md are run as they stand."""

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
PAGE = (ROOT / "docs" / "check.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_all_examples(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "models", tmp_path / "models")
    program = tmp_path / "bin" / "lagcli"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m lagcli "$@"\n')
    program.chmod(0o755)
    environment = {
        **os.environ,
        "PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    said = []
    for kind, text in re.findall(r"```(console|sh|python)\n(.*?)```", PAGE, re.S):
        if kind == "sh" and not shutil.which("jq"):
            continue
        code = text if kind != "console" else re.sub(r"^\$ ", "", text, flags=re.M)
        command = [sys.executable, "-c", code] if kind == "python" else ["sh", "-ec", code]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        said.append(done.stdout)
    assert len(said) >= 3
    (part,) = re.findall(r"```text\n(.*?)```", PAGE, re.S)
    assert part in said[0]
    assert any("h - p_phi*Omega" in text for text in said) or not shutil.which("jq")
    assert (tmp_path / "conserved.svg").exists()
