"""Text to read: counts with their nouns, lines that keep a number with its name and unit."""

from __future__ import annotations

import re

#: Matches spaces that must not break: a = 1 m, x [m], rod[1] -4.905, 0 → 1, 12 steps.
_WITHIN = (
    r"(?<= [=→]) | (?=[=→] )|(?<= ->) | (?=-> )|(?<=\bat t) |(?<=\bat) (?=t\b)"
    r"|(?<=\bm[ai][nx]) +|(?<=\d) (?=[A-Za-z%])|(?<=[\w\]']) (?=\[|[-−]?\d)|(?<=\bλ) (?=\w)"
)


def counted(number: int, noun: str, plural: str | None = None) -> str:
    """Return a number with its noun: 1 sample, 601 samples.

    Parameters
    ----------
    number : int
    noun : str
    plural : str, optional
        By default the noun with an s.
    """
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def wrapped(text: str, width: int, first: str = "", following: str = "") -> list[str]:
    """Break a text into lines, without breaking between a name and its value, or a number and its
    unit.

    Parameters
    ----------
    text : str
    width : int
        Width, including the indentation.
    first, following : str
        Indentation of the first line, and of the others.
    """
    import textwrap  # slow to import

    lines = textwrap.wrap(
        re.sub(_WITHIN, "\u00a0", text),
        width,
        initial_indent=first,
        subsequent_indent=following,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace("\u00a0", " ") for line in lines]
