"""`lagcli report`: a run on one page."""

from typing import Annotated

import typer

from lagcli.cli.options import Force, Quiet, ResultFile, ViewModel
from lagcli.cli.streams import print_notes, tell


def report(
    file: ResultFile,
    output: Annotated[str, typer.Option("--output", "-o", metavar="FILE", help="The page, .html.")],
    title: Annotated[str | None, typer.Option(help="In place of the model's name.")] = None,
    model: ViewModel = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Put a run on one page: equations, animation, plots, extremes, computation.

    The page is one file that fetches nothing, to be opened in a browser, sent, or printed. A run
    that failed is shown up to its last sample, and said to have failed.
    """
    from lagcli.pictures.report import report as make

    made = make(file, output, title=title, model=model, force=force)
    print_notes(made.notes)
    if not quiet:
        tell(made.summary)
