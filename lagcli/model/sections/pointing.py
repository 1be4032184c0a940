"""Names of points in views: `A`, `P[i]`, `O-A-B`, `P[i-1]-P[i] for i = 1..N`."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from symengine import Basic

from lagcli.model.diagnostics import Broken
from lagcli.model.draft import Draft, Indices
from lagcli.model.expression.grammar import Span, parse, parse_spans
from lagcli.model.expression.tensors import Tensor
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.trees import Name, SumExpr, Tree, VectorExpr, as_written
from lagcli.model.model import Definition
from lagcli.model.names.families import Declaration, members_of
from lagcli.model.names.members import members_clause, with_indices
from lagcli.model.names.scope import ModelScope, uses
from lagcli.model.spelling import did_you_mean, nearest
from lagcli.model.symbols import Context, Symbols
from lagcli.model.yaml.source import Scalar, Sequence, YamlNode

_FOR = r"\s+for\s+"


class Points:
    """The points of a view, and definitions that can be used as points.

    Parameters
    ----------
    draft : Draft
    definitions : mapping of str to Definition

    Attributes
    ----------
    found : dict of str to expressions
        The points that have a value; a definition is added when it is first used.
    declared : dict with str keys
        Names of all points, including those with errors, in the order of the file.
    dimension : int
        2 or 3; 0 while unknown.
    """

    def __init__(self, draft: Draft, definitions: Mapping[str, Definition]):
        self.draft, self.definitions = draft, definitions
        self.found: dict[str, tuple[Basic, ...]] = {}
        self.declared: dict[str, None] = {}
        self.dimension = 0

    def at(self, tree: Name, scope: ModelScope) -> str:
        """Return the name of the point that a tree denotes.

        Raises
        ------
        ExpressionError
            There is no such point.
        Broken
            The declaration of the point has an error.
        """
        text = member_name(tree, scope)
        if text in self.found:
            return text
        if text in self.declared:
            raise Broken
        definition = self.definitions.get(text)
        value = definition.value if definition is not None else None
        if isinstance(value, Tensor) and value.is_vector and len(value.entries) == self.dimension:
            self.found[text] = value.entries
            return text
        names = self.draft.names
        if names.incomplete or text in names.broken or text in names.suspects:
            raise Broken
        raise ExpressionError(
            "unknown-name",
            f"{scope.context.where} uses `{text}`{scope.at()}, which is not a point of the view",
            tree.start,
            tree.end,
            self._help(tree, text),
            f"point {tree.text}",
        )

    def _help(self, tree: Name, text: str) -> str:
        base = text.partition("[")[0]
        members = [name for name in self.declared if name.startswith(f"{base}[")]
        if members and tree.indices:
            return members_clause(base, members)
        if members:
            return f"name a member, as in `{members[0]}`"
        close = nearest(text, list(self.declared))
        shown = ", ".join(f"`{name}`" for name in list(self.declared)[:12])
        return did_you_mean(close) or f"its points are {shown}"


def member_name(tree: Name, scope: ModelScope) -> str:
    """Return a name with its indices as numbers."""
    for index in tree.indices:
        scope.check_index(index)
    return with_indices(tree.text, [scope.indices.at(index) for index in tree.indices])


class Path(NamedTuple):
    """A sequence of points as written, and the index over which it repeats."""

    what: str
    node: Scalar
    names: tuple[Name, ...]
    declaration: Declaration

    @property
    def title(self) -> str:
        """The names as written."""
        return "-".join(map(as_written, self.names))


def read_path(
    draft: Draft, node: YamlNode, what: str, count: int | None, example: str
) -> Path | None:
    """Parse names joined by hyphens, optionally followed by ``for i = 1..N``; report errors.

    Parameters
    ----------
    draft : Draft
    node : Node
    what : str
        Description for messages.
    count : int or None
        1 for a single point; None for two or more; 0 for any number.
    example : str
    """
    if isinstance(node, Sequence):
        node = draft.vector_text(node)  # [O, A]
    if not isinstance(node, Scalar) or node.missing:
        draft.report.add(
            "wrong-type",
            f"{what} names {'a point' if count == 1 else 'points'}, not {node.what}",
            node.location,
            f"write `{example}`",
        )
        return None
    with draft.report.expression(node):
        text = node.value
        clause = re.search(_FOR, text)
        tree = parse(text[: clause.start()] if clause else text)
        names = tuple(_names(tree, what, count, example))
        spans: list[Span] = []
        if clause:
            spans = parse_spans(text, clause.end(), len(text))
            if spans[0][0] is None:
                raise ExpressionError(
                    "syntax",
                    "the index has no name",
                    clause.end(),
                    len(text),
                    "write `for i = 1..N`",
                )
        return Path(what, node, names, Declaration(what, node, node, tuple(spans)))
    return None


def _names(tree: Tree, what: str, count: int | None, example: str) -> Iterator[Name]:
    terms: tuple[tuple[int, Tree], ...] = ((1, tree),)
    if isinstance(tree, SumExpr):
        terms = tree.terms
    elif isinstance(tree, VectorExpr):
        terms = tuple((-1 if place else 1, item) for place, item in enumerate(tree.items))
    for place, (sign, term) in enumerate(terms):
        if not isinstance(term, Name) or term.primes or (sign > 0) != (place == 0):
            raise ExpressionError(
                "not-a-point",
                f"{what} is drawn at {'a single named point' if count == 1 else 'named points'}",
                term.start,
                term.end,
                f"write `{example}`; declare expressions under `points`",
            )
        yield term
    if (count is None and len(terms) < 2) or (count and len(terms) != count):
        raise ExpressionError(
            "not-a-point",
            f"{what} runs between two points"
            if count is None
            else f"{what} is drawn at a single point",
            tree.start,
            tree.end,
            f"write `{example}`",
        )


def each(
    draft: Draft,
    path: Path,
    constants: Symbols,
    declaration: Declaration | None,
    resolve: Callable[[Name, ModelScope], str],
) -> Iterator[tuple[tuple[str, ...], str, Indices]]:
    """Yield the points of a path for each value of its index.

    Parameters
    ----------
    draft, path, constants : Draft, Path, Names
    declaration : Declaration or None
        The entry whose value is the path and whose key has its index. If not given, the index
        follows the path.
    resolve : callable
        Returns the value of a name; raises the errors of `Points.at`.

    Yields
    ------
    points : tuple of str
    name : str
        Name of the member of the entry; without an entry, the points with hyphens.
    indices : mapping of str to int
    """
    over = path.declaration if declaration is None else declaration
    scope = ModelScope(draft.names, Context(path.what), over.indices)
    if declaration is not None and path.declaration.spans:
        draft.report.add(
            "bad-range",
            f"{path.what} has a name, to which the index belongs",
            path.node.location,
            f"write `{declaration.name}[i = 1..N]: P[i-1]-P[i]`",
        )
        return
    if over.several and not any(uses(name, i) for i in over.indices for name in path.names):
        draft.report.add(
            "unused-index",
            f"{path.what} is the same for every index",
            path.node.location,
            "use the index, or give it once",
        )
        return
    for member in members_of(draft, over, constants):
        scope.values.update(member.indices)
        with draft.report.expression(path.node):
            points = tuple(resolve(name, scope) for name in path.names)
            yield points, "-".join(points) if declaration is None else member.name, member.indices
            continue
        return  # one error is reported for all members
