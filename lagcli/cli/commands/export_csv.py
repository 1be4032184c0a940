"""`lagcli export-csv`: the table of a sweep file."""

from typing import Annotated

import typer

from lagcli.cli import completion
from lagcli.cli.options import Force


def export_csv(
    file: Annotated[
        str,
        typer.Argument(metavar="SWEEP.h5", autocompletion=completion.results, help="Sweep file."),
    ],
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="FILE", help="CSV file to write.")
    ],
    force: Force = False,
) -> None:
    """Write the table of a sweep file as CSV.

    It has the varied values, the measures and the status of each row.
    """
    from lagcli.errors import UsageError
    from lagcli.results.formats import format_of
    from lagcli.sweeps.file.store import export_csv as export

    if format_of(output).name != "csv":
        raise UsageError(f"{output} is not a CSV file; name it with .csv")
    export(file, output, force)
