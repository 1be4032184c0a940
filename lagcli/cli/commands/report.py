"""`lagcli report`: report of a run or an analysis on one HTML page."""

from typing import Annotated

import typer

from lagcli.cli.options import Force, Quiet, ResultFile, ViewModel
from lagcli.cli.streams import print_notes, tell
from lagcli.pictures.languages import Language


def report(
    file: ResultFile,
    output: Annotated[
        str,
        typer.Option(
            "--output", "-o", metavar="FILE", help="Page to write, .html; .pdf of a run, by LaTeX."
        ),
    ],
    title: Annotated[str | None, typer.Option(help="Title, instead of the model's name.")] = None,
    model: ViewModel = None,
    modes: Annotated[
        str | None,
        typer.Option(
            metavar="ABOUT",
            help="Of a run: add the modes of its model about its start, the equilibrium next to it,"
            " or its state at a time: --modes start, equilibrium or 1.5.",
        ),
    ] = None,
    live: Annotated[
        bool,
        typer.Option(
            "--live",
            help="Of a run: write a page that simulates its model, with its values, instead.",
        ),
    ] = False,
    lang: Annotated[
        Language, typer.Option("--lang", help="Language of the words of the page.")
    ] = Language.en,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a report of a run or an analysis.

    The report is one self-contained HTML file. It can be opened without a network, sent, or
    printed. With an installed LaTeX, -o run.pdf writes a run's equations and plots as PDF. A failed
    run is shown up to its last sample and marked. With --live, the page simulates the run's model
    in the browser, as that of `lagcli export -o page.html`. Files of sweep, equilibrium, linearize,
    modes, compare and fit have a report of their results.
    """
    if live:
        _check_live(output, title, modes)
        from lagcli.live.page import live_page_of_run
        from lagcli.pictures.run_file import RunFile
        from lagcli.results.atomic import check_writable, whole_file

        check_writable(output, force)
        page = live_page_of_run(RunFile(file, model), lang.value).encode()
        with whole_file(output, force) as target:
            target.write(page)
        if not quiet:
            tell(f"{output}: {len(page) / 1000:.0f} kB")
        return
    from lagcli.pictures.report import report as make

    made = make(file, output, title=title, model=model, modes=modes, lang=lang.value, force=force)
    print_notes(made.notes)
    if not quiet:
        tell(made.summary)


def _check_live(output: str, title: str | None, modes: str | None) -> None:
    """Refuse options that do not go together."""
    from lagcli.errors import UsageError

    if title is not None or modes is not None:
        raise UsageError("--title and --modes are for reports; a page that simulates has neither")
    if not output.lower().endswith((".html", ".htm")):
        raise UsageError(f"{output}: a page that simulates ends in .html")
