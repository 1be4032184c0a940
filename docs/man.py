"""The manual page, from the help of the commands.

``python docs/man.py`` writes it; ``man docs/lagcli.1`` shows it.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lagcli.cli.app import COMMANDS, program

PAGE = Path(__file__).with_name("lagcli.1")

_END = """\
.SH FILES
Model files are YAML; \\fBlagcli new\\fR writes one with comments. Results are HDF5 or CSV files.
.SH ENVIRONMENT
.TP
.B NO_COLOR
No colours on the terminal.
.TP
.B LAGCLI_NATIVE
0: interpret equations; do not translate them to machine code. The results are the same.
"""


def manual() -> str:
    """Return the manual page in the macros of man(7)."""
    app = program()
    context = app.make_context("lagcli", [COMMANDS[0]], resilient_parsing=True)
    lines = ['.TH LAGCLI 1 "" "lagcli" "User Commands"', ".SH NAME"]
    lines += [f"lagcli \\- {_text(_sentence(app.help))}", ".SH SYNOPSIS"]
    lines += [
        ".B lagcli",
        "COMMAND [OPTIONS] [ARGUMENTS]",
        ".SH OPTIONS",
        *_parameters(app, context),
    ]
    lines += [".SH COMMANDS"]
    for name in COMMANDS:
        lines += _command(name, app.get_command(context, name), context)
    lines += [".SH EXIT STATUS", *_statuses(app.epilog)]
    return "\n".join(lines) + "\n" + _END


def _command(name: str, entry: Any, above: Any) -> Iterator[str]:
    context = entry.make_context(name, [], parent=above, resilient_parsing=True)
    usage = " ".join(piece.strip("{}") for piece in entry.collect_usage_pieces(context))
    yield f".SS lagcli {_text(name)} {_text(usage)}"
    for number, paragraph in enumerate(entry.help.split("\n\n")):
        if number:
            yield ".PP"
        yield _text(" ".join(paragraph.split()))
    yield from _parameters(entry, context)


def _parameters(entry: Any, context: Any) -> Iterator[str]:
    for parameter in entry.params:
        name, text = parameter.get_help_record(context)
        yield ".TP"
        yield f".B {_text(name)}"
        yield _text(" ".join(text.split()))


def _statuses(epilog: str) -> Iterator[str]:
    for status in epilog.removeprefix("Exit status: ").rstrip(".").split("; "):
        number, _, meaning = status.partition(" ")
        yield from (".TP", f".B {number}", _text(meaning))


def _sentence(text: str) -> str:
    return text.rstrip(".")


def _text(text: str) -> str:
    """Return text with what the macros would read as commands escaped."""
    escaped = (
        text.replace("\\", "\\e").replace("-", "\\-").replace("'", "\\(aq").replace("`", "\\`")
    )
    return f"\\&{escaped}" if escaped.startswith((".", "'")) else escaped


if __name__ == "__main__":
    PAGE.write_text(manual(), encoding="utf-8")
