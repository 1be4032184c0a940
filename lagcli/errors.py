"""Every error that lagcli raises on purpose, and how a diagnostic prints."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class SourceLocation:
    """A span of text in a model file or on the command line.

    Parameters
    ----------
    path : str
        What the reader knows the text by: a file name, ``<stdin>`` or ``--set``.
    line, column : int
        Both count from 1; the column counts characters.
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


@dataclass(frozen=True)
class Diagnostic:
    """One thing that is wrong: what, where, and how to mend it."""

    kind: str
    message: str
    location: SourceLocation | None = None
    help: str | None = None
    notes: tuple[tuple[str, SourceLocation], ...] = field(default=())

    def render(self) -> str:
        """Return the diagnostic in the shape that the documentation shows."""
        loc = self.location
        if loc is None:
            lines = [f"error[{self.kind}]: {self.message}"]
        else:
            where = f"{loc.path}:{loc.line}:{loc.column}" if loc.line else loc.path
            lines = [f"{where}: error[{self.kind}]: {self.message}"]
            lines += _excerpt(loc)
        for text, where_else in self.notes:
            lines.append(f"   note: {text} ({where_else.path}:{where_else.line})")
            lines += _excerpt(where_else)
        if self.help:
            first, *rest = self.help.split("\n")
            lines.append(f"   help: {first}")
            lines += [f"         {r}" for r in rest]
        return "\n".join(lines)


_WIDEST_LINE = 160  # a longer line is cut around the place, so that a minified file stays readable


def _excerpt(loc: SourceLocation) -> list[str]:
    """Return the source line and the marks under it."""
    if not loc.line or not loc.text:
        return []
    text, column = loc.text.replace("\t", " "), loc.column
    text = "".join(c if c.isprintable() else "�" for c in text)
    if len(text) > _WIDEST_LINE:
        start = max(0, column - _WIDEST_LINE // 2)
        text = text[start : start + _WIDEST_LINE]
        column -= start
    length = max(1, min(loc.length, len(text) - column + 1))
    return [f"{loc.line:>5} | {text}", f"      | {' ' * (column - 1)}{'^' * length}"]


class LagcliError(Exception):
    """Base of all errors that are not bugs of lagcli.

    Attributes
    ----------
    exit_status : int
        What the process returns when the error reaches the command line.
    """

    exit_status = 2


class UsageError(LagcliError):
    """A call that contradicts itself or asks for what is not there."""


class ModelError(LagcliError):
    """A model file that cannot be used; carries all its diagnostics."""

    def __init__(self, diagnostics: list[Diagnostic]):
        self.diagnostics = diagnostics
        super().__init__("\n\n".join(d.render() for d in diagnostics))


class NumericalError(LagcliError):
    """The model is right and the numbers failed."""

    exit_status = 3


class FileError(LagcliError):
    """A file or a stream that cannot be read or written."""

    exit_status = 4
