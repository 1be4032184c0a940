"""`lagcli info`: describe a result or sweep file."""

from typing import Annotated, Any

import typer

from lagcli.cli import completion
from lagcli.cli.options import Json
from lagcli.errors import UsageError
from lagcli.results.formats import SUFFIX_NAMES


def info(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            autocompletion=completion.results,
            help=f"Result file, {SUFFIX_NAMES}, sweep file, or .h5 of an analysis.",
        ),
    ],
    quantiles: Annotated[
        bool,
        typer.Option(
            "--quantiles", help="Also print the quantiles of the columns of a sweep file."
        ),
    ] = False,
    json: Json = False,
) -> None:
    """Describe a result file: status, residuals, λ, provenance."""
    from lagcli.cli.styles import print_listing

    description, text, column = _described(file, quantiles)
    if json:
        from lagcli.cli.summary import to_json

        print(to_json(description))
    else:
        print_listing(text, column)


def _described(file: str, quantiles: bool) -> tuple[dict[str, Any], str, int | None]:
    """Return the content of a file, its text, and the columns of the text's labels."""
    from lagcli.cli.streams import text_width
    from lagcli.results.formats import kind_of
    from lagcli.results.metadata import KIND

    kind = kind_of(file)
    if kind == "sweep":
        from lagcli.sweeps.file.description import LABEL, describe_sweep, format_sweep

        content = describe_sweep(file, quantiles=quantiles)
        return content, format_sweep(content, text_width()), LABEL
    if quantiles:
        raise UsageError(f"--quantiles is for sweep files, which have many rows; {file} is none")
    if kind != KIND:
        return *_analysis(file), None
    from lagcli.results.info import LABEL, describe, format_info

    content = describe(file)
    return content, format_info(content, text_width()), LABEL


def _analysis(file: str) -> tuple[dict[str, Any], str]:
    """Return the content of an analysis file, and its text."""
    from lagcli.analysis.contents import format_content
    from lagcli.cli.operating_point import formatted
    from lagcli.results.hdf5.analysis_file import read_analysis

    content = read_analysis(file)
    if content["command"] == "fit":
        from lagcli.analysis.fit.file import read_fit
        from lagcli.analysis.fit.result import format_fit

        return content, formatted(lambda: format_fit(read_fit(file)))
    return content, formatted(lambda: format_content(content))
