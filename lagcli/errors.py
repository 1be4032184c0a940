"""Every error that lagcli raises on purpose, and how a diagnostic prints."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from typing import NamedTuple


class SourceLocation(NamedTuple):
    """A span of text in a model file or on the command line.

    Parameters
    ----------
    path : str
        What the reader knows the text by: a file name, ``<stdin>`` or ``--set``.
    line, column : int
        Both count from 1; the column counts characters. Line 0 is text that has no lines, such as
        the value of an option.
    length : int
        Number of characters to underline.
    text : str
        The whole line.
    """

    path: str
    line: int
    column: int
    length: int = 1
    text: str = ""


class Diagnostic(NamedTuple):
    """One thing that is wrong: what, where, and how to mend it.

    Parameters
    ----------
    kind : str
        A short name of the error, for programs.
    message : str
    location : SourceLocation, optional
    help : str, optional
        How to mend it; may have several lines.
    notes : tuple of (text, SourceLocation or None)
        Other places that belong to it.
    severity : str
        ``error``, or ``warning`` where the command goes on.
    """

    kind: str
    message: str
    location: SourceLocation | None = None
    help: str | None = None
    notes: tuple[tuple[str, SourceLocation | None], ...] = ()
    severity: str = "error"

    def render(self) -> str:
        """Return the diagnostic in the shape that the documentation shows."""
        loc = self.location
        if loc is None:
            lines = [f"{self.severity}[{self.kind}]: {self.message}"]
        else:
            where = f"{loc.path}:{loc.line}:{loc.column}" if loc.line else loc.path
            lines = [f"{where}: {self.severity}[{self.kind}]: {self.message}"]
            lines += _excerpt(loc)
        for text, elsewhere in self.notes:
            if elsewhere is None:
                lines.append(f"   note: {text}")
            else:
                lines.append(f"   note: {text} ({elsewhere.path}:{elsewhere.line})")
                lines += _excerpt(elsewhere)
        if self.help:
            first, *rest = self.help.split("\n")
            lines.append(f"   help: {first}")
            lines += [f"         {r}" for r in rest]
        return "\n".join(lines)


_WIDEST_LINE = 160  # a longer line is cut around the place, so that a minified file stays readable


def _excerpt(loc: SourceLocation) -> list[str]:
    """Return the source line and the marks under it."""
    if not loc.text:
        return []
    text, column = loc.text, loc.column
    if len(text) > _WIDEST_LINE:
        start = min(max(0, column - _WIDEST_LINE // 2), len(text) - _WIDEST_LINE // 2)
        text = text[start : start + _WIDEST_LINE]
        column -= start
    text = "".join(c if c.isprintable() else " " if c == "\t" else "�" for c in text)
    number = f"{loc.line:>5}" if loc.line else " " * 5
    before, marked = text[: column - 1], text[column - 1 : column - 1 + loc.length]
    pad = " " * (_width(before) + column - 1 - len(before))
    return [f"{number} | {text.rstrip()}", f"      | {pad}{'^' * max(1, _width(marked))}"]


def _width(text: str) -> int:
    """Return the cells that a text takes on a terminal, so that the marks stand under it."""
    return sum(
        0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in "WF" else 1
        for c in text
    )


class LagcliError(Exception):
    """Base of all errors that are not bugs of lagcli.

    Attributes
    ----------
    exit_status : int
        What the process returns when the error reaches the command line.
    diagnostics : sequence of Diagnostic
        What is wrong and where, if that is known.
    """

    exit_status = 2
    diagnostics: Sequence[Diagnostic] = ()


class UsageError(LagcliError):
    """A call that contradicts itself or asks for what is not there."""


class ModelError(LagcliError):
    """A model file that cannot be used; carries all its diagnostics."""

    def __init__(self, diagnostics: list[Diagnostic]):
        self.diagnostics = diagnostics
        super().__init__("\n\n".join(d.render() for d in diagnostics))


class NumericalError(LagcliError):
    """The model is right and the numbers failed.

    Parameters
    ----------
    problem : str or Diagnostic
        What failed; a Diagnostic where it concerns a place in the model file.
    """

    exit_status = 3

    def __init__(self, problem: str | Diagnostic):
        if isinstance(problem, Diagnostic):
            self.diagnostics = [problem]
            problem = problem.render()
        super().__init__(problem)


class FileError(LagcliError):
    """A file or a stream that cannot be read or written."""

    exit_status = 4
