"""Spelling suggestions and shortened text for messages."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Sequence

_MANY = 500  # names to compare with
_LIKELY = 30  # of these, names to compare with difflib, which is slow


def shorten(text: str, width: int = 60) -> str:
    """Return the text on one line, truncated to a width."""
    # clean only what may be shown
    text = "".join(c if c.isprintable() or c.isspace() else "�" for c in text[: 8 * width])
    text = " ".join(text.split())
    return text if len(text) <= width else text[: width - 1] + "…"


def nearest(name: str, known: Sequence[str], count: int = 3) -> list[str]:
    """Return the known names most similar to a name."""
    if len(known) > _MANY:
        known = [k for k in known if k[:1] == name[:1] and abs(len(k) - len(name)) <= 2][:_MANY]
    wanted = _folded(name[:80])
    folded: dict[str, str] = {}
    for k in known:
        folded.setdefault(_folded(k), k)
    likely = list(folded)
    if len(likely) > _LIKELY:
        pairs = _pairs(wanted)
        likely.sort(key=lambda k: len(pairs ^ _pairs(k)))  # number of differing letter pairs
        del likely[_LIKELY:]
    from difflib import get_close_matches

    close = get_close_matches(wanted, likely, n=count, cutoff=0.6)
    return [folded[c] for c in close]


def did_you_mean(names: Iterable[str]) -> str | None:
    """Return "did you mean …?", or None without candidates."""
    shown = [n if n.startswith("`") else f"`{n}`" for n in names]
    return f"did you mean {' or '.join(shown)}?" if shown else None


def _pairs(name: str) -> set[str]:
    """Return the letter pairs (bigrams) of a name, including its ends."""
    return {a + b for a, b in zip(f" {name}", f"{name} ", strict=True)}


def _folded(name: str) -> str:
    """Return a name normalized for comparison: case, and the two code points of µ."""
    return unicodedata.normalize("NFKC", name).casefold()
