"""Formatting of the text output of analyses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from lagcli.prose import wrapped

#: Columns of the text: by default those of a file, on a terminal those of `laid_out`.
_COLUMNS = ContextVar("_COLUMNS", default=80)
_LABEL = 9
#: Length of an item that is not broken.
_UNBROKEN = 36


def width() -> int:
    """Return the columns of the text."""
    return _COLUMNS.get()


@contextmanager
def laid_out(columns: int) -> Iterator[None]:
    """Lay out texts that are formatted in this context in so many columns."""
    token = _COLUMNS.set(columns)
    try:
        yield
    finally:
        _COLUMNS.reset(token)


def entry(label: str, text: str, indent: int = 2) -> list[str]:
    """Return a label followed by a wrapped text."""
    before = " " * (indent + _LABEL)
    first, *rest = wrapped(text, width() - len(before)) or [""]
    return [f"{' ' * indent}{label:<{_LABEL}}{first}", *(before + line for line in rest)]


def listed(items: Sequence[str], most: int = 12) -> str:
    """Return items on one line; for many items, the first ones and the number of the others.

    `entry` breaks lines between short items only.
    """
    whole = [x.replace(" ", "\u00a0") if len(x) <= _UNBROKEN else x for x in items[:most]]
    more = [f"and {len(items) - most} more (--json)"] if len(items) > most else []
    return ", ".join([*whole, *more])


def without_rounding(values: Mapping[str, float]) -> dict[str, float]:
    """Return values with zeros for rounding errors relative to the largest value."""
    least = 1e-13 * max(map(abs, values.values()), default=0.0)
    return {name: value if abs(value) > least else 0.0 for name, value in values.items()}


def state_lines(state: Mapping[str, Any], indent: int, rates: bool = True) -> list[str]:
    """Return the lines with q and λ of a state, from its JSON values.

    Parameters
    ----------
    state : mapping
    indent : int
    rates : bool
        Whether velocities that are not zero are listed too.
    """
    values = without_rounding(state["q"])
    if rates:
        moving = {f"{name}'": value for name, value in state["v"].items() if value}
        values |= {name: x for name, x in without_rounding(moving).items() if x}
    lines = entry("q", listed([f"{name} = {x:.6g}" for name, x in values.items()]), indent)
    if state["multipliers"]:
        multipliers = without_rounding(state["multipliers"])
        lines += entry("λ", listed([f"{name} {x:.6g}" for name, x in multipliers.items()]), indent)
    return lines
