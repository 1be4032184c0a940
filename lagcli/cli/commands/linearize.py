"""`lagcli linearize`: the linear model of small motions."""

from typing import Annotated, Literal

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
            "--file", "-o", metavar="FILE", help="Output file: .json, .npz, .mat (MATLAB) or .h5."
        ),
    ] = None,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    preset: PresetName = None,
    json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Linearize the equations on the constraint manifold.

    Gives A, B, C and D about the initial state, or about the state that --equilibrium, --steady or
    --at choose.
    """
    from lagcli.analysis.linear.description import (
        LINEAR_SUFFIXES,
        describe_linear,
        format_linear,
        write_linear,
    )
    from lagcli.analysis.linear.linear_model import linearize as linear_model

    check_target(model, file, LINEAR_SUFFIXES, force)
    loaded, held = load_steady(model, set, set_initial, steady, preset)
    linear = linear_model(
        loaded,
        at=at,
        equilibrium=equilibrium,
        steady=held,
        form=form,
        inputs=input or (),
        outputs=output or (),
    )
    if file is not None:
        write_linear(linear, file, force)
    content = describe_linear(linear)
    print_analysis(content, lambda: format_linear(content), file, json, quiet)
