"""`lagcli plot`: draw the curves of runs."""

from typing import Annotated, Any

import typer

from lagcli.cli import completion
from lagcli.cli.options import Force
from lagcli.cli.streams import print_notes
from lagcli.errors import UsageError
from lagcli.results.formats import MODEL_SUFFIXES, SUFFIX_NAMES, SUFFIXES


def plot(
    arguments: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE… [NAME…]",
            autocompletion=completion.results,
            help=f"Result files ({SUFFIX_NAMES}), and the quantities to plot: phi, phi_dot,"
            " lambda.guide, Qc.guide.phi, energy_total, outputs, 'x[*]'; a:b plots b over a; a,b"
            " share a panel. [default: coordinates, λ and energies]",
        ),
    ],
    output: Annotated[
        str,
        typer.Option("--output", "-o", metavar="FILE", help="Figure to write: .png, .svg or .pdf."),
    ],
    title: Annotated[
        str | None, typer.Option(help="Title, instead of the model's; '' for none.")
    ] = None,
    size: Annotated[
        str | None, typer.Option(metavar="WxH", help="Width and height in inches, such as 7x4.")
    ] = None,
    dpi: Annotated[float, typer.Option(help="Resolution of a .png in dots per inch.")] = 150,
    model: Annotated[
        str | None,
        typer.Option(
            "--model",
            metavar="MODEL",
            help="Model file, instead of the model stored in the result; CSV stores none.",
        ),
    ] = None,
    band: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=SPREAD",
            help="Draw the uncertainty bands that follow from the spread of a parameter, l=0.01 or"
            " l=5%, of a run simulated with --sensitivity; repeatable. For a sweep, the band that"
            " contains a part of the rows at each time: 90%.",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Plot results: time histories, phase portraits, measures.

    Several results share the axes, labelled by the parameters that differ. For a sweep, peak plots
    this measure over the varied quantities, m:peak over m, and m:l:peak as a map; tornado:peak
    compares the effects of the varied quantities; phi plots the coordinate for all rows. For a fit,
    the plot shows data, fitted curves and residuals.
    """
    from lagcli.pictures.plots.figure import size_of
    from lagcli.pictures.plots.plot import plot as draw

    suffixes = (*SUFFIXES, *MODEL_SUFFIXES)  # a model file has a separate error
    files = [a for a in arguments if a.lower().endswith(suffixes)]
    names = [a for a in arguments if not a.lower().endswith(suffixes)]
    if not files:
        raise UsageError(
            "there is no result file among the arguments: its name ends with"
            f" {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}; lagcli simulate writes one"
        )
    inches = size_of(size) if size is not None else None
    look: dict[str, Any] = {"title": title, "size": inches, "dpi": dpi}
    print_notes(draw(files, output, names, model=model, bands=band or (), force=force, **look))
