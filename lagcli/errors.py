"""Exceptions of lagcli, and the formatting of diagnostics."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple


class SourceLocation(NamedTuple):
    """A span of text in a model file or on the command line.

    Parameters
    ----------
    path : str
        Displayed name of the text: a file name, ``<stdin>`` or ``--set``.
    line, column : int
        Both count from 1; the column counts characters. Line 0 marks text without lines, such
        as the value of an option.
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

    @property
    def with_line(self) -> str:
        """The name of the text, with the line if it has lines."""
        return f"{self.path}:{self.line}" if self.line else self.path


class Diagnostic(NamedTuple):
    """An error or warning: message, location and remedy.

    Parameters
    ----------
    kind : str
        Short identifier of the error, for programs.
    message : str
    location : SourceLocation, optional
    help : str, optional
        Remedy; may have several lines.
    notes : tuple of (text, SourceLocation or None)
        Related locations.
    severity : str
        ``error``, or ``warning`` if the command continues.
    """

    kind: str
    message: str
    location: SourceLocation | None = None
    help: str | None = None
    notes: tuple[tuple[str, SourceLocation | None], ...] = ()
    severity: str = "error"

    def render(self) -> str:
        """Return the diagnostic as text, in the form shown in the documentation."""
        loc = self.location
        if loc is None:
            lines = [f"{self.severity}[{self.kind}]: {self.message}"]
        else:
            column = f":{loc.column}" if loc.line else ""
            lines = [f"{loc.with_line}{column}: {self.severity}[{self.kind}]: {self.message}"]
            lines += _excerpt(loc)
        for text, elsewhere in self.notes:
            if elsewhere is None:
                lines.append(f"   note: {text}")
            else:
                lines.append(f"   note: {text} ({elsewhere.with_line})")
                lines += _excerpt(elsewhere)
        if self.help:
            first, *rest = self.help.split("\n")
            lines.append(f"   help: {first}")
            lines += [f"         {r}" for r in rest]
        return "\n".join(lines)


_WIDEST_LINE = 160  # a longer line is cut around the location, so that minified files stay readable


def _excerpt(loc: SourceLocation) -> list[str]:
    """Return the source line and the underline below it."""
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
    pad = " " * (display_width(before) + column - 1 - len(before))
    return [f"{number} | {text.rstrip()}", f"      | {pad}{'^' * max(1, display_width(marked))}"]


def display_width(text: str) -> int:
    """Return the width of a text in columns: combining marks take none, wide characters two."""
    return sum(map(_columns, text))


@lru_cache(1 << 12)
def _columns(character: str) -> int:
    if unicodedata.combining(character):
        return 0
    return 2 if unicodedata.east_asian_width(character) in "WF" else 1


class LagcliError(Exception):
    """Base class of all errors that are not bugs of lagcli.

    Parameters
    ----------
    problem : str or Diagnostic
        Description of the problem; a Diagnostic if it concerns a location in the model file.

    Attributes
    ----------
    exit_status : int
        Exit status of the process when the error reaches the command line.
    diagnostics : sequence of Diagnostic
        Errors and their locations, if known.
    """

    exit_status = 2
    diagnostics: Sequence[Diagnostic] = ()

    def __init__(self, problem: str | Diagnostic):
        if isinstance(problem, Diagnostic):
            self.diagnostics = [problem]
            problem = problem.render()
        super().__init__(problem)


class UsageError(LagcliError):
    """Invalid arguments: contradictory, unknown, out of range, or not possible for a model."""


def check_argument(function: str, value: object, expected: type, remedy: str) -> None:
    """Raise UsageError unless the argument of a function of the package has a type.

    Parameters
    ----------
    function : str
    value : object
    expected : type
    remedy : str
        How such an object is obtained.
    """
    if not isinstance(value, expected):
        raise UsageError(
            f"lagcli.{function}: the argument is of type {type(value).__name__}, not"
            f" {expected.__name__}; {remedy}"
        )


def check_values(argument: str, values: object) -> None:
    """Raise UsageError unless an argument maps names to values; None stands for no values."""
    if values is None:
        return
    if not isinstance(values, Mapping) or not all(isinstance(name, str) for name in values):
        raise UsageError(f"`{argument}` must be a dict such as {{'m': 2}}, not {values!r}")


def check_texts(argument: str, values: object, example: str) -> None:
    """Raise UsageError unless an argument is a list of texts, like the example; a text is none."""
    if not _are_texts(values):
        raise UsageError(f"`{argument}` must be a list of texts such as {example}, not {values!r}")


def _are_texts(values: object) -> bool:
    if not isinstance(values, Sequence) or isinstance(values, str):
        return False
    return all(isinstance(x, str) for x in values)


class ModelError(LagcliError):
    """Invalid model file; contains all diagnostics."""

    def __init__(self, diagnostics: list[Diagnostic]):
        super().__init__("\n\n".join(d.render() for d in diagnostics))
        self.diagnostics = diagnostics


class NumericalError(LagcliError):
    """Failure of a computation with a valid model."""

    exit_status = 3


class FileError(LagcliError):
    """File or stream that cannot be read or written."""

    exit_status = 4
