"""Arguments and options that several commands share."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from lagcli.errors import UsageError
from lagcli.results.formats import SUFFIX_NAMES

#: Exit statuses that do not belong to an exception.
BUG_STATUS, FAILED_STATUS, INTERRUPTED_STATUS = 1, 3, 130

ModelPath = Annotated[
    str,
    typer.Argument(
        metavar="MODEL",
        help="Model file (YAML), name of a shipped model, or - for standard input.",
    ),
]
SetParameter = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Set a parameter, e.g. m=2 or 'l=30 cm'. Repeatable.",
    ),
]
SetInitial = Annotated[
    list[str] | None,
    typer.Option(
        "--set-initial",
        metavar="NAME=VALUE",
        help="Set and fix an initial value, e.g. phi=0.3 or phi_dot=2; 'phi={guess: 0.3}' frees it."
        " Repeatable.",
    ),
]
ResultFile = Annotated[str, typer.Argument(metavar="FILE", help=f"Result file, {SUFFIX_NAMES}.")]
ViewModel = Annotated[
    str | None,
    typer.Option(
        "--model",
        metavar="MODEL",
        help="Model file whose view is used, instead of the text in the result.",
    ),
]
Output = Annotated[str | None, typer.Option("--output", "-o", metavar="FILE", help="Output file.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only results and errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]
NoColor = Annotated[bool, typer.Option("--no-color", help="Disable colours (as NO_COLOR does).")]


_EXAMPLES = {"--set-initial": "phi=0.3", "--steady": '"phi\'=10"'}


def assignments(option: str, items: Iterable[str] | None) -> dict[str, str]:
    """Split NAME=VALUE items.

    Raises
    ------
    UsageError
        An item has no ``=``, no name or no value, or a name occurs twice.
    """
    found: dict[str, str] = {}
    for item in items or ():
        name, equals, value = item.partition("=")
        name, value = name.strip(), value.strip()
        if not (equals and name and value):
            example = _EXAMPLES.get(option, "m=2")
            raise UsageError(
                f"{option} {item!r} is not of the form NAME=VALUE, as in {option} {example}"
            )
        if name in found:
            raise UsageError(
                f"{option} gives `{name}` twice: {found[name]} and {value}; keep one of them"
            )
        found[name] = value
    return found


def refuse_same_file(model: str, output: str | None) -> None:
    """Refuse to overwrite the model itself, even with --force."""
    if output and output != "-" and model != "-":
        try:
            same = Path(output).samefile(model)
        except OSError:  # one of them does not exist, or is not a valid path
            return
        if same:
            raise UsageError(f"{output} is the model itself; choose another name for the result")
