"""All errors of a model: collected, put in the order of the file, each said once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from lagcli.errors import Diagnostic, ModelError, SourceLocation
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.yaml.source import Scalar, YamlNode

MAX_DIAGNOSTICS = 100  # nobody reads more, and finding near names takes time


class Broken(Exception):
    """Something whose own error has been reported; what uses it stays silent."""


class Diagnostics:
    """The errors found so far."""

    def __init__(self, diagnostics: list[Diagnostic]):
        self.diagnostics = list(diagnostics)
        self.repeated: dict[tuple[str, str], list[Diagnostic]] = {}
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
        """Add an error. Those of one kind with one subject are told once, with all their places.

        Raises
        ------
        ModelError
            There are too many errors to go on.
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
                "too-many", f"more than {MAX_DIAGNOSTICS} errors: the rest is not shown"
            )
            raise ModelError([*self.sorted()[:MAX_DIAGNOSTICS], last])

    def add_expression_error(self, error: ExpressionError, node: YamlNode) -> None:
        """Add an error in an expression, at its place in the file."""
        place = node.span(error.start, error.end) if isinstance(node, Scalar) else node.location
        self.add(error.kind, error.message, place, error.help, subject=error.subject)

    @contextmanager
    def expression(self, node: YamlNode) -> Iterator[None]:
        """Turn an error in an expression into a diagnostic, and stay silent about broken names."""
        try:
            yield
        except Broken:
            pass
        except ExpressionError as error:
            self.add_expression_error(error, node)

    def sorted(self) -> list[Diagnostic]:
        """Return the diagnostics in the order of the file."""
        once = [_merged(group) for group in self.repeated.values()]
        return sorted([*self.diagnostics, *once], key=_place)

    def finish(self) -> None:
        """Raise ModelError if there was any error."""
        if found := self.sorted():
            raise ModelError(found)


def _place(diagnostic: Diagnostic) -> tuple[int, int]:
    where = diagnostic.location
    # what stands on the command line comes first, in the order in which it was found
    return (where.line, where.column) if where and where.line else (0, 0)


_LISTED = 10  # lines named in "also in"


def _merged(group: list[Diagnostic]) -> Diagnostic:
    """Return the first of several diagnostics with one subject, and the lines of the others."""
    first, *others = sorted(group, key=_place)
    if not others:
        return first
    lines = sorted({d.location.line for d in others if d.location})
    shown = ", ".join(map(str, lines[:_LISTED])) + (", …" if len(lines) > _LISTED else "")
    note = f"also in line{'s' if len(lines) > 1 else ''} {shown}"
    return Diagnostic(
        first.kind, first.message, first.location, first.help, (*first.notes, (note, None))
    )
