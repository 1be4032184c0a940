"""Expansion of syntax trees: functions of the model, rigid bodies, components of vectors."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from copy import copy

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
)
from lagcli.model.names.dependencies import topological_order
from lagcli.model.names.namespace import Macro, Namespace

# limits of one expression with its functions expanded
MAX_NODES = 50_000
MAX_CALLS = 50_000
MAX_LEVELS = 200  # parts within parts: trees are traversed recursively

#: Built-in macros: the kinetic energy of a rigid body.
MACROS: Mapping[str, Macro] = {
    "body": Macro(
        ("m", "J", "r", "R"),
        parse("m/2*dot(r', r') + 1/2*dot(omega(R), J*omega(R))"),
    )
}


def expand(tree: Tree, names: Namespace) -> Tree:
    """Return a tree with functions and components of vectors expanded.

    ``body(m, J, r, R)`` and the model's functions are replaced by their expressions, at the
    position of the call. ``r.x``, ``r[1]`` and ``R[1, 3]`` are dotted names and members of families
    unless ``r`` and ``R`` themselves are declared.

    Parameters
    ----------
    tree : Tree
    names : Namespace

    Raises
    ------
    ExpressionError
        A wrong number of arguments, or too large a result.
    Broken
        The declaration of a function has an error.
    """
    return _Expansion(names).expanded(tree)


def expand_function(function: Macro, names: Namespace) -> Macro:
    """Return a function whose expression is expanded; see `expand`."""
    assert function.tree is not None
    expansion = _Expansion(names)
    tree = expansion.expanded(function.tree)
    return Macro(function.arguments, tree, expansion.calls)


def functions_called(tree: Tree, names: Namespace) -> dict[str, Tree]:
    """Return the first call of each function of the model, or macro, in a tree."""
    calls: dict[str, Tree] = {}
    stack = [tree]
    while stack:
        top = stack.pop()
        if isinstance(top, CallExpr) and _macro(top.function, names) is not None:
            calls.setdefault(top.function, top)
        stack.extend(reversed((*top.parts, *_indices(top))))
    return calls


def _macro(name: str, names: Namespace) -> Macro | None:
    return names.functions.get(name) or MACROS.get(name)


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
        self.expanded_functions: dict[str, Macro] = {}
        self.calls = 0

    def expanded(self, tree: Tree) -> Tree:
        """Return an expanded tree, after the expressions of the functions that it needs."""
        needs: dict[str, dict[str, Tree]] = {}
        found = list(functions_called(tree, self.names))
        while found:
            name = found.pop()
            written = _macro(name, self.names)
            if name not in needs and written is not None and written.tree is not None:
                needs[name] = functions_called(written.tree, self.names)
                found += needs[name]
        for name in topological_order(needs)[0]:
            written = _macro(name, self.names)
            assert written is not None
            # an error is reported where the function is declared
            with contextlib.suppress(ExpressionError, Broken):
                self.expanded_functions[name] = self.function(written)
        self.calls = 0
        return self.tree(tree)

    def function(self, written: Macro) -> Macro:
        assert written.tree is not None
        self.calls = written.calls
        tree = self.tree(written.tree)
        return Macro(written.arguments, tree, self.calls)

    def tree(self, tree: Tree) -> Tree:
        """Return an expanded tree."""
        if isinstance(tree, Name):
            return component_of(tree, self.names)
        if isinstance(tree, CallExpr):
            macro = _macro(tree.function, self.names)
            if macro is not None:
                return self.call(tree, macro)
        return rebuilt(tree, self.tree)

    def call(self, tree: CallExpr, macro: Macro) -> Tree:
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
        expanded = self.expanded_functions.get(name)
        if expanded is None or expanded.tree is None:
            raise Broken
        self.calls += 1 + expanded.calls
        if self.calls > MAX_CALLS:
            raise _too_large(tree, f"has more than {MAX_CALLS:,} calls")
        arguments = [self.tree(argument) for argument in given]
        place = tree.start, tree.end
        made = substituted(expanded.tree, dict(zip(macro.arguments, arguments, strict=True)), place)
        _check_size(made, tree)
        return made


def _check_size(made: Tree, call: Tree) -> None:
    """Raise ExpressionError if the expansion of a call has too many parts or levels."""
    count, level = 0, [made]
    for _ in range(MAX_LEVELS):
        count += len(level)
        if count > MAX_NODES:
            raise _too_large(call, f"has more than {MAX_NODES:,} parts")
        level = [part for tree in level for part in tree.parts]
        if not level:
            return
    raise _too_large(call, f"is nested more than {MAX_LEVELS} levels deep")


def _too_large(call: Tree, what: str) -> ExpressionError:
    message = f"with its functions expanded, the expression {what}"
    return error_at("too-large", message, call, "define parts of it under `definitions`")


def substituted(tree: Tree, arguments: Mapping[str, Tree], place: tuple[int, int]) -> Tree:
    """Return the expression of a function with its arguments, at the position of the call."""

    def at(part: Tree) -> Tree:
        if isinstance(part, Name):
            given = arguments.get(part.text)
            if given is not None:
                return rate(given, part.primes) if part.primes else given
            root, dot, rest = part.text.partition(".")
            if dot and root in arguments:  # r.x of an argument r
                return at(_without_dot(part, root, rest, place))
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


def _without_dot(name: Name, root: str, rest: str, place: tuple[int, int]) -> Tree:
    """Return ``r.x`` as the component x of the name ``r``, at the position of the call."""
    for suffix, order in (("_ddot", 2), ("_dot", 1), ("", 0)):
        if rest.endswith(suffix):
            key = rest.removesuffix(suffix)
            vector = Name(*place, root, name.primes + order)
            break
    if key not in COMPONENTS:
        raise ExpressionError("syntax", f"`{name.text}` is not a component", *place)
    return ComponentExpr(*place, vector, key)


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
