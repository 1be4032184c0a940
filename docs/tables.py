"""Tables of the documentation that are made from what the program declares."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from lagcli.settings.kinds import Choice, Flag, Setting, Times, Tolerances, WholeNumber
from lagcli.settings.methods import FORMULATIONS, METHODS, Method
from lagcli.settings.settings import Settings

#: Where a page has a table.
PLACE = re.compile(r"^<!-- table of (\w+) -->$", re.MULTILINE)


def with_tables(markdown: str) -> str:
    """Return a page with its tables."""
    return PLACE.sub(lambda place: TABLES[place[1]](), markdown)


def settings_table() -> str:
    """Return the table of settings."""
    rows = (
        (f"`--{x.name.replace('_', '-')}`", f"`{x.name}`", _value(x), x.stated, x.help)
        for x in Settings.DECLARED.values()
    )
    return _table(("option", "key", "value", "default", "meaning"), rows)


def methods_table() -> str:
    """Return the table of integration methods."""
    rows = (
        (
            f"`{method.name}`",
            method.description,
            method.order,
            "implicit" if method.implicit else "explicit",
            method.dense,
            ", ".join(f"`{engine}`{_limits(method, engine)}" for engine in method.formulations),
        )
        for method in METHODS.values()
    )
    return _table(("method", "", "order", "steps", "between steps", "engines"), rows)


TABLES = {"settings": settings_table, "methods": methods_table}


def _value(setting: Setting[Any]) -> str:
    match setting:
        case Choice():
            found = ", ".join(f"`{word}`" for word in setting.choices)
        case Flag():
            found = "`true`, `false`"
        case Times():
            found = "list of numbers"
        case Tolerances():
            found = "number, or numbers by coordinate and velocity"
        case WholeNumber():
            found = "whole number"
        case _:
            found = "number"
    return f"{found}, {setting.unit}" if setting.unit else found


def _limits(method: Method, engine: str) -> str:
    missing = [x for x in FORMULATIONS if x not in method.formulations[engine]]
    return f" (not {', '.join(missing)})" if missing else ""


def _table(heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = (heads, tuple("---" for _ in heads), *rows)
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
