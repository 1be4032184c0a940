"""Tables of the documentation that follow from declarations.

``python docs/tables.py`` writes them into the pages.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lagcli.columns import QUANTITIES, ResultQuantity
from lagcli.model.keys import VIEW, JsonSchema
from lagcli.model.loader import MODEL
from lagcli.settings.kinds import Choice, Flag, Names, Setting, Times, Tolerances, WholeNumber
from lagcli.settings.methods import FORMULATIONS, METHODS, Method
from lagcli.settings.settings import Settings

DOCS = Path(__file__).parent
#: A table in a page, between comments that say which.
PLACE = re.compile(r"(?<=^<!-- table of )(\w+)( -->\n).*?(?=^<!-- end of table -->$)", re.M | re.S)


def with_tables(markdown: str) -> str:
    """Return a page with its tables as they follow from the declarations."""
    return PLACE.sub(lambda place: f"{place[1]}{place[2]}\n{TABLES[place[1]]()}\n\n", markdown)


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
            _formulations(method),
        )
        for method in METHODS.values()
    )
    return _table(("method", "", "order", "steps", "between steps", "formulations"), rows)


def columns_table() -> str:
    """Return the table of the datasets and columns of results; [q] is a coordinate's unit."""
    rows = (
        (
            f"`{x.name}`",
            _shape(x),
            x.description,
            x.unit.replace("{u}", "[q]").replace("{c}", "[c]").replace("{k}", "[k]"),
            _column(x),
        )
        for x in QUANTITIES
    )
    return _table(("dataset", "shape", "meaning", "unit", "column"), rows)


def keys_table() -> str:
    """Return the table of the keys of model files."""
    return _keys_table(MODEL)


def view_table() -> str:
    """Return the table of the keys of a view."""
    return _keys_table(VIEW)


TABLES = {
    "settings": settings_table,
    "methods": methods_table,
    "columns": columns_table,
    "keys": keys_table,
    "view": view_table,
}


def _keys_table(schema: JsonSchema) -> str:
    rows = ((f"`{name}`", x["description"]) for name, x in schema["properties"].items())
    return _table(("key", "value"), rows)


def _value(setting: Setting[Any]) -> str:
    match setting:
        case Choice():
            found = ", ".join(f"`{word}`" for word in setting.choices)
        case Flag():
            found = "`true`, `false`"
        case Times():
            found = "list of numbers"
        case Names():
            found = "list of names"
        case Tolerances():
            found = "number, or numbers by coordinate and velocity"
        case WholeNumber():
            found = "whole number"
        case _:
            found = "number"
    return f"{found}, {setting.unit}" if setting.unit else found


def _formulations(method: Method) -> str:
    """Return the formulations that a method supports."""
    missing = [name for name in FORMULATIONS if name not in method.formulations]
    return f"not {', '.join(missing)}" if missing else "all"


def _shape(quantity: ResultQuantity) -> str:
    sizes = {"time": "nt", "coordinate": "nq", "constraint": "nc", "term": "n"}
    sizes["conserved_quantity"] = "ni"
    axes = [sizes[axis] for axis in quantity.axes]
    return f"({', '.join(axes)}{',' * (len(axes) == 1)})"


def _column(quantity: ResultQuantity) -> str:
    if quantity.axes[0] != "time":
        return ""
    name = re.sub("{(constraint|conserved)}", "NAME", quantity.pattern)
    name = name.replace("{coordinate}", "q")
    return f"`{name}`"


def _table(heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = (heads, tuple("---" for _ in heads), *rows)
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


if __name__ == "__main__":
    for page in DOCS.glob("*.md"):
        text = page.read_text(encoding="utf-8")
        page.write_text(with_tables(text), encoding="utf-8")
