"""`lagcli modes`: frequencies, damping and shapes of small motions."""

from typing import Annotated

import typer

from lagcli.cli.operating_point import (
    At,
    Equilibrium,
    Steady,
    check_target,
    load_steady,
    print_analysis,
)
from lagcli.cli.options import Force, Json, ModelPath, PresetName, Quiet, SetInitial, SetParameter


def modes(
    model: ModelPath,
    at: At = None,
    equilibrium: Equilibrium = False,
    steady: Steady = None,
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Output file, .json, or .h5 for lagcli plot, animate, report and info.",
        ),
    ] = None,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    preset: PresetName = None,
    json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Find frequencies, damping ratios and shapes of small motions.

    The motions are about the initial state, or about the state that --equilibrium, --steady or
    --at choose; shapes are δq and δλ.
    """
    from lagcli.analysis.linear.description import describe_modes, format_modes, write_modes
    from lagcli.analysis.linear.modes import modes as find_modes
    from lagcli.analysis.output.files import ANALYSIS_SUFFIXES

    check_target(model, output, ANALYSIS_SUFFIXES, force)
    loaded, held = load_steady(model, set, set_initial, steady, preset)
    analysis = find_modes(loaded, at=at, equilibrium=equilibrium, steady=held)
    if output is not None:
        write_modes(analysis, output, force)
    content = describe_modes(analysis)
    print_analysis(content, lambda: format_modes(content), output, json, quiet)
