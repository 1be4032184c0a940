"""Base classes of formula writers: dispatch by node type, sums, lists, brackets."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from lagcli.equations.presentation import typeset as t
from lagcli.equations.presentation.typeset import Node
from lagcli.equations.render.breaking import Break, Token
from lagcli.equations.render.names import Notation
from lagcli.functions import FUNCTIONS, Spelling

_OF_VECTORS = {"norm": Spelling(fences=("‖", "‖"), latex_fences=(r"\lVert ", r" \rVert"))}
_SPELLINGS = {name: f.spelling for name, f in FUNCTIONS.items()} | _OF_VECTORS
#: Functions whose argument needs no parentheses if it is a name: sin φ.
PREFIX = {name for name, spelling in _SPELLINGS.items() if spelling.prefix}


def spelling_of(function: str) -> Spelling:
    """Return how formulas write a function."""
    return _SPELLINGS.get(function, Spelling())


#: Added to the depth of breaks before factors without brackets, which are the last to be broken.
LAST_RESORT = 100


def factor_depth(factors: Sequence[Node], i: int, depth: int) -> int:
    """Return the depth of the break before factor i of a product at a depth.

    A number is not separated from its bracket.
    """
    factor = factors[i]
    base = factor.base if isinstance(factor, t.Power) else factor
    numbered = i == 1 and isinstance(factors[0], t.Number)
    return depth if isinstance(base, t.Sum | t.Vector) and not numbered else depth + LAST_RESORT


def is_named(node: Node) -> bool:
    """Whether a formula is a function that starts with its name, not with a delimiter."""
    return isinstance(node, t.Call) and spelling_of(node.function).fences is None


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

    #: Separators between terms, and before a negative first term.
    plus, minus, negative = "+ ", "- ", "-"
    #: Separator between the items of a list.
    comma = ","

    def __init__(
        self, names: Notation, decimals: frozenset[int] = frozenset(), numeric: bool = False
    ):
        self.names, self.decimals, self.numeric = names, decimals, numeric

    def tokens(self, node: Node, depth: int = 0) -> list[Token]:
        """Return the pieces of a formula and its possible line breaks."""
        write = getattr(self, f"_write_{type(node).__name__.lower()}")
        found: list[Token] = write(node, depth)
        return found

    def number(self, value: Fraction) -> str:
        """Return a number."""
        raise NotImplementedError

    def _symbol(self, node: t.Symbol) -> str:
        """Return a name."""
        raise NotImplementedError

    def _tight(self, node: Node, depth: int, product: bool = False) -> list[Token]:
        """Return a node as a factor or base, in brackets if necessary."""
        raise NotImplementedError

    def _summand(self, node: Node, depth: int) -> list[Token]:
        """Return the term of a Σ; another Σ needs no brackets."""
        if isinstance(node, t.IndexedSum):
            return self.tokens(node, depth)
        return self._tight(node, depth, product=True)

    def _factor(self, node: t.Product, i: int, depth: int) -> list[Token]:
        """Return a factor; a trailing Σ needs no brackets."""
        factor = node.factors[i]
        if isinstance(factor, t.IndexedSum) and i == len(node.factors) - 1:
            return self.tokens(factor, depth)
        return self._tight(factor, depth, product=True)

    def _write_number(self, node: t.Number, depth: int) -> list[Token]:
        return [self.number(node.value)]

    def _write_symbol(self, node: t.Symbol, depth: int) -> list[Token]:
        return [self._symbol(node)]

    def _write_sum(self, node: t.Sum, depth: int) -> list[Token]:
        """Return the tokens of a sum, with a possible break before each sign."""
        found: list[Token] = []
        for i, (sign, term) in enumerate(node.terms):
            if i:
                found += [Break(depth, term=True), self.plus if sign > 0 else self.minus]
            elif sign < 0:
                found.append(self.negative)
            found += self.tokens(term, depth + 1)
        return found

    def _listed(self, items: tuple[Node, ...], depth: int) -> list[Token]:
        """Return the tokens of a list, with a possible break after each comma."""
        found: list[Token] = []
        for i, item in enumerate(items):
            if i:
                found += [self.comma, Break(depth + 1)]
            found += self.tokens(item, depth + 2)
        return found


class DisplayWriter(FormulaWriter):
    """Writer for formulas that are set in two dimensions, with fractions and roots."""

    #: Separator between a function and a name.
    space = " "

    def _fenced(self, inner: list[Token]) -> list[Token]:
        """Return tokens in brackets of matching size."""
        raise NotImplementedError

    def _arguments(self, node: t.Call, depth: int) -> list[Token]:
        first = node.arguments[0]
        if node.function in PREFIX and len(node.arguments) == 1 and isinstance(first, t.Symbol):
            return [self.space + self._symbol(first)]
        return self._fenced(self._listed(node.arguments, depth))

    def _tight(self, node: Node, depth: int, product: bool = False) -> list[Token]:
        """Return a node as a factor or base, in parentheses if necessary."""
        compound: tuple[type, ...] = (t.Sum, t.IndexedSum, t.Relation, t.Logical)
        if not product:
            compound += (t.Product, t.Quotient, t.Power, t.Rate, t.Root, t.Cases)
        dotted = isinstance(node, t.Call) and node.function in ("dot", "cross")
        called = not product and is_named(node)
        number = not product and isinstance(node, t.Number) and "frac" in self.number(node.value)
        if isinstance(node, compound) or dotted or called or number:
            return self._fenced(self.tokens(node, depth + 1))
        return self.tokens(node, depth)


def rows_of(node: t.Vector) -> list[tuple[Node, ...]]:
    """Return the rows of a matrix; those of a vector have one item."""
    return [item.items if isinstance(item, t.Vector) else (item,) for item in node.items]


def cases_of(node: t.Cases) -> tuple[list[tuple[Node, Node]], Node]:
    """Return the conditions with their values, and the value if none holds."""
    found: list[tuple[Node, Node]] = []
    rest: Node = node
    while isinstance(rest, t.Cases):
        found.append((rest.condition, rest.then))
        rest = rest.otherwise
    return found, rest
