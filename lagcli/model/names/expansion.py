"""Expansion of syntax trees: functions of the model, rigid bodies, components of vectors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from itertools import islice

from lagcli.model.diagnostics import Broken
from lagcli.model.expression.grammar import COMPONENTS, parse
from lagcli.model.expression.tokens import ExpressionError, error_at
from lagcli.model.expression.trees import (
    BRACKETS,
    CallExpr,
    Comparison,
    ComponentExpr,
    IndexedSumExpr,
    LogicalExpr,
    Name,
    NumberExpr,
    PowerExpr,
    ProductExpr,
    Range,
    RateExpr,
    SumExpr,
    Tree,
    VectorExpr,
    walk,
)
from lagcli.model.names.namespace import Macro, Namespace

MAX_NODES = 50_000  # of one expression with its functions expanded


#: Built-in macros: the kinetic energy of a rigid body.
MACROS: Mapping[str, Macro] = {
    "body": Macro(
        ("m", "J", "r", "R"),
        parse("m/2*dot(r', r') + 1/2*dot(omega(R), J*omega(R))"),
    )
}


def expand(tree: Tree, names: Namespace, inside: tuple[str, ...] = ()) -> Tree:
    """Return a tree with functions and components of vectors expanded.

    ``body(m, J, r, R)`` and the model's functions are replaced by their expressions, at the
    position of the call. ``r.x``, ``r[1]`` and ``R[1, 3]`` are dotted names and members of families
    unless ``r`` and ``R`` themselves are declared.

    Parameters
    ----------
    tree : Tree
    names : Namespace
    inside : tuple of str
        The function whose expression it is.

    Raises
    ------
    ExpressionError
        A wrong number of arguments, or a function that calls itself.
    Broken
        The declaration of a function has an error.
    """
    return _Expansion(names).tree(tree, inside)


def component_of(name: Name, names: Namespace) -> Tree:
    """Return the component of a declared vector that a name denotes; other names unchanged."""
    text, primes = names.resolve(name)
    if names.declared(text):
        return name
    text, primes = name.text, name.primes
    for suffix, order in (("_ddot", 2), ("_dot", 1)):  # r.x_dot
        if text.endswith(suffix):
            text, primes = text.removesuffix(suffix), primes + order
    base, key, indices = text, "", name.indices
    head, dot, last = text.rpartition(".")
    if dot and last in COMPONENTS:
        base, key = head, last
        chosen: tuple[Tree, ...] = ()
    else:
        count = next((n for n, brackets in BRACKETS.items() if text.endswith(brackets)), 0)
        if not count:
            return name
        base = text.removesuffix(BRACKETS[count])
        indices, chosen = name.indices[:-count], name.indices[-count:]
    vector = Name(name.start, name.end, base, primes, indices)
    if base in ("lambda", "Qc"):
        return name
    inner = component_of(vector, names)
    if inner is vector and not names.may_be_vector(names.resolve(vector)[0]):
        return name
    return ComponentExpr(name.start, name.end, inner, key, chosen)


class _Expansion:
    """Expands one tree."""

    def __init__(self, names: Namespace):
        self.names = names

    def tree(self, tree: Tree, calls: tuple[str, ...] = ()) -> Tree:
        """Return an expanded tree; ``calls`` are the functions being expanded."""
        if isinstance(tree, Name):
            return component_of(tree, self.names)
        if isinstance(tree, CallExpr):
            macro = self.names.functions.get(tree.function) or MACROS.get(tree.function)
            if macro is not None:
                return self.call(tree, macro, calls)
        return rebuilt(tree, lambda part: self.tree(part, calls))

    def call(self, tree: CallExpr, macro: Macro, calls: tuple[str, ...]) -> Tree:
        """Return the expansion of a call, at its position in the text."""
        name, given = tree.function, tree.arguments
        if len(given) != len(macro.arguments):
            wanted = len(macro.arguments)
            raise error_at(
                "wrong-arguments",
                f"`{name}` takes {wanted} argument{'s' if wanted != 1 else ''}, not {len(given)}",
                tree,
                f"write `{name}({', '.join(macro.arguments)})`",
            )
        if name in calls:
            cycle = " → ".join(f"`{x}`" for x in (*calls[calls.index(name) :], name))
            raise error_at(
                "circular",
                f"the function `{name}` calls itself: {cycle}",
                tree,
                "a function cannot be recursive; a recursive definition of a family can",
            )
        if macro.tree is None:
            raise Broken
        arguments = [self.tree(argument, calls) for argument in given]
        own = self.tree(macro.tree, (*calls, name))
        place = tree.start, tree.end
        made = substituted(own, dict(zip(macro.arguments, arguments, strict=True)), place)
        if sum(1 for _ in islice(walk(made), MAX_NODES)) == MAX_NODES:
            raise error_at(
                "too-large",
                f"with its functions expanded, the expression has more than {MAX_NODES:,} parts",
                tree,
                "define parts of it under `definitions`",
            )
        return made


def substituted(tree: Tree, arguments: Mapping[str, Tree], place: tuple[int, int]) -> Tree:
    """Return the expression of a function with its arguments, at the position of the call."""

    def at(part: Tree) -> Tree:
        if isinstance(part, Name):
            given = arguments.get(part.text)
            if given is not None:
                return rate(given, part.primes) if part.primes else given
            root, dot, rest = part.text.partition(".")
            if dot and root in arguments:  # r.x of an argument r
                return at(_without_dot(part, root, rest))
            bare = next((b for b in BRACKETS.values() if part.text.endswith(b)), "")
            if bare and part.text.removesuffix(bare) in arguments:  # r[1] of an argument r
                vector = Name(*place, part.text.removesuffix(bare), part.primes)
                return ComponentExpr(*place, at(vector), "", tuple(map(at, part.indices)))
        moved = rebuilt(part, at)
        if moved is part:
            moved = copy(part)
        moved.start, moved.end = place
        return moved

    return at(tree)


def _without_dot(name: Name, root: str, rest: str) -> Tree:
    """Return ``r.x`` as the component x of the name ``r``."""
    for suffix, order in (("_ddot", 2), ("_dot", 1), ("", 0)):
        if rest.endswith(suffix):
            key = rest.removesuffix(suffix)
            vector = Name(name.start, name.end, root, name.primes + order)
            break
    if key not in COMPONENTS:
        raise ExpressionError(
            "syntax", f"`{name.text}` is not a component", name.start, name.end, None
        )
    return ComponentExpr(name.start, name.end, vector, key)


def rate(tree: Tree, order: int) -> Tree:
    """Return the time derivative of a tree."""
    match tree:
        case Name():
            return Name(tree.start, tree.end, tree.text, tree.primes + order, tree.indices)
        case NumberExpr():
            return NumberExpr(tree.start, tree.end, type(tree.value)(0))
    return RateExpr(tree.start, tree.end, tree, order)


def rebuilt(tree: Tree, change: Callable[[Tree], Tree]) -> Tree:
    """Return a tree with changed parts and indices; the tree itself if nothing changes."""

    def every(parts: tuple[Tree, ...]) -> tuple[Tree, ...]:
        return tuple(map(change, parts))

    made: Tree
    match tree:
        case Name() if tree.indices:
            made = Name(tree.start, tree.end, tree.text, tree.primes, every(tree.indices))
        case CallExpr():
            made = CallExpr(tree.start, tree.end, tree.function, every(tree.arguments))
        case SumExpr():
            terms = tuple((sign, change(term)) for sign, term in tree.terms)
            made = SumExpr(tree.start, tree.end, terms)
        case ProductExpr():
            factors = tuple((exponent, change(factor)) for exponent, factor in tree.factors)
            made = ProductExpr(tree.start, tree.end, factors)
        case PowerExpr():
            made = PowerExpr(tree.start, tree.end, change(tree.base), change(tree.exponent))
        case IndexedSumExpr():
            span = tree.range
            bounds = Range(span.start, span.end, change(span.first), change(span.last))
            made = IndexedSumExpr(tree.start, tree.end, change(tree.term), tree.index, bounds)
        case Comparison():
            made = Comparison(tree.start, tree.end, every(tree.operands), tree.operators)
        case LogicalExpr():
            made = LogicalExpr(tree.start, tree.end, tree.operator, every(tree.operands))
        case VectorExpr():
            made = VectorExpr(tree.start, tree.end, every(tree.items))
        case ComponentExpr():
            base, indices = change(tree.base), every(tree.indices)
            made = ComponentExpr(tree.start, tree.end, base, tree.key, indices)
        case RateExpr():
            made = RateExpr(tree.start, tree.end, change(tree.operand), tree.order)
        case _:
            return tree
    same = len(made.parts) == len(tree.parts) and all(
        a is b for a, b in zip(made.parts, tree.parts, strict=True)
    )
    return tree if same and _indices(made) == _indices(tree) else made


def _indices(tree: Tree) -> tuple[Tree, ...]:
    """Return the subtrees that are integers."""
    match tree:
        case Name() | ComponentExpr():
            return tree.indices
        case IndexedSumExpr():
            return (tree.range.first, tree.range.last)
    return ()
