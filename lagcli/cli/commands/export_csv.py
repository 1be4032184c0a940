"""`lagcli export-csv`: the table of a sweep file."""

from typing import Annotated

from lagcli.cli.options import Force
from lagcli.cli.parameters import Argument, Option


def export_csv(
    file: Annotated[str, Argument(metavar="SWEEP.h5", help="Sweep file.")],
    output: Annotated[str, Option("--output", "-o", metavar="FILE", help="CSV file to write.")],
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
