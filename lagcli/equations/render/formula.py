"""Base class of formula writers: dispatch by node type, and sums."""

from __future__ import annotations

from lagcli.equations.presentation import typeset as t
from lagcli.equations.presentation.typeset import Node
from lagcli.equations.render.breaking import Break, Token
from lagcli.equations.render.names import Notation


class FormulaWriter:
    """Writer for the formulas of a model.

    A writer has a method for each kind of node: ``_write_quotient`` for Quotient.

    Parameters
    ----------
    names : Notation
    decimals : frozenset of int
        See `lagcli.equations.render.numbers.written_decimals`.
    numeric : bool
        Whether numbers are decimals of six digits at most.
    """

    #: Between terms, and before a first one that is negative.
    plus, minus, negative = "+ ", "- ", "-"

    def __init__(
        self, names: Notation, decimals: frozenset[int] = frozenset(), numeric: bool = False
    ):
        self.names, self.decimals, self.numeric = names, decimals, numeric

    def tokens(self, node: Node, depth: int = 0) -> list[Token]:
        """Return the pieces of a formula and its possible line breaks."""
        write = getattr(self, f"_write_{type(node).__name__.lower()}")
        found: list[Token] = write(node, depth)
        return found

    def _write_sum(self, node: t.Sum, depth: int) -> list[Token]:
        """Return the tokens of a sum, with a possible break before each sign."""
        found: list[Token] = []
        for i, (sign, term) in enumerate(node.terms):
            if i:
                found += [Break(depth), self.plus if sign > 0 else self.minus]
            elif sign < 0:
                found.append(self.negative)
            found += self.tokens(term, depth + 1 if isinstance(term, t.Product) else depth)
        return found
