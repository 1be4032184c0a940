"""The examples of docs/export.md are run as they stand."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.export.formats import FORMATS, code

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "export.md").read_text(encoding="utf-8")


def indented(first: str) -> str:
    """Return the indented block that begins with a line."""
    block = re.search(rf"^    {re.escape(first)}\n(?:(?:    .*)?\n)*", PAGE, re.M)
    assert block is not None
    return re.sub(r"^    ", "", block[0], flags=re.M)


def test_the_examples_in_python_print_what_the_page_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}
    examples = re.findall(r"```python\n([^`]*)```\n\n((?:    .*\n)+)", PAGE)
    assert len(examples) == PAGE.count("```python")
    for text, expected in examples:
        printed = StringIO()
        with redirect_stdout(printed):
            exec(text, names)
        assert printed.getvalue() == re.sub(r"^    ", "", expected, flags=re.M)


def test_the_table_has_every_format() -> None:
    rows = re.findall(r"^\| `(\w+)` \| `(\.\w+)` \|", PAGE, re.M)
    assert rows == [(row.name, row.suffix) for row in FORMATS.values()]


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_program_in_c_is_compiled_and_run_as_shown(tmp_path: Path) -> None:
    source = code(lagcli.load("slider_crank"), "c")
    (tmp_path / "slider_crank.c").write_text(source, "utf-8")
    command = re.search(r"^    (cc .*)$", PAGE, re.M)
    assert command is not None
    subprocess.run(command[1], shell=True, cwd=tmp_path, check=True)
    assert len((tmp_path / "run.csv").read_text().splitlines()) == 602


def test_the_linear_model_in_python_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    model, slider = lagcli.load("slider_crank"), ModuleType("slider")
    exec(code(model, "python"), slider.__dict__)
    monkeypatch.setitem(sys.modules, "slider", slider)
    names: dict[str, Any] = {}
    with redirect_stdout(StringIO()):
        exec(indented("import numpy as np, slider"), names)
    f = lagcli.dynamics(model)
    expected = f.derivatives(f.t, f.q, f.v, f.values(tau=0.1))
    assert np.allclose(names["d"].a_q, expected.a_q, rtol=1e-12)
    assert np.allclose(names["d"].a_v, expected.a_v, rtol=1e-12)


def test_the_example_in_casadi_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("casadi")
    crank = ModuleType("crank")
    exec(code(lagcli.load("slider_crank"), "casadi"), crank.__dict__)
    monkeypatch.setitem(sys.modules, "crank", crank)
    examples = re.findall(r"^    import casadi as ca, crank\n(?:(?:    .*)?\n)*", PAGE, re.M)
    linear, control = (re.sub(r"^    ", "", text, flags=re.M) for text in examples)
    exec(linear, {})
    printed = StringIO()
    with redirect_stdout(printed):
        exec(control, {})
    assert f"# {printed.getvalue()}" in control


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("octave") is None, reason="Octave is not installed")
def test_the_example_in_octave_runs(tmp_path: Path) -> None:
    source = code(lagcli.load("slider_crank"), "matlab")
    (tmp_path / "slider_crank.m").write_text(source, "utf-8")
    example = indented("m = slider_crank();") + "disp(size(multipliers));"
    (tmp_path / "drive.m").write_text(example, "utf-8")
    command = ["octave", "--no-gui", "--quiet", "drive.m"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["601", "1"]


def test_the_controller_in_fmpy_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("fmpy")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "crank.fmu").write_bytes(lagcli.fmu(lagcli.load("slider_crank"), inputs=["tau"]))
    printed = StringIO()
    with redirect_stdout(printed):
        exec(indented("from fmpy import extract, read_model_description"), {})
    assert printed.getvalue() == "1.0\n"


def test_the_master_with_events_in_fmpy_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("fmpy")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ball.fmu").write_bytes(lagcli.fmu(lagcli.load("bouncing_ball"), "3.0"))
    text = PAGE[PAGE.index("### Events of a master") :]
    block = re.search(r"^    from fmpy(?:.*)\n(?:(?:    .*)?\n)*", text, re.M)
    assert block is not None
    example, printed = re.sub(r"^    ", "", block[0], flags=re.M), StringIO()
    with redirect_stdout(printed):
        exec(example, {})
    assert f"# {printed.getvalue()}" in example
