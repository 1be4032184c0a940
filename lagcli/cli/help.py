"""Help pages and usage lines, as plain text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from textwrap import TextWrapper

from lagcli.cli.parameters import HELP, Command, CommandParameter
from lagcli.cli.streams import terminal_columns

#: Smallest and largest width of pages, and the largest width of their first column.
_NARROWEST, _WIDEST, _FIRST_COLUMN = 50, 98, 30


def page(command: Command, commands: Sequence[Command] = (), epilog: str = "") -> str:
    """Return the help of a command, or of the program with its commands."""
    options = (*(p for p in command.parameters if p.flags), HELP)
    tables = {
        "Arguments": [described(p) for p in command.parameters if not p.flags],
        "Options": [described(p) for p in options],
        "Commands": [(c.name.split()[-1], c.summary) for c in commands],
    }
    parts = [usage(command), _text(command.help)]
    parts += ["\n".join((f"{title}:", *_table(rows))) for title, rows in tables.items() if rows]
    return "\n\n".join((*parts, *([_text(epilog)] if epilog else ())))


def misuse(command: Command, problem: str) -> str:
    """Return the message on a wrong command line."""
    return f"{usage(command)}\nTry '{command.name} --help' for help.\n\nError: {problem}"


def usage(command: Command) -> str:
    """Return the usage of a command."""
    start = f"Usage: {command.name} "
    width = _width()
    text = " ".join(usage_words(command))
    if width >= len(start) + 20:
        return _filled(text, width, start, " " * len(start))
    indent = " " * (len("Usage: ") + 4)
    return f"{start}\n{_filled(text, width, indent, indent)}"


def usage_words(command: Command) -> Iterator[str]:
    """Yield what follows a command's name in its usage."""
    yield "[OPTIONS]"
    if command.function is None:
        yield "COMMAND [ARGS]..."
    for p in command.parameters:
        if not p.flags:
            name = p.metavar or ""
            bracketed = f"{{{name}}}" if p.required else f"[{name}]"
            yield name if name.startswith("[") else bracketed


def described(parameter: CommandParameter) -> tuple[str, str]:
    """Return the flags of an option with its placeholder, or an argument's name; and the help."""
    short_first = sorted(parameter.flags, key=lambda flag: flag.startswith("--"))
    placeholder = parameter.metavar
    if placeholder is None and not parameter.is_switch:
        placeholder = f"<{'|'.join(parameter.choices) or parameter.type_name}>"
    default = parameter.default
    remarks = [] if default is None or default is False else [f"default: {default}"]
    remarks += [x for x in (parameter.range, "required" * parameter.required) if x]
    shown = " ".join(x for x in (", ".join(short_first), placeholder) if x)
    return shown, parameter.help + (f"  [{'; '.join(remarks)}]" if remarks else "")


def _table(rows: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Yield lines in two columns; a long entry of the first has its own line."""
    first = min(max(len(name) for name, _ in rows), _FIRST_COLUMN) + 2
    for name, help_ in rows:
        head, *others = _filled(help_, max(_width() - first - 2, 10)).split("\n")
        if len(name) <= first - 2:
            yield f"  {name:{first}}{head}"
        else:
            yield f"  {name}"
            yield f"  {'':{first}}{head}"
        yield from (f"  {'':{first}}{line}" for line in others)


def _text(text: str) -> str:
    """Return paragraphs, each wrapped and indented."""
    joined = (" ".join(paragraph.split("\n")) for paragraph in text.split("\n\n"))
    return "\n\n".join(_filled(paragraph, _width(), "  ", "  ") for paragraph in joined)


def _filled(text: str, width: int, first: str = "", following: str = "") -> str:
    wrapper = TextWrapper(
        width, initial_indent=first, subsequent_indent=following, replace_whitespace=False
    )
    return wrapper.fill(text)


def _width() -> int:
    return max(min(terminal_columns() - 2, _WIDEST), _NARROWEST)
