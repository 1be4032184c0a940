"""Where the names in a message are declared."""

from __future__ import annotations

import re
from collections.abc import Iterable

from lagcli.errors import SourceLocation
from lagcli.model.model import Model


def declarations_in(model: Model, message: str) -> list[str]:
    """Return a sentence on each name in backticks that the model declares, with file and line.

    Parameters
    ----------
    model : Model
    message : str
        As the engine wrote it, which knows no files.
    """
    found = dict.fromkeys(re.findall(r"`([^`]+)`", message))
    places = _places(model)
    return [
        f"`{name}` is declared in {place.with_line}"
        for name in found
        if (place := places.get(name)) is not None
    ]


def lines_of(model: Model, names: Iterable[str]) -> str:
    """Return the file and the lines where constraints are declared, such as ``a.yaml:4, 7``."""
    places = _places(model)
    found = [places[name] for name in names if name in places]
    lines = sorted({place.line for place in found})
    return f"{found[0].path}:{', '.join(map(str, lines))}" if found else ""


def _places(model: Model) -> dict[str, SourceLocation]:
    found = [(c.name, c.location) for c in model.coordinates]
    found += [(c.name, c.location) for c in model.constraints]
    found += [(e.name, e.location) for e in model.events]
    return {name: place for name, place in found if place is not None}
