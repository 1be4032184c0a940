"""Diagnostics of a model file: collected, deduplicated and sorted by location."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from lagcli.errors import Diagnostic, ModelError, SourceLocation
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.yaml.source import Scalar, YamlNode

MAX_DIAGNOSTICS = 100  # more are rarely read, and searching for similar names takes time


class Broken(Exception):
    """Use of a name whose declaration is in error; the error has been reported already."""


class Diagnostics:
    """The diagnostics collected so far."""

    def __init__(self, diagnostics: list[Diagnostic]):
        self.diagnostics = list(diagnostics)
        self.repeated: dict[tuple[str, str], list[Diagnostic]] = {}
        #: Where, in lines, commas have cut off what follows an open parenthesis.
        self._cut: dict[int, int] = {}
        self._bound()

    def add(
        self,
        kind: str,
        message: str,
        location: SourceLocation,
        help: str | None = None,
        notes: tuple[tuple[str, SourceLocation | None], ...] = (),
        subject: str | None = None,
    ) -> None:
        """Add an error. Errors of one kind and subject are merged into one that lists their lines.

        Raises
        ------
        ModelError
            There are too many errors to continue.
        """
        diagnostic = Diagnostic(kind, message, location, help, notes)
        if subject is not None:
            self.repeated.setdefault((kind, subject), []).append(diagnostic)
        else:
            self.diagnostics.append(diagnostic)
        self._bound()

    def _bound(self) -> None:
        if len(self.diagnostics) + len(self.repeated) > MAX_DIAGNOSTICS:
            last = Diagnostic(
                "too-many", f"more than {MAX_DIAGNOSTICS} errors; the rest are not shown"
            )
            raise ModelError([*self.sorted()[:MAX_DIAGNOSTICS], last])

    def add_expression_error(self, error: ExpressionError, node: YamlNode) -> None:
        """Add an error in an expression, at its location in the file."""
        location = node.span(error.start, error.end) if isinstance(node, Scalar) else node.location
        if isinstance(node, Scalar) and node.value.count("(") > node.value.count(")"):
            line, column = node.end
            if node.source.lines[line][column : column + 1] == ",":
                self._cut.setdefault(line + 1, column + 1)
        self.add(error.kind, error.message, location, error.help, subject=error.subject)

    @contextmanager
    def expression(self, node: YamlNode) -> Iterator[None]:
        """Record an ExpressionError as a diagnostic; ignore Broken."""
        try:
            yield
        except Broken:
            pass
        except ExpressionError as error:
            self.add_expression_error(error, node)

    def sorted(self) -> list[Diagnostic]:
        """Return the diagnostics, sorted by their location in the file."""
        once = [_merged(group) for group in self.repeated.values()]
        return sorted(filter(self._is_own, [*self.diagnostics, *once]), key=_position)

    def _is_own(self, diagnostic: Diagnostic) -> bool:
        """Return whether an error is none of what follows an open parenthesis in its line."""
        line, column = _position(diagnostic)
        return column <= self._cut.get(line, column)

    def finish(self) -> None:
        """Raise ModelError if there are any errors."""
        if diagnostics := self.sorted():
            raise ModelError(diagnostics)


def _position(diagnostic: Diagnostic) -> tuple[int, int]:
    where = diagnostic.location
    # errors on the command line come first, in the order in which they were found
    return (where.line, where.column) if where and where.line else (0, 0)


_LISTED = 10  # lines named in "also in"


def _merged(group: list[Diagnostic]) -> Diagnostic:
    """Merge diagnostics of one subject: the first one, with the line numbers of the others."""
    first, *others = sorted(group, key=_position)
    if not others:
        return first
    lines = sorted({d.location.line for d in others if d.location})
    shown = ", ".join(map(str, lines[:_LISTED])) + (", …" if len(lines) > _LISTED else "")
    note = f"also in line{'s' if len(lines) > 1 else ''} {shown}"
    return Diagnostic(
        first.kind, first.message, first.location, first.help, (*first.notes, (note, None))
    )
