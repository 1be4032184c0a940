"""Names of family members, and their formatting in messages."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from lagcli.model.expression.tokens import ExpressionError, error_at
from lagcli.model.expression.trees import Range

_INDEX = re.compile(r"\[(-?\d+)(?:,(-?\d+))?\]")
_OPEN = re.compile(r"\[,?\]")


def with_indices(family: str, indices: Iterable[int]) -> str:
    """Return the name of a member: ``Qc.rod[].x[,]`` with 2, 3, 4 is ``Qc.rod[2].x[3,4]``."""
    values = iter(indices)

    def closed(match: re.Match[str]) -> str:
        return f"[{','.join(str(next(values)) for _ in range(len(match[0]) - 1))}]"

    return _OPEN.sub(closed, family)


def indices_of(member: str) -> tuple[int, ...]:
    """Return the indices in a member's name, empty for other names: 3 of ``r[3].x``."""
    match = _INDEX.search(member)
    return tuple(int(k) for k in match.groups() if k is not None) if match else ()


def family_of(member: str) -> str:
    """Return the name of a member's family: ``x[]``, ``r[].x``, ``u[,]``; other names unchanged."""
    if "[" not in member:
        return member
    return _INDEX.sub(lambda match: "[]" if match[2] is None else "[,]", member)


def format_members(base: str, members: Sequence[str]) -> str:
    """Return the members of a family as ranges: x[0], x[1..20]; u[1..3, 1..5]."""
    found = sorted({indices_of(member) for member in members} - {()})
    if found and len(found[0]) > 1:
        spans = [sorted(set(column)) for column in zip(*found, strict=False)]
        inside = ", ".join(f"{s[0]}..{s[-1]}" if len(s) > 1 else f"{s[0]}" for s in spans)
        return f"`{base}[{inside}]`"
    runs: list[list[int]] = []
    for (k,) in found:
        if runs and k == runs[-1][1] + 1:
            runs[-1][1] = k
        else:
            runs.append([k, k])
    shown = [f"`{base}[{a}]`" if a == b else f"`{base}[{a}..{b}]`" for a, b in runs[:4]]
    return ", ".join(shown) + (", …" if len(runs) > 4 else "")


def split_names(text: str) -> list[str]:
    """Return the names of a list with commas; those in brackets belong to a name: ``u[1,2]``."""
    return [x.strip() for x in re.split(r",(?![^\[]*\])", text)]


def members_clause(base: str, members: Sequence[str]) -> str:
    """Return a clause that lists the members of a family."""
    return (
        f"there is only {format_members(base, members)}"
        if members
        else f"the family `{base}` is empty"
    )


def descending(tree: Range, span: range) -> ExpressionError:
    """Return the error for a range that ends before it starts."""
    return error_at(
        "bad-range",
        f"the range {span.start}..{span.stop - 1} is descending",
        tree,
        "write ranges in ascending order: first..last",
    )
