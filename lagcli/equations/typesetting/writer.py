"""Base classes of formula writers: dispatch by node type, numbers, sums, brackets, line breaks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate

from lagcli.equations.typesetting import nodes as t
from lagcli.equations.typesetting.nodes import Node
from lagcli.equations.typesetting.notation import Notation
from lagcli.functions import FUNCTIONS, Spelling
from lagcli.model.expression.trees import NumberExpr, walk
from lagcli.model.model import Model


@dataclass(frozen=True)
class Break:
    """A possible line break.

    Parameters
    ----------
    depth : int
        Level of nesting. Between two breaks of a depth lies a term, a factor or the content of a
        bracket; it is broken only if it is longer than a line.
    space : str
        Text at this position if the line is not broken.
    term : bool
        Whether a term of a sum follows, which starts a line if the previous term was broken.
    """

    depth: int
    space: str = " "
    term: bool = False


Token = str | Break


def flat(tokens: Sequence[Token]) -> str:
    """Return a formula on one line."""
    return "".join(x.space if isinstance(x, Break) else x for x in tokens)


def lines(
    tokens: Sequence[Token],
    measure: Callable[[str], float],
    first: float,
    following: float,
    nested: str = "",
) -> list[str]:
    """Break a formula into lines.

    Parameters
    ----------
    tokens : sequence of str and Break
    measure : function of str
        Function that returns the width of a piece.
    first, following : float
        Widths of the first line and of the others.
    nested : str
        What a line begins with for each bracket that is open there.

    Returns
    -------
    list of str
        Lines within the widths, except for pieces without a break that are longer.
    """
    layout = _Layout(tokens, measure, first, following, nested)
    layout.place(0, len(layout.breaks), "", 0.0)
    return layout.rows


class _Layout:
    """Lines being filled."""

    def __init__(
        self,
        tokens: Sequence[Token],
        measure: Callable[[str], float],
        first: float,
        following: float,
        nested: str,
    ):
        self.nested, self.indentation = nested, measure(nested)
        self.pieces: list[str] = [""]
        self.breaks: list[Break] = []
        for token in tokens:
            if isinstance(token, Break):
                self.pieces.append("")
                self.breaks.append(token)
            else:
                self.pieces[-1] += token
        self._measured(measure)
        self._keep_brackets_whole(following)
        self._measured(measure)
        self.room, self.following = first, following
        self.rows, self.used = [""], 0.0
        self.begun = False  # whether the line holds more than its indentation

    def _measured(self, measure: Callable[[str], float]) -> None:
        """Measure the pieces and the spaces between them."""
        self.spaces = [measure(x.space) for x in self.breaks]
        widths = map(measure, self.pieces)
        steps = [x + y for x, y in zip(widths, [*self.spaces, 0.0], strict=True)]
        self.ends = [0.0, *accumulate(steps)]  # with the space that follows

    def _keep_brackets_whole(self, following: float) -> None:
        """Drop the breaks inside brackets that fit on a line with what they are attached to."""
        dropped: set[int] = set()
        begun: list[int] = []
        opened: list[tuple[float, int, int, float]] = []
        for i, piece in enumerate(self.pieces):
            for char in piece:
                if char in "([{":
                    begun.append(i)
                elif char in ")]}" and begun:
                    first = begun.pop()
                    if first < i:
                        room = following - len(begun) * self.indentation
                        opened.append((self._width(first, i), first, i, room))
        for _, first, last, room in sorted(opened):
            start, end = first, last
            while start - 1 in dropped:
                start -= 1
            while end in dropped:
                end += 1
            if self._width(start, end) <= room:
                dropped.update(range(first, last))
        pieces, breaks = [self.pieces[0]], []
        for i, (at, piece) in enumerate(zip(self.breaks, self.pieces[1:], strict=True)):
            if i in dropped:
                pieces[-1] += at.space + piece
            else:
                pieces.append(piece)
                breaks.append(at)
        self.pieces, self.breaks = pieces, breaks

    def _width(self, start: int, end: int) -> float:
        """Return the width of pieces, including the last one."""
        trailing = self.spaces[end] if end < len(self.spaces) else 0.0
        return self.ends[end + 1] - self.ends[start] - trailing

    def _newline(self) -> None:
        text = "".join(self.rows)
        level = sum(map(text.count, "([{")) - sum(map(text.count, ")]}"))
        self.rows.append(self.nested * level)
        self.room, self.used = self.following, level * self.indentation
        self.begun = False

    def place(self, start: int, end: int, space: str, gap: float, full: float = 1 / 3) -> bool:
        """Append pieces to the lines; return whether they were broken.

        Pieces that must be broken anyway begin on a line that is used up to the share ``full``.
        """
        wanted = self._width(start, end)
        begun = self.begun
        if self.used + gap * begun + wanted > self.room and begun:
            inside = wanted > self.following and start < end
            if not inside or self.used > self.room * full:
                self._newline()
                begun = False
        if not begun:
            space, gap = "", 0.0
        if self.used + gap + wanted <= self.room or start == end:
            between = [*(x.space for x in self.breaks[start:end]), ""]
            parts = zip(self.pieces[start : end + 1], between, strict=True)
            self.rows[-1] += space + "".join(map("".join, parts))
            self.used += gap + wanted
            self.begun = True
            return False
        depth = min(x.depth for x in self.breaks[start:end])
        cuts = [i for i in range(start, end) if self.breaks[i].depth == depth]
        broken = self.place(start, cuts[0], space, gap)
        for cut, last in zip(cuts, [*cuts[1:], end], strict=True):
            if broken and self.breaks[cut].term:
                self._newline()
            at = self.breaks[cut]
            full = 1 / 3 if at.term else 2 / 3
            broken = self.place(cut + 1, last, at.space, self.spaces[cut], full)
        return True


DIGITS = 6
#: Largest denominator that is written as a fraction; others are written as decimals.
LARGEST_DENOMINATOR = 12


def written_decimals(model: Model) -> frozenset[int]:
    """Return the denominators of decimals in the model: 0.2 is 1/5."""
    denominators: set[int] = set()
    for tree in model.trees.values():
        denominators.update(
            part.value.denominator for part in walk(tree) if isinstance(part, NumberExpr)
        )
    return frozenset(denominators)


def decimal(value: Fraction, decimals: frozenset[int]) -> str | None:
    """Return a number as an integer or decimal, or None if a fraction is preferable.

    A number is written as a decimal if it terminates within six digits and its denominator is large
    (1/20), a power of ten (1/10), or that of a decimal in the model (0.2).
    """
    q = value.denominator
    if q == 1:
        return str(value.numerator)
    if 10**DIGITS % q:
        return None
    if q > LARGEST_DENOMINATOR or q == 10 or (q == 5 and 5 in decimals):
        digits = f"{float(value):.{DIGITS}f}".rstrip("0")
        return digits if len(digits.lstrip("-0.")) <= DIGITS else None
    return None


def is_rounded(value: Fraction, plain: str | None, numeric: bool) -> bool:
    """Return whether a number is printed with six significant digits.

    With parameter values inserted, every longer decimal and every fraction is rounded. In symbolic
    equations, only fractions of long numbers are, which result from measured or computed constants
    of the model: 0.704466 is easier to read than 35223315263779/50000000000000.

    Parameters
    ----------
    value : Fraction
    plain : str or None
        Result of `decimal` for the value.
    numeric : bool
        Whether parameter values are inserted.
    """
    if numeric:
        return plain is None or len(plain) > DIGITS
    return plain is None and max(abs(value.numerator), value.denominator) >= 10**DIGITS


def rounded(value: Fraction) -> tuple[str, int | None]:
    """Return mantissa and power of ten of a number with at most six significant digits."""
    text = f"{float(value):.{DIGITS}g}"
    mantissa, _, exponent = text.partition("e")
    return mantissa, int(exponent) if exponent else None


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


def closed(node: Node) -> Node:
    """Return a formula whose last function has parentheses: sin(φ), not sin φ."""
    match node:
        case t.Product():
            *before, last = node.factors
            return t.Product((*before, closed(last)))
        case t.Power():
            return t.Power(closed(node.base), node.exponent)
        case t.Call(arguments=(t.Symbol() as argument,)) if node.function in PREFIX:
            return t.Call(node.function, (t.Sum(((1, argument),)),))
    return node


def _begins_with_name(factor: Node) -> bool:
    base = factor.base if isinstance(factor, t.Power) else factor
    return isinstance(base, t.Symbol | t.Component)


class FormulaWriter:
    """Writer for the formulas of a model.

    A writer has a method for each kind of node: ``_write_quotient`` for Quotient.

    Parameters
    ----------
    names : Notation
    decimals : frozenset of int
        See `lagcli.equations.typesetting.writer.written_decimals`.
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
        tokens: list[Token] = write(node, depth)
        return tokens

    def number(self, value: Fraction) -> str:
        """Return a number: ½, 0.1, 3/7."""
        if value < 0:
            return self._negated(self.number(-value))
        plain = decimal(value, self.decimals)
        if is_rounded(value, plain, self.numeric):
            mantissa, power = rounded(value)
            return self._digits(mantissa) if power is None else self._scientific(mantissa, power)
        return self._fraction(value) if plain is None else self._digits(plain)

    def _negated(self, number: str) -> str:
        return f"{self.negative}{number}"

    def _digits(self, digits: str) -> str:
        return digits

    def _scientific(self, mantissa: str, power: int) -> str:
        raise NotImplementedError

    def _fraction(self, value: Fraction) -> str:
        raise NotImplementedError

    def _symbol(self, node: t.Symbol) -> str:
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
        if i < len(node.factors) - 1 and _begins_with_name(node.factors[i + 1]):
            factor = closed(factor)  # sin(φ) r, not sin φ r
        if isinstance(factor, t.IndexedSum) and i == len(node.factors) - 1:
            return self.tokens(factor, depth)
        return self._tight(factor, depth, product=True)

    def _write_number(self, node: t.Number, depth: int) -> list[Token]:
        return [self.number(node.value)]

    def _write_symbol(self, node: t.Symbol, depth: int) -> list[Token]:
        return [self._symbol(node)]

    def _write_sum(self, node: t.Sum, depth: int) -> list[Token]:
        """Return the tokens of a sum, with a possible break before each sign."""
        tokens: list[Token] = []
        for part in self.term_tokens(node, depth):
            tokens += part if isinstance(part, list) else [part]
        return tokens

    def term_tokens(self, node: Node, depth: int = 0) -> list[Token | list[Token]]:
        """Return the tokens of a side of an equation: signs and breaks, and lists of those of its
        terms."""
        if node == t.ZERO:
            return list(self.tokens(node, depth))
        if not isinstance(node, t.Sum):
            return [self.tokens(node, depth)]
        parts: list[Token | list[Token]] = []
        for i, (sign, term) in enumerate(node.terms):
            if i:
                parts += [Break(depth, term=True), self.plus if sign > 0 else self.minus]
            elif sign < 0:
                parts.append(self.negative)
            last = i == len(node.terms) - 1
            parts.append(self.tokens(term, depth + 1) if last else self._before(term, depth + 1))
        return parts

    def _before(self, node: Node, depth: int) -> list[Token]:
        """Return a formula that a sign or a relation follows."""
        return self.tokens(node, depth)

    def _listed(self, items: tuple[Node, ...], depth: int) -> list[Token]:
        """Return the tokens of a list, with a possible break after each comma."""
        tokens: list[Token] = []
        for i, item in enumerate(items):
            if i:
                tokens += [self.comma, Break(depth + 1)]
            tokens += self.tokens(item, depth + 2)
        return tokens


class DisplayWriter(FormulaWriter):
    """Writer for formulas that are set in two dimensions, with fractions and roots."""

    #: Separator between a function and a name.
    space = " "

    def _fenced(self, inner: list[Token]) -> list[Token]:
        """Return tokens in brackets of matching size."""
        raise NotImplementedError

    def _before(self, node: Node, depth: int) -> list[Token]:
        """Return a formula that a sign or a relation follows; cases at its end are in brackets."""
        if isinstance(node, t.Cases):
            return self._fenced(self.tokens(node, depth + 1))
        if isinstance(node, t.Product) and isinstance(node.factors[-1], t.Cases):
            *factors, last = node.factors
            node = t.Product((*factors, t.Sum(((1, last),))))
        return self.tokens(node, depth)

    def _factor(self, node: t.Product, i: int, depth: int) -> list[Token]:
        """Return a factor; cases that other factors follow are in brackets."""
        factor = node.factors[i]
        if isinstance(factor, t.Cases) and i < len(node.factors) - 1:
            return self._fenced(self.tokens(factor, depth + 1))
        return super()._factor(node, i, depth)

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
    cases: list[tuple[Node, Node]] = []
    rest: Node = node
    while isinstance(rest, t.Cases):
        cases.append((rest.condition, rest.then))
        rest = rest.otherwise
    return cases, rest
