"""Text on a terminal: bold headings, dim units, colours of success and failure.

Text is laid out without styles. Here they are added on a terminal, by the place of words in the
layout: a listing has labels in front of a fixed column, a page has headings at the left margin.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple, TextIO

from lagcli.cli.streams import fitted, has_colour, tell, text_width, visible


class Style(IntEnum):
    """Styles, by their codes in escape sequences."""

    BOLD, DIM, RED, GREEN = 1, 2, 31, 32


class StyledSpan(NamedTuple):
    """Characters of a line with a style."""

    start: int
    end: int
    style: Style


# Patterns are compiled where they are used: most output goes to no terminal.

#: Matches the unit of a name in a listing: rod [N/m]; units of coordinates and values on a page.
_UNIT = r"(?<=\S )\[[^\[\]\s=]+\](?=$|[ ,;])"
_VALUE = r"^  \S+ = [−\d.,e+\-…]+ ([^\s=]\S*)(?=  |$)"
_SUCCESS = r"completed|stopped-by-event"
_STATUS = rf"^(?:\S+: )?(?:({_SUCCESS})|failed|interrupted)(?=[,:])|^ *failed(?=  )"
_PROBLEM = r"^(?:\S.*?: )? *(error|warning|interrupted)(?:\[[\w-]+\])?(?=:|$)"
_EXCERPT = r" *\d* \| "


def print_listing(
    text: str,
    column: int | None = None,
    stream: TextIO | None = None,
    plain: bool = False,
    lost: bool = False,
) -> None:
    """Print a listing: labels in front of a column, tables after an empty line.

    Parameters
    ----------
    text : str
    column : int, optional
        Columns in front of the text of labels. By default the text is that of an analysis: a
        heading, and lines, of which a narrower terminal wraps those that are not laid out for it.
    stream : text stream, optional
        Standard output by default.
    plain : bool
        Whether styles are disabled.
    lost : bool
        Whether the loss of the text is acceptable, because a file has the same.
    """
    stream = stream or sys.stdout
    if column is None and stream.isatty():
        text = fitted(text, text_width(stream))
    if has_colour(stream, plain):
        lines = text.split("\n")
        spans = list(_of_lines(lines, column) if column else _of_analysis(lines))
        _write(lines, spans, stream)
    elif lost and stream is sys.stdout:
        tell(text)
    else:
        print(text, file=stream)


def print_page(text: str) -> None:
    """Print a page with headings at the left margin."""
    if not has_colour(sys.stdout):
        sys.stdout.write(text)
        return
    lines = text.removesuffix("\n").split("\n")
    _write(lines, [list(_of_page(line)) for line in lines], sys.stdout)


def print_problem(text: str) -> None:
    """Print an error or a warning on standard error, wrapped between words on a terminal."""
    stream = sys.stderr
    if not stream.isatty():
        print(text, file=stream)
        return
    lines = _wrapped_problem(text.split("\n"), text_width(stream))
    spans = [list(_of_problem(line)) if has_colour(stream) else [] for line in lines]
    _write(lines, spans, stream)


def _of_analysis(lines: list[str]) -> Iterator[list[StyledSpan]]:
    """Yield the spans of each line of an analysis: its heading, which may be wrapped, and units."""
    heading = True
    for i, line in enumerate(lines):
        heading = heading and (i == 0 or line.startswith("    "))
        yield [_bold(line)] if heading else _units(line)


def _of_lines(lines: list[str], column: int) -> Iterator[list[StyledSpan]]:
    """Yield the spans of each line of a listing with labels in front of a column."""
    before, tables = "-", False
    for line in lines:
        if not before:
            tables = True
            yield [_bold(line)]
        elif tables:
            yield _units(line)
        else:
            yield _of_listing(line, column)
        before = line


def _of_listing(line: str, column: int) -> list[StyledSpan]:
    """Return the spans of a line above the tables of a listing."""
    status = re.search(_STATUS, line)
    if status:
        words = status[0].rsplit(": ", 1)[-1]
        start = status.end() - len(words.lstrip())
        return [StyledSpan(start, status.end(), Style.GREEN if status[1] else Style.RED)]
    label, text = line[:column], line[column:]
    margin = len(line) - len(line.lstrip())
    if margin > 2 or not label.strip():
        return _units(line)
    if (text[:1].strip() and label[-1] == " ") or (not text and "  " not in label.strip()):
        return [StyledSpan(margin, len(label.rstrip()), Style.BOLD), *_units(line)]
    return _units(line)


def _bold(line: str) -> StyledSpan:
    return StyledSpan(len(line) - len(line.lstrip()), len(line), Style.BOLD)


def _units(line: str) -> list[StyledSpan]:
    return [StyledSpan(*x.span(), Style.DIM) for x in re.finditer(_UNIT, line)]


def _of_page(line: str) -> Iterator[StyledSpan]:
    if line[:1].strip():
        yield _bold(line)
        return
    yield from (unit for unit in _units(line) if unit.end == len(line))
    if value := re.match(_VALUE, line):
        yield StyledSpan(*value.span(1), Style.DIM)


def _of_problem(line: str) -> Iterator[StyledSpan]:
    if found := re.match(_PROBLEM, line):
        yield StyledSpan(
            found.start(1), found.end(), Style.BOLD if found[1] == "warning" else Style.RED
        )


def _wrapped_problem(lines: list[str], width: int) -> list[str]:
    """Return the lines of a message, wrapped; of a line of a file, the part around the marks."""
    from lagcli.prose import wrapped

    shown, start = list[str](), 0  # the first character shown of an excerpt
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if excerpt := re.match(_EXCERPT, line):
            front = excerpt.end()
            if line[:front].strip() != "|":  # the marks are on the line below
                longest = max(len(line), len(below))
                centred = below.find("^") - (width - front) // 2
                start = max(front, min(centred, longest - width + front))
            shown.append(line[:front] + line[start : start + width - front].rstrip())
        elif len(line) <= width:
            shown.append(line)
        else:
            margin = " " * (len(line) - len(line.lstrip()))
            following = " " * 9 if margin else " " * 3
            shown += wrapped(line.strip(), width, margin, following)
    return shown


def _write(lines: list[str], spans: list[list[StyledSpan]], stream: TextIO) -> None:
    """Write lines with their spans; escape sequences in the text itself are shown."""
    parts = list[str]()
    for line, styles in zip(lines, spans, strict=True):
        end = 0
        for span in sorted(styles):
            parts += [visible(line[end : span.start]), f"\x1b[{span.style}m"]
            parts += [visible(line[span.start : span.end]), "\x1b[0m"]
            end = span.end
        parts += [visible(line[end:]), "\n"]
    text = "".join(parts)
    buffer = getattr(stream, "buffer", None)
    if buffer is None:
        stream.write(text)
        return
    stream.flush()
    buffer.write(text.encode(stream.encoding, stream.errors or "strict"))
    buffer.flush()
