"""`lagcli linearize`: the linear model of small motions."""

from typing import Annotated, Literal

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


def linearize(
    model: ModelPath,
    at: At = None,
    equilibrium: Equilibrium = False,
    steady: Steady = None,
    form: Annotated[
        Literal["reduced", "descriptor"],
        typer.Option(
            "--form",
            help="reduced: independent coordinates and velocities; descriptor: all coordinates,"
            " velocities and multipliers, with the constraints as equations.",
        ),
    ] = "reduced",
    input: Annotated[
        list[str] | None,
        typer.Option(
            "--input",
            metavar="NAME",
            help="An input: a parameter of the forces or of V, or Q.phi, a force on a coordinate."
            " Repeatable.",
        ),
    ] = None,
    output: Annotated[
        list[str] | None,
        typer.Option(
            "--output",
            metavar="NAME",
            help="An output: a column of results or output of the model, e.g. phi, phi_dot,"
            " lambda.guide. Repeatable.",
        ),
    ] = None,
    file: Annotated[
        str | None,
        typer.Option(
            "--file", "-o", metavar="FILE", help="Write it: .json, .npz, .mat (MATLAB) or .h5."
        ),
    ] = None,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Linearize the equations on the constraints' manifold: A, B, C, D.

    About the start, or about the point that --equilibrium, --steady or --at choose.
    """
    from lagcli.analysis.files import check_analysis_target
    from lagcli.analysis.linear.description import describe_linear, format_linear
    from lagcli.analysis.linear.files import LINEAR_SUFFIXES, write_linear
    from lagcli.analysis.linear.linear_model import linearize as linear_model
    from lagcli.cli.summary import to_json

    refuse_same_file(model, file)
    if file is not None:
        check_analysis_target(file, LINEAR_SUFFIXES, force)
    loaded, held = load_steady(model, set, set_initial, steady)
    found = linear_model(
        loaded,
        at=at,
        equilibrium=equilibrium,
        steady=held,
        form=form,
        inputs=input or (),
        outputs=output or (),
    )
    if file is not None:
        write_linear(found, loaded, file, force)
    content = describe_linear(found)
    if json:
        print(to_json(content))
    elif file is None:
        print_text(format_linear(content))
    elif not quiet:
        tell(f"{format_linear(content)}\n  {'written':<9}{file}")
