"""Names of family members, and their formatting in messages."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lagcli.model.expression.tokens import ExpressionError, error_at
from lagcli.model.expression.trees import Range


def with_indices(family: str, indices: Iterable[int]) -> str:
    """Return the name of a member: ``Qc.rod[].x[]`` with 2 and 3 is ``Qc.rod[2].x[3]``."""
    first, *others = family.split("[]")
    return first + "".join(f"[{k}]{rest}" for k, rest in zip(indices, others, strict=True))


def index_of(member: str) -> int | None:
    """Return the index in a member's name; None for other names."""
    return int(member[member.index("[") + 1 : -1]) if member.endswith("]") else None


def family_of(member: str) -> str:
    """Return the name of a member's family, ``x[]``; other names unchanged."""
    return f"{member[: member.index('[')]}[]" if member.endswith("]") else member


def format_members(base: str, members: Sequence[str]) -> str:
    """Return the members of a family as ranges: x[0], x[1..20]."""
    found = sorted({k for k in map(index_of, members) if k is not None})
    runs: list[list[int]] = []
    for k in found:
        if runs and k == runs[-1][1] + 1:
            runs[-1][1] = k
        else:
            runs.append([k, k])
    shown = [f"`{base}[{a}]`" if a == b else f"`{base}[{a}..{b}]`" for a, b in runs[:4]]
    return ", ".join(shown) + (", …" if len(runs) > 4 else "")


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
