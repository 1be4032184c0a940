"""Families: what the key of an entry declares, x, x[0], x[1..N] or x[i = 1..N], and its members."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from lagcli.model.diagnostics import Broken
from lagcli.model.draft import NO_INDICES, Draft, Entry, Indices
from lagcli.model.expression.grammar import KEYWORDS, parse_range
from lagcli.model.expression.tokens import ExpressionError, is_name, words
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
    """An entry and what its key declares.

    Parameters
    ----------
    name : str
        The name alone.
    key : Scalar
    node : Node
        The value of the entry; the key itself where there is none.
    index : str or None
        The name of the index.
    span : Range, Tree or None
        The indices of the members; the index of one member; None for a name without an index.
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
        """The name by which other entries know it: ``x``, or ``x[]`` for members."""
        return self.name if self.span is None else f"{self.name}[]"

    @property
    def several(self) -> bool:
        """Whether it declares a range of members."""
        return isinstance(self.span, Range)

    @property
    def title(self) -> str:
        """What messages call it: x, x[0], x[i], x[1..N]; primes included."""
        primes = "'" * self.primes
        if self.span is None:
            return self.name + primes
        inside = self.index
        if inside is None:
            inside = self.key.value[self.span.start : self.span.end]
        return f"{self.name}[{shorten(inside)}]{primes}"


class Member(NamedTuple):
    """One thing that an entry declares, and the value of the entry's index for it."""

    name: str
    declaration: Declaration
    indices: Indices = NO_INDICES


def declarations(
    draft: Draft, entries: Iterable[Entry], what: str, primed: bool = False
) -> list[Declaration]:
    """Return what entries declare; keys that declare nothing are reported."""
    found = (read_key(draft, key, node, what, primed) for _, key, node in entries)
    return [d for d in found if d is not None]


def read_key(
    draft: Draft, key: Scalar, node: YamlNode, what: str, primed: bool = False
) -> Declaration | None:
    """Return what a key declares; report a key that declares nothing.

    Parameters
    ----------
    draft : Draft
    key, node : Scalar, Node
    what : str
        What it is to be the name of.
    primed : bool
        Whether it may be a velocity.
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
    """Report a name that nothing can have; its words may have been meant as names."""
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
    """Put the article before a noun."""
    return f"an {what}" if what[0] in "aeiou" else f"a {what}"


def members_of(draft: Draft, declaration: Declaration, names: Symbols) -> list[Member]:
    """Return what an entry declares; report a range that is none.

    Parameters
    ----------
    draft : Draft
    declaration : Declaration
    names : Names
        Those that a range may use: the parameters by their values.

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
            raise ExpressionError(
                "too-large",
                f"the families of this model have more than {MAX_ALL:,} members",
                d.span.start,
                d.span.end,
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
    """Return members by their names; report those that two entries declare.

    Parameters
    ----------
    draft : Draft
    found : iterable of Member
    singles_win : bool
        Whether an entry for a single member replaces the member of a range.
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
            "let the ranges not overlap",
            (("the first one is here", others.key.location),),
        )
    return result


def bounds(declaration: Declaration) -> list[str]:
    """Return the names in the range of an entry."""
    return [] if declaration.span is None else [name.text for name in names_in(declaration.span)]
