"""Formats of `derive` and `report`: by suffix or option, PDF by LaTeX, and what is refused."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from lagcli.cli.app import run

ROOT = Path(__file__).parents[2]
MODEL = str(ROOT / "models" / "pendulum_cartesian.yaml")

#: Programs in place of LaTeX: one keeps its input as the document, one fails.
WORKS = """#!/bin/sh
/bin/cat document.tex > document.pdf
for file in plot*.pdf; do echo "[$file]" >> document.pdf; done
"""
FAILS = """#!/bin/sh
echo '! Undefined control sequence.' > document.log
exit 1
"""


@pytest.fixture
def latex(tmp_path, monkeypatch):
    """Return a function that puts a program in place of an installed LaTeX, or none."""
    folder = tmp_path / "bin"
    folder.mkdir()

    def install(script: str | None) -> None:
        monkeypatch.setenv("PATH", str(folder))
        if script is not None:
            (folder / "pdflatex").write_text(script)
            (folder / "pdflatex").chmod(0o755)

    return install


@pytest.mark.parametrize(
    ("name", "start"),
    [
        ("e.tex", "\\documentclass"),
        ("e.md", "# Pendulum"),
        ("e.MARKDOWN", "# Pendulum"),
        ("e.txt", "Pendulum"),
        ("equations", "Pendulum"),
        ("e.json", "{"),
    ],
)
def test_the_suffix_chooses_the_format(tmp_path, name, start):
    assert run(["derive", MODEL, "-o", str(tmp_path / name)]) == 0
    assert (tmp_path / name).read_text().startswith(start)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["-o", "e.html"], "e.html: no format has the suffix .html"),
        (["-f", "latex", "-o", "e.md"], "--format latex contradicts the suffix of e.md"),
        (["--json", "-o", "e.tex"], "--json contradicts the suffix of e.tex"),
        (["-f", "pdf"], "PDF is written to a file"),
        (["-f", "pdf", "-o", "-"], "PDF is written to a file"),
        (["--fragment"], "--fragment is of LaTeX, and the format is text"),
        (["-o", "e.pdf"], "PDF is made by LaTeX, and none of pdflatex, lualatex, xelatex is"),
    ],
)
def test_other_formats_are_refused(tmp_path, monkeypatch, capsys, latex, arguments, said):
    latex(None)
    monkeypatch.chdir(tmp_path)
    assert run(["derive", MODEL, *arguments]) == 2
    assert said in " ".join((lambda x: x.err + x.out)(capsys.readouterr()).split())
    assert [x.name for x in tmp_path.iterdir()] == ["bin"]


def test_an_option_gives_the_format_of_an_unknown_suffix(tmp_path):
    target = tmp_path / "equations.out"
    assert run(["derive", MODEL, "-f", "json", "-o", str(target)]) == 0
    assert json.loads(target.read_text())["coordinates"]


def test_equations_become_pdf(tmp_path, latex):
    latex(WORKS)
    target = tmp_path / "e.pdf"
    assert run(["derive", MODEL, "--steps", "-o", str(target), "-q"]) == 0
    document = target.read_text()
    assert document.startswith("\\documentclass")
    assert "1. Coordinates" in document or "\\subsection*{1." in document
    assert "lmodern" in document.partition("\\begin{document}")[0]


def test_a_failure_of_latex_leaves_no_file(tmp_path, latex, capsys):
    latex(FAILS)
    target = tmp_path / "e.pdf"
    assert run(["derive", MODEL, "-o", str(target)]) == 4
    assert "pdflatex failed (Undefined control sequence.)" in capsys.readouterr().err
    assert not target.exists()


def test_a_report_as_pdf_has_the_equations_and_the_plots(tmp_path, latex, capsys):
    pytest.importorskip("matplotlib")
    latex(WORKS)
    file, target = tmp_path / "run.h5", tmp_path / "run.pdf"
    assert run(["simulate", MODEL, "--t-end", "0.1", "--samples", "5", "-o", str(file), "-q"]) == 0
    assert run(["report", str(file), "-o", str(target), "--title", "A & B"]) == 0
    document = target.read_text()
    assert "\\section*{A \\& B}" in document
    assert "\\subsection*{Equations of motion}" in document
    assert "5 samples from t = 0 s to 0.1 s" in document
    drawn = [f"plot{i}.pdf" for i in range(1, document.count("\\includegraphics") + 1)]
    assert drawn
    for name in drawn:  # each is in the document and in its folder
        assert f"{{{name}}}" in document
        assert f"[{name}]" in document
    capsys.readouterr()
    assert run(["report", str(file), "-o", str(target), "--force", "--modes", "start"]) == 2
    latex(None)
    (tmp_path / "bin" / "pdflatex").unlink()
    assert run(["report", str(file), "-o", str(target), "--force"]) == 2
    assert "PDF is made by LaTeX" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="needs pdflatex")
@pytest.mark.parametrize("name", ["slider_crank", "chain", "contact/bouncing_ball"])
def test_latex_sets_reports(tmp_path, name):
    file, target = tmp_path / "run.h5", tmp_path / "run.pdf"
    model = str(ROOT / "models" / f"{name}.yaml")
    assert run(["simulate", model, "-o", str(file), "-q"]) == 0
    assert run(["report", str(file), "-o", str(target), "-q"]) == 0
    assert target.read_bytes().startswith(b"%PDF")
