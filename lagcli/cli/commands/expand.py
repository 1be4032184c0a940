"""`lagcli expand`: a model file with its bodies and joints expanded."""

import sys
from typing import Annotated

import typer

from lagcli.cli import completion
from lagcli.cli.options import Force, Output, Quiet


def expand(
    model: Annotated[
        str,
        typer.Argument(
            metavar="MODEL", autocompletion=completion.model_files, help="Model file with bodies."
        ),
    ],
    output: Output = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Replace bodies and joints by coordinates and constraints.

    Prints a model file that loads, with the same equations and the same start. Comments are not
    kept.
    """
    from lagcli.cli.streams import visible
    from lagcli.model.loader import expand_text
    from lagcli.model.reading import read_text
    from lagcli.results.atomic import whole_file

    text = expand_text(*read_text(model))
    if output in (None, "-"):
        sys.stdout.write(visible(text))
        return
    with whole_file(output, force) as file:
        file.write(text.encode())
    if not quiet:
        print(f"written: {output}", file=sys.stderr)
