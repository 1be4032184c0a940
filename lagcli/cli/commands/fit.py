"""`lagcli fit`: fit parameters and initial values to measured data."""

import sys
from typing import Annotated, Literal

import typer

from lagcli.cli.options import (
    Force,
    Json,
    ModelPath,
    PresetName,
    Quiet,
    SetInitial,
    SetParameter,
    assignments,
    with_settings,
)
from lagcli.files import refuse_same_file
from lagcli.prose import counted
from lagcli.settings.settings import SettingsOverrides

FAILED_STATUS = 3


@with_settings(without=("sensitivity", "samples", "dt", "times", "t_end"))
def fit(
    model: ModelPath,
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FILE", help="Fit file, .h5 (HDF5)."),
    ] = None,
    starts: Annotated[
        int,
        typer.Option(help="Number of starting points; all but the first lie between the bounds."),
    ] = 1,
    ci: Annotated[
        Literal["wald", "profile"],
        typer.Option(
            help="Confidence intervals: from standard errors, or from profiles of chi-square."
        ),
    ] = "wald",
    level: Annotated[float, typer.Option(help="Confidence level of the intervals.")] = 0.95,
    write: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Write the model with the values found, .yaml."),
    ] = None,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    preset: PresetName = None,
    *,
    settings: SettingsOverrides,
    force: Force = False,
    quiet: Quiet = False,
    json: Json = False,
) -> int:
    """Fit parameters and initial values to measured data.

    The `fit` block of the model names the data, the measured quantities (coordinates, multipliers,
    outputs), and the quantities to fit.
    """
    from lagcli.analysis.fit.file import check_fit_target, check_written, write_fit, write_model
    from lagcli.analysis.fit.fit import fit as run_fit
    from lagcli.analysis.fit.result import format_fit
    from lagcli.cli.operating_point import formatted
    from lagcli.cli.styles import print_listing
    from lagcli.cli.summary import to_json
    from lagcli.model.loader import load
    from lagcli.results.atomic import check_writable

    if output is not None:
        check_fit_target(output)
        refuse_same_file(model, output)
        check_writable(output, force)
    loaded = load(
        model,
        set=assignments("--set", set),
        set_initial=assignments("--set-initial", set_initial),
        preset=preset,
    )
    if write is not None:
        refuse_same_file(model, write)
        check_written(write, force)
    show = not quiet and starts > 1 and sys.stderr.isatty()

    def progress(done: int, count: int) -> None:
        if show:
            print(
                f"\r{done} of {counted(count, 'search', 'searches')}",
                end="\n" * (done == count),
                file=sys.stderr,
            )

    result = run_fit(loaded, settings, starts=starts, ci=ci, level=level, progress=progress)
    if output is not None:
        write_fit(result, output, force)
    if write is not None:
        write_model(loaded, result, write, force)
    if json:
        described = result.as_dict()
        print(to_json({"command": "fit", **described, "output": output, "written": write}))
    elif not quiet:
        print_listing(formatted(lambda: format_fit(result)))
        for label, path in (("written", output), ("model", write)):
            if path:
                print(f"  {label:<12}{path}")
    for warning in result.warnings:
        print(f"{'warning' if result.converged else 'error'}: {warning}", file=sys.stderr)
    return 0 if result.converged else FAILED_STATUS
