"""Display trees of formulas: sums, products, quotients, roots, derivatives.

A tree preserves the written order and is independent of the output format: the renderers convert it
to text, LaTeX, MathML or the model grammar.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from operator import is_
from typing import Literal

SymbolKind = Literal["name", "multiplier", "force", "constant", "constraint"]


@dataclass(frozen=True)
class Node:
    """Node of a display tree."""


@dataclass(frozen=True)
class Number(Node):
    """An exact number."""

    value: Fraction


@dataclass(frozen=True)
class Symbol(Node):
    """A name of the model with its order of derivative.

    A multiplier is named by its constraint, a generalized force by its coordinate.
    """

    name: str
    dots: int = 0
    kind: SymbolKind = "name"


@dataclass(frozen=True)
class VirtualDisplacement(Node):
    """The virtual displacement δq of a coordinate."""

    of: Symbol


@dataclass(frozen=True)
class Partial(Node):
    """Partial derivative ∂of/∂by."""

    of: Node
    by: Node


@dataclass(frozen=True)
class Rate(Node):
    """Total time derivative d/dt."""

    of: Node


@dataclass(frozen=True)
class Sign(Node):
    """A symbol of a general law, such as L, Q_i or λ_β, in text and in LaTeX."""

    text: str
    latex: str


@dataclass(frozen=True)
class Entry(Node):
    """An entry of a matrix or vector with symbolic indices: M[φ, ψ], γ[rod].

    An index is a coordinate, or a constraint as a Symbol of kind ``constraint``.
    """

    matrix: Sign
    indices: tuple[Symbol, ...]


@dataclass(frozen=True)
class Sum(Node):
    """Terms with their signs, +1 or −1."""

    terms: tuple[tuple[int, Node], ...]


@dataclass(frozen=True)
class IndexedSum(Node):
    """Σ over an index from a first to a last value of a term."""

    term: Node
    index: str
    first: Node
    last: Node


@dataclass(frozen=True)
class Product(Node):
    """Factors from left to right; a number comes first."""

    factors: tuple[Node, ...]


@dataclass(frozen=True)
class Quotient(Node):
    """A fraction."""

    numerator: Node
    denominator: Node


@dataclass(frozen=True)
class Power(Node):
    """Base and exponent."""

    base: Node
    exponent: Node


@dataclass(frozen=True)
class Root(Node):
    """Square or cube root."""

    radicand: Node
    degree: int = 2


@dataclass(frozen=True)
class Call(Node):
    """A function of the model grammar applied to arguments."""

    function: str
    arguments: tuple[Node, ...]


@dataclass(frozen=True)
class Vector(Node):
    """A vector of scalars, or a matrix of rows."""

    items: tuple[Node, ...]


@dataclass(frozen=True)
class Component(Node):
    """A component of a vector or matrix, named by its subscript: x, or 1,3."""

    of: Node
    subscript: str


@dataclass(frozen=True)
class Cases(Node):
    """``then`` if the condition holds, else ``otherwise``."""

    condition: Node
    then: Node
    otherwise: Node


@dataclass(frozen=True)
class Relation(Node):
    """A comparison: <, <=, ==, !=, >=, >."""

    left: Node
    operator: str
    right: Node


@dataclass(frozen=True)
class Logical(Node):
    """A logical operator, ``and``, ``or`` or ``not``, with its operands."""

    operator: str
    operands: tuple[Node, ...]


ZERO = Number(Fraction(0))
ONE = Number(Fraction(1))


def whole(value: int) -> Number:
    """Return an integer as a Number."""
    return Number(Fraction(value))


def signed(node: Node) -> tuple[int, Node]:
    """Split a leading minus off a term."""
    if isinstance(node, Number) and node.value < 0:
        return -1, Number(-node.value)
    if isinstance(node, Sum) and len(node.terms) == 1:
        return node.terms[0]
    return 1, node


def sum_of(terms: Iterable[tuple[int, Node]]) -> Node:
    """Return a sum without empty, nested or superfluous parts."""
    flat: list[tuple[int, Node]] = []
    stack = list(reversed(list(terms)))
    while stack:
        sign, node = stack.pop()
        if isinstance(node, Sum):
            stack.extend((sign * s, n) for s, n in reversed(node.terms))
            continue
        s, node = signed(node)
        if node != ZERO:
            flat.append((sign * s, node))
    if not flat:
        return ZERO
    if len(flat) == 1 and flat[0][0] == 1:
        return flat[0][1]
    return Sum(tuple(flat))


def forward(node: Node) -> tuple[int, Node]:
    """Return the sign and the node times that sign, so that its first term is positive."""
    if isinstance(node, Sum) and node.terms[0][0] < 0:
        return -1, sum_of((-sign, term) for sign, term in node.terms)
    return signed(node)


def product_of(factors: Iterable[Node]) -> Node:
    """Return a product with numbers and signs collected in front."""
    minus, value, rest = False, Fraction(1), []
    for factor in factors:
        sign, node = forward(factor)
        minus ^= sign < 0
        for part in node.factors if isinstance(node, Product) else (node,):
            if isinstance(part, Number):
                value = part.value if value == 1 else value * part.value
            else:
                rest.append(part)
    if value == 0:
        return ZERO
    parts = rest if value == 1 and rest else [Number(value), *rest]
    node = parts[0] if len(parts) == 1 else Product(tuple(parts))
    return sum_of([(-1, node)]) if minus else node


def quotient_of(numerator: Node, denominator: Node) -> Node:
    """Return a quotient with number and sign in front."""
    if denominator == ONE:
        return numerator
    negative = isinstance(numerator, Sum) and all(sign < 0 for sign, _ in numerator.terms)
    sign, top = (forward if negative else signed)(numerator)  # −(a + b)/c, not (−a − b)/c
    value, parts = Fraction(sign), []
    for part in top.factors if isinstance(top, Product) else (top,):
        if isinstance(part, Number):
            value *= part.value
        else:
            parts.append(part)
    whole = Number(Fraction(value.numerator)) if not parts else Number(value)
    if not parts:  # 2/x, not 2 1/x
        down = product_of([Number(Fraction(value.denominator)), denominator])
        sign, top = signed(whole)
        node: Node = Quotient(top, down)
        return node if sign > 0 else Sum(((-1, node),))
    return product_of([whole, Quotient(product_of(parts), denominator)])


def children(node: Node) -> tuple[Node, ...]:
    """Return the child nodes."""
    match node:
        case Sum():
            return tuple(n for _, n in node.terms)
        case IndexedSum():
            return (node.term, node.first, node.last)
        case Product():
            return node.factors
        case Quotient():
            return (node.numerator, node.denominator)
        case Power():
            return (node.base, node.exponent)
        case Root():
            return (node.radicand,)
        case Call():
            return node.arguments
        case Vector():
            return node.items
        case Cases():
            return (node.condition, node.then, node.otherwise)
        case Relation():
            return (node.left, node.right)
        case Logical():
            return node.operands
        case Partial():
            return (node.of, node.by)
        case Rate() | VirtualDisplacement() | Component():
            return (node.of,)
        case Entry():
            return node.indices
    return ()


def rebuilt(node: Node, change: Callable[[Node], Node]) -> Node:
    """Return a node with its child nodes changed; the node itself if none does."""
    if not children(node):
        return node

    def of(x: object) -> object:
        if isinstance(x, Node):
            return change(x)
        if isinstance(x, tuple):
            items = tuple(map(of, x))
            return x if all(map(is_, items, x)) else items
        return x

    values = [getattr(node, name) for name in node.__dataclass_fields__]
    items = list(map(of, values))
    return node if all(map(is_, items, values)) else type(node)(*items)


def symbols_in(nodes: Iterable[Node]) -> Iterator[str]:
    """Yield all symbols in a tree, with repetitions."""
    stack = list(nodes)
    while stack:
        item = stack.pop()
        if isinstance(item, Symbol) and item.kind == "name":
            yield item.name
        stack.extend(children(item))


def equal_except_for_order(one: Node, two: Node) -> bool:
    """Whether two formulas differ only in the order of their terms and factors."""
    return one == two or _sorted(one) == _sorted(two)


def _sorted(node: Node) -> Node:
    """Return a formula with the terms of its sums and the factors of its products in one order."""
    node = rebuilt(node, _sorted)
    if isinstance(node, Sum):
        return Sum(tuple(sorted(node.terms, key=repr)))
    if isinstance(node, Product):
        return Product(tuple(sorted(node.factors, key=repr)))
    return node


def weight(node: Node) -> int:
    """Estimate the number of characters of a formula."""
    total, stack = 0, [node]
    while stack:
        item = stack.pop()
        match item:
            case Number():
                total += len(str(abs(item.value.numerator)))
                if item.value.denominator > 12:
                    total += len(str(item.value.denominator))
            case Sum():
                total += len(item.terms)  # its characters, and possible brackets
            case Call() | IndexedSum():
                total += 2
            case Power() if isinstance(item.exponent, Number):
                total += 1
                stack.append(item.base)
                continue
            case Quotient() | Root() | Cases() | Relation() | Logical():
                total += 1
            case Symbol():
                total += 1
        stack.extend(children(item))
    return total


@dataclass(frozen=True)
class Line:
    """A formula lhs = rhs [= rhs …], or a single expression.

    Parameters
    ----------
    sides : tuple of Node
    label : Node or str, optional
        Coordinate or constraint to which the formula belongs.
    note : str, optional
        Remark on the formula.
    span : Sign, optional
        Range of the index of a formula that holds for several members: i = 2, …, N.
    """

    sides: tuple[Node, ...]
    label: Node | str | None = None
    note: str | None = None
    span: Sign | None = None

    @property
    def remark(self) -> str | None:
        """Note and range as plain text."""
        span = self.span.text if self.span is not None else None
        return "; ".join(x for x in (self.note, span) if x) or None


@dataclass(frozen=True)
class Step:
    """A step of a derivation.

    Parameters
    ----------
    title : str
    lines : tuple of Line
    remark : str or None
        Explanation or source of the step.
    packed : bool
        Whether short lines may be placed side by side.
    lead : str or None
        Text printed before the lines: "Substituting the definitions gives".
    """

    title: str
    lines: tuple[Line, ...]
    remark: str | None = None
    packed: bool = False
    lead: str | None = None
