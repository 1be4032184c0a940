"""Names of a model as identifiers of a programming language."""

from __future__ import annotations

import re
from collections.abc import Iterable


def words(text: str) -> frozenset[str]:
    """Return the words of a text, as reserved ones are listed."""
    return frozenset(text.split())


class Identifiers:
    """Identifiers that are unique in one scope.

    Parameters
    ----------
    reserved : iterable of str
        Words that the language, or the code around, uses.
    """

    def __init__(self, reserved: Iterable[str]):
        self._taken = set(reserved)

    def of(self, name: str) -> str:
        """Return an identifier for a name: ``x[1].y`` becomes ``x_1_y``."""
        plain = re.sub(r"[^0-9A-Za-z]+", "_", name.replace("'", "_dot")).strip("_")
        if not plain or plain[0].isdigit() or re.fullmatch(r"w\d+", plain):
            plain = f"n_{plain}"
        while plain in self._taken:
            plain += "_"
        self._taken.add(plain)
        return plain
