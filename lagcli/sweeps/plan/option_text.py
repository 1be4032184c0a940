"""The text of an option, and errors that point into it."""

from __future__ import annotations

from dataclasses import dataclass

from lagcli.errors import Diagnostic, ModelError, SourceLocation
from lagcli.model.expression.tokens import ExpressionError


@dataclass(frozen=True)
class OptionText:
    """The value of an option, with positions for messages.

    Parameters
    ----------
    option : str
        Name of the option, such as ``--vary``.
    text : str
        The complete value.
    """

    option: str
    text: str

    def error(
        self, kind: str, message: str, start: int, end: int, help_: str | None = None
    ) -> ModelError:
        """Return an error about the characters from ``start`` to ``end``."""
        place = SourceLocation(self.option, 0, start + 1, max(1, end - start), self.text)
        return ModelError([Diagnostic(kind, message, place, help_)])

    def expression_error(self, error: ExpressionError, offset: int = 0) -> ModelError:
        """Return an error of an expression that begins at ``offset``."""
        return self.error(
            error.kind, error.message, offset + error.start, offset + error.end, error.help
        )
