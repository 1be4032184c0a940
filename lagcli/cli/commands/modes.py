"""`lagcli modes`: frequencies, damping and shapes of small motions."""

from typing import Annotated

import typer

from lagcli.cli.operating_point import At, Equilibrium, Steady, load_steady
from lagcli.cli.options import (
    Force,
    Json,
    ModelPath,
    Quiet,
    SetInitial,
    SetParameter,
    refuse_same_file,
)
from lagcli.cli.streams import print_text, tell


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
            help="Write them: .json or .h5, which lagcli plot and info read.",
        ),
    ] = None,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Find the modes of small motions: frequencies, damping ratios, shapes δq and δλ.

    About the start, or about the point that --equilibrium, --steady or --at choose.
    """
    from lagcli.analysis.files import check_analysis_target
    from lagcli.analysis.linear.description import describe_modes, format_modes
    from lagcli.analysis.linear.files import MODES_SUFFIXES, write_modes
    from lagcli.analysis.linear.modes import modes as find_modes
    from lagcli.cli.summary import to_json

    refuse_same_file(model, output)
    if output is not None:
        check_analysis_target(output, MODES_SUFFIXES, force)
    loaded, held = load_steady(model, set, set_initial, steady)
    found = find_modes(loaded, at=at, equilibrium=equilibrium, steady=held)
    if output is not None:
        write_modes(found, loaded, output, force)
    content = describe_modes(found)
    if json:
        print(to_json(content))
    elif output is None:
        print_text(format_modes(content))
    elif not quiet:
        tell(f"{format_modes(content)}\n  written  {output}")
