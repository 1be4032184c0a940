"""A model file in HTML, with its keys, numbers and comments in different colours."""

from __future__ import annotations

import re
from html import escape

_LINE = re.compile(
    r"""
    (?P<comment>(?:(?<=\s)|^)\#.*$)
    | (?P<text>"(?:[^"\\]|\\.)*"|'(?:[^']|'')*')
    | (?P<key>(?:^\s*(?:-\s+)?|(?<=[{,]))\s*[^\s\#:{}\[\],"'][^:{},"\#]*(?=:(?:\s|$)))
    | (?P<number>(?<![\w.])\d+\.?\d*(?:[eE][+-]?\d+)?(?![\w.]))
    """,
    re.VERBOSE,
)


def highlighted(text: str) -> str:
    """Return the text of a YAML file as HTML for ``<pre>``.

    Every character of the text is kept, escaped; keys, numbers, quoted texts and comments are in a
    ``<span>`` of that class.
    """
    return "\n".join(map(_line, text.splitlines()))


def _line(line: str) -> str:
    parts: list[str] = []
    end = 0
    for found in _LINE.finditer(line):
        parts.append(escape(line[end : found.start()]))
        parts.append(f'<span class="yaml-{found.lastgroup}">{escape(found[0])}</span>')
        end = found.end()
    return "".join([*parts, escape(line[end:])])
