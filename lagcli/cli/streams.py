"""Standard streams: closed or full ones, escape sequences, line width."""

from __future__ import annotations

import codecs
import io
import os
import re
import shutil
import sys
import unicodedata
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, TextIO

from lagcli.errors import FileError

#: Width of text without a terminal, and smallest and largest width on a terminal.
WIDTH, NARROWEST, WIDEST = 100, 60, 120


#: Characters that a terminal interprets or hides: control characters, marks of text direction, line
#: separators, surrogates.
_UNSEEN = "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"


#: Matches the label of a line, with the spaces before its text.
_LABEL = r" *\S+(?: \S+)*? {2,}(?=\S)"
_ENTRY = r"  \S{11} (?=\S)"  # a label of the full width in a summary


def visible(text: str) -> str:
    r"""Return a text with invisible characters written as escapes such as ``\x1b``."""
    return re.sub(_UNSEEN, lambda match: match[0].encode("unicode_escape").decode(), text)


def visible_json(text: str) -> str:
    """Return JSON in which invisible characters are escaped in JSON's syntax."""
    return re.sub(_UNSEEN, lambda match: f"\\u{ord(match[0]):04x}", text)


class _Text(io.TextIOWrapper):
    def write(self, text: str) -> int:
        super().write(visible(text))
        return len(text)


class _Bytes(io.RawIOBase):
    """A raw stream by its file descriptor; `fail` handles errors."""

    def __init__(self, number: int, fail: Callable[[OSError], None]):
        self._file = io.FileIO(number, "w", closefd=False)
        self._fail = fail

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._file.fileno()

    def isatty(self) -> bool:
        return self._file.isatty()

    def write(self, data: Any) -> int:
        try:
            return self._file.write(data) or 0
        except BrokenPipeError:
            raise
        except OSError as error:
            self._fail(error)
            return len(data)


#: Error handler of codecs: a terminal without Greek letters shows their names.
_PLAIN = "lagcli-plain"


def set_up() -> None:
    """Make the standard streams usable, even if they are closed or full.

    A closed stream is opened to the null device, so that no other file gets its descriptor. Errors
    of standard error are ignored, because the exit status reports the same. Errors of standard
    output raise `FileError`.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # closed output remains output that fails: the null device is opened for reading
            os.open(os.devnull, os.O_WRONLY if number == 2 else os.O_RDONLY)
    codecs.register_error(_PLAIN, replacement)
    sys.stdout = _opened(1, sys.stdout, _refuse)
    sys.stderr = _opened(2, sys.stderr, lambda error: None)


def _opened(number: int, before: Any, fail: Callable[[OSError], None]) -> io.TextIOWrapper:
    stream = _Bytes(number, fail)
    return _Text(
        io.BufferedWriter(stream),
        encoding=getattr(before, "encoding", None) or "utf-8",
        errors=_PLAIN,
        line_buffering=number == 2 or stream.isatty(),
    )


def _refuse(error: OSError) -> None:
    # slow imports are avoided at start-up
    from lagcli.files import write_failure

    raise write_failure("standard output", error) from error


def tell(text: str) -> None:
    """Print text whose loss is acceptable, because a file or the exit status reports the same."""
    try:
        print(text)
        sys.stdout.flush()
    except (FileError, OSError):
        discard()


def print_notes(notes: Iterable[str]) -> None:
    """Print notes for the user on standard error."""
    for note in notes:
        print(f"note: {note}", file=sys.stderr)


def discard() -> None:
    """Redirect standard output to the null device, so that flushing cannot fail again."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def text_width(stream: TextIO | None = None) -> int:
    """Return the width of text on a stream: a terminal's within bounds, otherwise 100."""
    stream = stream or sys.stdout
    if not stream.isatty():
        return WIDTH
    return max(NARROWEST, min(WIDEST, shutil.get_terminal_size().columns))


def fitted(text: str, width: int) -> str:
    """Return text with lines that fit a terminal; numbers keep their names and units."""
    if max(map(len, text.split("\n"))) <= width:
        return text
    from lagcli.prose import wrapped

    lines: list[str] = []
    for line in text.split("\n"):
        if len(line) <= width:
            lines.append(line)
            continue
        margin = len(line) - len(line.lstrip())
        label = re.match(_LABEL, line) or re.match(_ENTRY, line)
        below = label.end() if label else margin + 4 * (margin < 8)
        if label is None or below > width // 2:
            lines += wrapped(line.strip(), width, " " * margin, " " * min(below, width // 3))
        else:
            lines += wrapped(line[below:], width, label[0], " " * below)
    return "\n".join(lines)


def has_colour(stream: TextIO, refused: bool = False) -> bool:
    """Whether text on a stream may be coloured: on a terminal, unless colours are disabled.

    The environment disables colours by NO_COLOR (no-color.org) or TERM=dumb.
    """
    if refused or os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return False
    return stream.isatty()


# output in encodings that lack the characters of formulas

_DIRECT = {
    "−": "-",
    "–": "-",
    "…": "...",
    "⋯": "...",
    "→": "->",
    "·": "*",
    "×": "*",
    "≤": "<=",
    "≥": ">=",
    "≠": "!=",
    "±": "+-",
    "∞": "inf",
    "∂": "d",
    "√": "sqrt",
    "⊥": "_|_",
    "°": " deg",
    "∠": " at ",
    "λ": "lambda",  # other names in Unicode
    "Λ": "Lambda",
    "\u0307": "'",
    "\u0308": "''",
    "’": "'",
    "“": "'",  # not a quote of JSON
    "”": "'",
}
_LIFTED = {"<super>": "^", "<sub>": "_"}
_MINUS = str.maketrans("−", "-")


def replacement(error: UnicodeError) -> tuple[str, int]:
    """Return ASCII text for characters that an encoding lacks; an error handler of codecs.

    ``½ m ẋ²`` becomes ``1/2 m x'^2``, and λ ``lambda``; characters without a replacement become
    ``?``.
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object
    characters = (_ascii(text, i) for i in range(error.start, error.end))
    return "".join(characters).encode(error.encoding, "replace").decode(error.encoding), error.end


def _ascii(text: str, at: int) -> str:
    char = text[at]
    if char in _DIRECT:
        return _DIRECT[char]
    kind, lifted, before = _lift(char), "", _lift(text[at - 1]) if at else ""
    if kind:
        lifted = "" if kind == before else _LIFTED[kind]
        return lifted + unicodedata.normalize("NFKD", char).translate(_MINUS)
    words = unicodedata.name(char, "").split()
    if words[:1] == ["GREEK"] and "LETTER" in words:
        name = words[words.index("LETTER") + 1].lower()
        dots = sum((2 if x == "\u0308" else 1) for x in unicodedata.normalize("NFD", char)[1:])
        return (name if "SMALL" in words else name.capitalize()) + "'" * dots
    parts = unicodedata.normalize("NFKD", char)
    if parts == char:
        return "" if unicodedata.combining(char) else "?"
    kept = (x for x in parts if x in _DIRECT or not unicodedata.combining(x))
    return "".join(_DIRECT.get(x, x) for x in kept).replace("⁄", "/")


def _lift(char: str) -> str:
    kind = unicodedata.decomposition(char).partition(" ")[0]
    return kind if kind in _LIFTED else ""
