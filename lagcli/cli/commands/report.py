"""`lagcli report`: a run on one page."""

import sys
from typing import Annotated

import typer

from lagcli.cli.options import Force, Quiet
from lagcli.cli.streams import tell
from lagcli.results.formats import SUFFIX_NAMES


def report(
    file: Annotated[str, typer.Argument(metavar="FILE", help=f"Result file, {SUFFIX_NAMES}.")],
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="FILE", help="Page to write, .html.")
    ],
    title: Annotated[str | None, typer.Option(help="Title, instead of the model's name.")] = None,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="MODEL",
            help="Model file whose view is used, instead of the text in the result.",
        ),
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a report of a run: equations, animation, plots, extremes, computation.

    The report is one self-contained HTML file. It can be opened without a network, sent, or
    printed. A failed run is shown up to its last sample and marked.
    """
    from lagcli.pictures.report import report as make

    made = make(file, output, title=title, model=model, force=force)
    for note in made.notes:
        print(f"note: {note}", file=sys.stderr)
    if not quiet:
        tell(made.summary)
