"""Declarations of names and families: x, x[0], x[1..N] or x[i = 1..N]."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from lagcli.model.diagnostics import Broken
from lagcli.model.draft import NO_INDICES, Draft, Entry, Indices
from lagcli.model.expression.grammar import KEYWORDS, parse_range
from lagcli.model.expression.tokens import ExpressionError, error_at, is_name, words
from lagcli.model.expression.trees import Range, Tree
from lagcli.model.names.indices import names_in
from lagcli.model.names.members import descending
from lagcli.model.names.scope import ModelScope
from lagcli.model.spelling import shorten
from lagcli.model.symbols import Context, Symbols
from lagcli.model.yaml.source import Scalar, YamlNode

MAX_ALL = 100_000  # members of all families of a model


@dataclass(frozen=True, eq=False, slots=True)
class Declaration:
    """Declaration by the key of an entry.

    Parameters
    ----------
    name : str
        The name without index and primes.
    key : Scalar
    node : Node
        The value of the entry; the key itself if it has none.
    index : str or None
        The name of the index.
    span : Range, Tree or None
        Index range of the members, index of one member, or None for a name without an index.
    primes : int
    """

    name: str
    key: Scalar
    node: YamlNode
    index: str | None = None
    span: Range | Tree | None = None
    primes: int = 0

    @property
    def family(self) -> str:
        """The name used for lookups: ``x``, or ``x[]`` for members."""
        return self.name if self.span is None else f"{self.name}[]"

    @property
    def several(self) -> bool:
        """Whether it declares a range of members."""
        return isinstance(self.span, Range)

    @property
    def title(self) -> str:
        """The name for messages: x, x[0], x[i], x[1..N]; primes included."""
        primes = "'" * self.primes
        if self.span is None:
            return self.name + primes
        inside = self.index
        if inside is None:
            inside = self.key.value[self.span.start : self.span.end]
        return f"{self.name}[{shorten(inside)}]{primes}"


class Member(NamedTuple):
    """One declared name, and the values of the entry's index."""

    name: str
    declaration: Declaration
    indices: Indices = NO_INDICES


def declarations(
    draft: Draft, entries: Iterable[Entry], what: str, primed: bool = False
) -> list[Declaration]:
    """Return the declarations of entries; report invalid keys."""
    found = (read_key(draft, key, node, what, primed) for _, key, node in entries)
    return [d for d in found if d is not None]


def read_key(
    draft: Draft, key: Scalar, node: YamlNode, what: str, primed: bool = False
) -> Declaration | None:
    """Parse the declaration in a key; report an invalid key.

    Parameters
    ----------
    draft : Draft
    key, node : Scalar, Node
    what : str
        Kind of the declared name, for messages.
    primed : bool
        Whether the name may be a velocity.
    """
    text = key.value
    name, bracket, _ = text.partition("[")
    if not bracket or not is_name(name):
        return Declaration(name, key, node) if valid_name(draft, text, key, what) else None
    if not valid_name(draft, name, key, what):
        return None
    closing = text.rfind("]")
    ending = text[closing + 1 :] if closing > 0 else ""
    primes = {"": 0, "'": 1, "_dot": 1}.get(ending) if primed else {"": 0}.get(ending)
    if closing < 0 or primes is None:
        draft.report.add(
            "bad-name",
            f"`{shorten(text)}` cannot be the name of {a(what)}",
            key.location,
            "a family is written `x[1..N]` or `x[i = 1..N]`, one member `x[0]`",
        )
        draft.names.suspects.add(name)
        return None
    with draft.report.expression(key):
        index, span = parse_range(text, len(name) + 1, closing)
        return Declaration(name, key, node, index, span, primes)
    draft.names.suspects.add(name)
    return None


def valid_name(draft: Draft, name: str, key: YamlNode, what: str) -> bool:
    """Whether a name is valid; report an invalid name."""
    report = draft.report
    if not is_name(name):
        help_ = "a name is a letter followed by letters, digits and _"
        if "," in name or " " in name.strip():
            help_ += ";\nnames in a list are separated by commas: `[x, y]`"
        report.add(
            "bad-name",
            f"`{shorten(name)}` cannot be the name of {a(what)}",
            key.location,
            help_,
        )
    elif name in KEYWORDS or (name in ("t", "pi") and what not in ("constraint", "output")):
        meaning = {"t": "the time", "pi": "the number π"}.get(name, "a word of the grammar")
        report.add(
            "reserved-name",
            f"`{name}` cannot be the name of {a(what)}: it is {meaning}",
            key.location,
            "choose another name",
        )
    else:
        return True
    draft.names.suspects.update(words(name[:200]))
    return False


def a(what: str) -> str:
    """Return a noun with its indefinite article."""
    return f"an {what}" if what[0] in "aeiou" else f"a {what}"


def members_of(draft: Draft, declaration: Declaration, names: Symbols) -> list[Member]:
    """Return the members that an entry declares; report an invalid range.

    Parameters
    ----------
    draft : Draft
    declaration : Declaration
    names : Symbols
        Names that a range may use: parameters with their values.

    Raises
    ------
    Unbuilt
        A parameter in the range has no value yet.
    """
    d = declaration
    if d.span is None:
        return [Member(d.name, d)]
    scope = ModelScope(names, Context(f"the index of `{d.name}`", False, definitions=False))
    with draft.report.expression(d.key):
        try:
            if d.family in draft.names.broken:
                raise Broken
            scope.check_index(d.span)
            if not isinstance(d.span, Range):
                return [Member(f"{d.name}[{scope.indices.at(d.span)}]", d)]
            if d.index is not None:
                scope.check_index_name(d.index, d.span)
            span = scope.indices.range(d.span)
        except (Broken, ExpressionError):
            draft.names.broken.add(d.family)
            raise
        draft.members += len(span)
        if draft.members > MAX_ALL:
            draft.names.broken.add(d.family)
            raise error_at(
                "too-large",
                f"the families of this model have more than {MAX_ALL:,} members",
                d.span,
                "choose smaller ranges",
                "members",
            )
        if span.stop < span.start:
            draft.names.broken.add(d.family)
            raise descending(d.span, span)
        index = d.index
        return [Member(f"{d.name}[{k}]", d, {index: k} if index else NO_INDICES) for k in span]
    return []


def by_name(draft: Draft, found: Iterable[Member], singles_win: bool = False) -> dict[str, Member]:
    """Return members by name; report names declared by two entries.

    Parameters
    ----------
    draft : Draft
    found : iterable of Member
    singles_win : bool
        Whether the entry of a single member overrides that of a range.
    """
    result: dict[str, Member] = {}
    clashes: set[tuple[int, int]] = set()
    for member in found:
        name = member.name + "'" * member.declaration.primes
        first = result.setdefault(name, member)
        if first is member:
            continue
        mine, others = member.declaration, first.declaration
        if singles_win and mine.several != others.several:
            result[name] = first if mine.several else member
            continue
        if (id(mine), id(others)) in clashes:
            continue
        clashes.add((id(mine), id(others)))
        draft.report.add(
            "duplicate-name",
            f"`{name}` is declared twice: by `{shorten(others.key.value)}` and by"
            f" `{shorten(mine.key.value)}`",
            mine.key.location,
            "use ranges that do not overlap",
            (("the first one is here", others.key.location),),
        )
    return result


def bounds(declaration: Declaration) -> list[str]:
    """Return the names in the range of an entry."""
    return [] if declaration.span is None else [name.text for name in names_in(declaration.span)]
