"""`lagcli plot`: draw the curves of runs."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from lagcli.cli.options import Force
from lagcli.errors import UsageError

_RESULTS = (".h5", ".hdf5", ".csv")


def plot(
    arguments: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE… [NAME…]",
            help="Result files (.h5, .csv), and what to plot of them: phi, phi_dot, lambda.guide,"
            " Qc.guide.phi, energy_total, outputs, 'x[*]'; a:b is b over a; a,b share a panel."
            " [default: coordinates, λ, energy balance and residuals]",
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
    force: Force = False,
) -> None:
    """Plot time histories and phase portraits of results, and measures of a sweep.

    Several results are drawn over each other and told apart by the parameters that differ. Of a
    sweep: peak over what was varied, m:peak over m, m:l:peak as a map; phi of all its rows.
    """
    from lagcli.pictures.figure_file import check_picture, size_of
    from lagcli.pictures.plot import plot as draw
    from lagcli.pictures.run_file import Run
    from lagcli.pictures.sweep_plot import Table, plot_table
    from lagcli.pictures.sweep_rows import Rows
    from lagcli.sweeps.store import is_sweep

    files = [a for a in arguments if a.lower().endswith(_RESULTS)]
    names = [a for a in arguments if not a.lower().endswith(_RESULTS)]
    if not files:
        raise UsageError(
            "there is no result file among the arguments: its name ends with .h5, .hdf5 or .csv;"
            " lagcli simulate writes one"
        )
    kind = check_picture(output, force)
    inches = size_of(size) if size is not None else None
    if any(Path(output).exists() and Path(output).samefile(file) for file in files):
        raise UsageError(f"{output} is a result itself; choose another name for the plot")
    options: dict[str, Any] = {"title": title, "size": inches, "dpi": dpi, "force": force}
    sweeps = [file for file in files if not file.lower().endswith(".csv") and is_sweep(file)]
    if not sweeps:
        draw([Run(file, model) for file in files], names, output, kind, **options)
        return
    if len(files) > 1:
        raise UsageError(f"{sweeps[0]} is a sweep, which is plotted alone")
    table = Table(sweeps[0])
    if not table.kept or (all(map(table.knows, names)) and (names or table.measures)):
        plot_table(table, names, output, kind, **options)
        return
    rows = Rows(sweeps[0], model)
    draw(rows.runs, names, output, kind, **options)
    if rows.good > len(rows.runs):
        print(f"note: {len(rows.runs)} of {rows.good} rows are drawn", file=sys.stderr)
