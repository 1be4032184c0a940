"""`lagcli report`: a run on one page."""

import sys
from typing import Annotated

import typer

from lagcli.cli.options import Force, Quiet
from lagcli.cli.streams import tell
from lagcli.results.formats import SUFFIX_NAMES


def report(
    file: Annotated[str, typer.Argument(metavar="FILE", help=f"Result file, {SUFFIX_NAMES}.")],
    output: Annotated[str, typer.Option("--output", "-o", metavar="FILE", help="The page, .html.")],
    title: Annotated[str | None, typer.Option(help="In place of the model's name.")] = None,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="MODEL", help="Model file with the view, in place of the text in the result."
        ),
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Put a run on one page: equations, animation, plots, extremes, computation.

    The page is one file that fetches nothing, to be opened in a browser, sent, or printed. A run
    that failed is shown up to its last sample, and said to have failed.
    """
    from lagcli.pictures.report import report as make

    made = make(file, output, title=title, model=model, force=force)
    for note in made.notes:
        print(f"note: {note}", file=sys.stderr)
    if not quiet:
        tell(made.summary)
