"""`lagcli plot`: draw the curves of runs."""

from typing import Annotated, Any

import typer

from lagcli.cli.options import Force
from lagcli.cli.streams import print_notes
from lagcli.errors import UsageError
from lagcli.results.formats import MODEL_SUFFIXES, SUFFIX_NAMES, SUFFIXES


def plot(
    arguments: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE… [NAME…]",
            help=f"Result files ({SUFFIX_NAMES}), and what to plot of them: phi, phi_dot,"
            " lambda.guide, Qc.guide.phi, energy_total, outputs, 'x[*]'; a:b is b over a; a,b"
            " share a panel. [default: coordinates, λ and energies]",
        ),
    ],
    output: Annotated[
        str,
        typer.Option("--output", "-o", metavar="FILE", help="The picture: .png, .svg or .pdf."),
    ],
    title: Annotated[
        str | None, typer.Option(help="In place of the model's name; '' for none.")
    ] = None,
    size: Annotated[
        str | None, typer.Option(metavar="WxH", help="Width and height in inches, as 7x4.")
    ] = None,
    dpi: Annotated[float, typer.Option(help="Dots per inch of a png.")] = 150,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="MODEL", help="Model file in place of the text in the result; CSV has none."
        ),
    ] = None,
    band: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=SPREAD",
            help="Draw bands: how far a spread of a parameter, l=0.01 or l=5%, moves the curves of"
            " a run that was simulated with --sensitivity. Repeatable.",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Plot time histories and phase portraits of results, and measures of a sweep.

    Several results are drawn over each other and labelled by the parameters that differ. Of a
    sweep: peak over what was varied, m:peak over m, m:l:peak as a map; tornado:peak shows what
    drives it; phi of all its rows. Of a fit: data, fitted curves and residuals.
    """
    from lagcli.pictures.plots.figure_file import size_of
    from lagcli.pictures.plots.plot import plot as draw

    suffixes = (*SUFFIXES, *MODEL_SUFFIXES)  # a model file gets its own error
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
