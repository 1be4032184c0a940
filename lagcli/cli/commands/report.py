"""`lagcli report`: report of a run or an analysis on one HTML page."""

from typing import Annotated

from lagcli.cli.options import Force, Quiet, ResultFile, ViewModel
from lagcli.cli.parameters import Option
from lagcli.cli.streams import print_notes, tell


def report(
    file: ResultFile,
    output: Annotated[
        str,
        Option(
            "--output", "-o", metavar="FILE", help="Page to write, .html; .pdf of a run, by LaTeX."
        ),
    ],
    title: Annotated[str | None, Option(help="Title, instead of the model's name.")] = None,
    model: ViewModel = None,
    modes: Annotated[
        str | None,
        Option(
            metavar="ABOUT",
            help="Of a run: add the modes of its model about its start, the equilibrium next to it,"
            " or its state at a time: --modes start, equilibrium or 1.5.",
        ),
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a report of a run or an analysis.

    The report is one self-contained HTML file. It can be opened without a network, sent, or
    printed. With an installed LaTeX, -o run.pdf writes a run's equations and plots as PDF. A failed
    run is shown up to its last sample and marked. Files of sweep, equilibrium, linearize, modes,
    compare and fit have a report of their results.
    """
    from lagcli.pictures.report import report as make

    made = make(file, output, title=title, model=model, modes=modes, force=force)
    print_notes(made.notes)
    if not quiet:
        tell(made.summary)
