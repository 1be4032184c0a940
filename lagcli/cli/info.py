"""`lagcli info`: say what a result file holds."""

from typing import Annotated

import typer

from lagcli.cli.options import Json


def info(
    file: Annotated[str, typer.Argument(metavar="FILE", help="Result file, .h5 or .csv.")],
    json: Json = False,
) -> None:
    """Say what a result file holds: sizes, status, residuals, multipliers, provenance."""
    from lagcli.results.info import describe, format_info

    description = describe(file)
    if json:
        from lagcli.cli.summary import to_json

        typer.echo(to_json(description))
    else:
        typer.echo(format_info(description))
