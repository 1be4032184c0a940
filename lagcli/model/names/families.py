"""Declarations of names and families: x, x[0], x[1..N] or x[i = 1..N]."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from lagcli.model.diagnostics import Broken
from lagcli.model.expression.grammar import KEYWORDS, Span, parse_spans
from lagcli.model.expression.tokens import ExpressionError, error_at, is_name, words
from lagcli.model.expression.trees import BRACKETS, Range, Tree
from lagcli.model.names.draft import NO_INDICES, Draft, Entry, Indices
from lagcli.model.names.members import descending, names_in
from lagcli.model.names.namespace import Allowed
from lagcli.model.names.scope import Scope
from lagcli.model.spelling import shorten
from lagcli.model.yaml.source import Scalar, YamlNode

#: Dotted names after the index of a member, and its derivative: ``r[1].x'``, ``link[1].com.x``.
_AFTER = r"((?:\.\w+?)*)('|_dot)?"
#: Dotted names after the index of a declared member: ``link[1..N].mass``.
_DOTTED = r"((?:\.[^\W\d]\w*)*)()"
#: First parts of the names of columns, which no dotted name may have.
COLUMN_PREFIXES = ("lambda", "Qc", "conserved", "impulse", "t", "pi")
MAX_ALL = 100_000  # members of all families of a model


class Declaration(NamedTuple):
    """Declaration by the key of an entry.

    Parameters
    ----------
    name : str
        The name without indices and primes.
    key : Scalar
    node : Node
        The value of the entry; the key itself if it has none.
    spans : tuple of (str or None, Range or Tree)
        For each index, its name and the range of the members, or the index of one member.
    primes : int
    part : str
        Suffix after the indices: ``.x`` of a component.
    kind : str
        The kind of a vector or rotation coordinate, if the entry is derived from one.
    """

    name: str
    key: Scalar
    node: YamlNode
    spans: tuple[Span, ...] = ()
    primes: int = 0
    part: str = ""
    kind: str = ""

    @property
    def family(self) -> str:
        """The name used for lookups: ``x``, ``x[]`` or ``x[,]`` for members, ``r[].x``."""
        return self.name + BRACKETS.get(len(self.spans), "") + self.part

    @property
    def several(self) -> bool:
        """Whether it declares a range of members."""
        return any(isinstance(span, Range) for _, span in self.spans)

    @property
    def indices(self) -> tuple[str, ...]:
        """The names of the indices."""
        return tuple(index for index, _ in self.spans if index is not None)

    @property
    def title(self) -> str:
        """The name for messages: x, x[0], x[i], x[1..N]; primes included."""
        primes = "'" * self.primes
        if not self.spans:
            return self.name + self.part + primes
        text = self.key.value
        inside = [text[s.start : s.end] if i is None else i for i, s in self.spans]
        return f"{self.name}[{', '.join(map(shorten, inside))}]{self.part}{primes}"


class Member(NamedTuple):
    """One declared name, and the values of the entry's index."""

    name: str
    declaration: Declaration
    indices: Indices = NO_INDICES


def declarations(draft: Draft, entries: Iterable[Entry], what: str) -> list[Declaration]:
    """Return the declarations of entries; report invalid keys."""
    declared = (read_key(draft, key, node, what) for _, key, node in entries)
    return [d for d in declared if d is not None]


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
    after = re.fullmatch(_AFTER if primed else _DOTTED, ending)
    if closing < 0 or after is None:
        draft.report.add(
            "bad-name",
            f"`{shorten(text)}` cannot be the name of {a(what)}",
            key.location,
            "a family is written `x[1..N]` or `x[i = 1..N]`, one member `x[0]`",
        )
        draft.names.suspects.add(name)
        return None
    with draft.report.expression(key):
        spans = parse_spans(text, len(name) + 1, closing)
        return Declaration(name, key, node, tuple(spans), int(bool(after[2])), after[1] or "")
    draft.names.suspects.add(name)
    return None


def valid_name(draft: Draft, name: str, key: YamlNode, what: str) -> bool:
    """Whether a name is valid; report an invalid name."""
    report = draft.report
    first, *rest = name.split(".")
    if not all(map(is_name, (first, *rest))) or (rest and first in COLUMN_PREFIXES):
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


def members_of(draft: Draft, declaration: Declaration) -> list[Member]:
    """Return the members that an entry declares; report an invalid range.

    Raises
    ------
    Unbuilt
        A parameter in the range has no value yet.
    """
    d = declaration
    if not d.spans:
        return [Member(d.name + d.part, d)]
    scope = Scope(draft.names, f"the index of `{d.name}`", Allowed.NUMBERS)
    with draft.report.expression(d.key):
        try:
            if d.family in draft.names.broken:
                raise Broken
            tuples: list[tuple[int, ...]] = [()]
            for place, (index, span) in enumerate(d.spans):
                before = [name for name, _ in d.spans[:place] if name is not None]
                scope.bound = frozenset(before)
                scope.check_index(span)
                if index is not None and isinstance(span, Range):
                    scope.check_index_name(index, span)
                tuples = [
                    (*values, k)
                    for values in tuples
                    for k in _values(draft, d, scope, span, values, len(tuples))
                ]
        except (Broken, ExpressionError):
            draft.names.broken.add(d.family)
            raise
        names_of = [index for index, _ in d.spans]
        return [
            Member(
                f"{d.name}[{','.join(map(str, values))}]{d.part}",
                d,
                {i: k for i, k in zip(names_of, values, strict=True) if i} or NO_INDICES,
            )
            for values in tuples
        ]
    return []


def _values(
    draft: Draft,
    d: Declaration,
    scope: Scope,
    span: Range | Tree,
    before: tuple[int, ...],
    count: int,
) -> Sequence[int]:
    """Return the values of an index, given those of the index before it."""
    scope.values.clear()
    named = zip((index for index, _ in d.spans), before, strict=False)
    scope.values.update({index: k for index, k in named if index})
    if not isinstance(span, Range):
        return [scope.indices.at(span)]
    indices = scope.indices.range(span)
    draft.names.member_count += len(indices)
    if draft.names.member_count > MAX_ALL or count * len(indices) > MAX_ALL:
        raise error_at(
            "too-large",
            f"the families of this model have more than {MAX_ALL:,} members",
            span,
            "choose smaller ranges",
            "members",
        )
    if indices.stop < indices.start:
        raise descending(span, indices)
    return indices


def expanded(draft: Draft, declared: Iterable[Declaration]) -> list[Member]:
    """Return all members of several entries."""
    return [member for d in declared for member in members_of(draft, d)]


def by_name(
    draft: Draft, members: Iterable[Member], singles_win: bool = False
) -> dict[str, Member]:
    """Return members by name; report names declared by two entries.

    Parameters
    ----------
    draft : Draft
    members : iterable of Member
    singles_win : bool
        Whether the entry of a single member overrides that of a range.
    """
    result: dict[str, Member] = {}
    clashes: set[tuple[int, int]] = set()
    for member in members:
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
    return [name.text for _, span in declaration.spans for name in names_in(span)]
