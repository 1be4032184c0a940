"""The examples of docs/sensitivity.md and docs/fit.md are run as they stand, in their order."""

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


@pytest.mark.parametrize(
    ("page", "files", "said"),
    [
        (
            "sensitivity.md",
            ("sensitivity.h5", "sensitivity.png", "band.png", "tornado.png"),
            "('m', 'l') (601, 2, 2) (601, 1, 2)",
        ),
        ("fit.md", ("fit.h5", "fit.png", "fitted.yaml", "fitted.h5"), "phi' 1"),
    ],
)
def test_all_examples(tmp_path: Path, page: str, files: tuple[str, ...], said: str) -> None:
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
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
    found = re.findall(r"```(sh|python)\n(.*?)```", text, re.S)
    assert {kind for kind, _ in found} == {"sh", "python"}
    out = ""
    for kind, example in found:
        command = [sys.executable, "-c", example] if kind == "python" else ["sh", "-ec", example]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        assert "warning" not in done.stderr
        out += done.stdout
    assert said in out
    assert [name for name in files if not (tmp_path / name).exists()] == []
