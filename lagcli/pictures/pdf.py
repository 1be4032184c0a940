"""PDF documents, made by an installed LaTeX."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

from lagcli.errors import FileError, UsageError

#: Programs that make PDF of LaTeX, best first.
_PROGRAMS = ("pdflatex", "lualatex", "xelatex")
#: Latin Modern has outlines; without it, the default fonts may be bitmaps.
_FONTS = r"\IfFileExists{lmodern.sty}{\usepackage{lmodern}}{}" + "\n"
#: Longest run of LaTeX, in s.
_PATIENCE = 300
_ERROR = re.compile(r"^! (.*)$", re.MULTILINE)


def check_latex() -> str:
    """Return the path of a program that makes PDF of LaTeX.

    Raises
    ------
    UsageError
        None is installed.
    """
    for program in _PROGRAMS:
        if path := shutil.which(program):
            return path
    raise UsageError(
        f"PDF is made by LaTeX, and none of {', '.join(_PROGRAMS)} is installed"
        " (Debian: apt install texlive-latex-recommended lmodern)"
    )


def pdf_of(source: str, files: Mapping[str, bytes] | None = None) -> bytes:
    """Return a LaTeX document as PDF.

    LaTeX runs in a temporary folder, cannot start programs, and reads and writes no files outside
    of this folder and its own.

    Parameters
    ----------
    source : str
        A complete document.
    files : mapping of str to bytes, optional
        Pictures by file name.

    Raises
    ------
    UsageError
        No LaTeX is installed.
    FileError
        LaTeX fails, with its first error.
    """
    program = check_latex()
    preamble, begin, body = source.partition(r"\begin{document}")
    source = f"{preamble}{_FONTS}{begin}{body}"
    guarded = {**os.environ, "openin_any": "p", "openout_any": "p", "max_print_line": "1000"}
    with tempfile.TemporaryDirectory(prefix="lagcli-") as folder:
        place = Path(folder)
        (place / "document.tex").write_text(source, encoding="utf-8")
        for name, content in (files or {}).items():
            (place / name).write_bytes(content)
        command = [program, "-no-shell-escape", "-interaction=batchmode", "-halt-on-error"]
        try:
            done = subprocess.run(
                [*command, "document.tex"],
                cwd=place,
                env=guarded,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                timeout=_PATIENCE,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise FileError(f"{Path(program).name} was stopped after {_PATIENCE} s") from error
        except OSError as error:
            raise FileError(f"{program} cannot be started: {error.strerror}") from error
        document = place / "document.pdf"
        if done.returncode or not document.exists():
            reason = _first_error(place) or f"status {done.returncode}"
            raise FileError(
                f"{Path(program).name} failed ({reason});"
                " write LaTeX instead, to see where: -f latex -o document.tex"
            )
        return document.read_bytes()


def _first_error(place: Path) -> str | None:
    log = place / "document.log"
    if not log.exists():
        return None
    match = _ERROR.search(log.read_text(encoding="utf-8", errors="replace"))
    return match[1].strip() if match else None
