"""`lagcli check`: analysis of a model at its initial state."""

from typing import Annotated

import typer

from lagcli.cli.options import Json, ModelPath, PresetName, SetInitial, SetParameter, assignments


def check(
    model: ModelPath,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    preset: PresetName = None,
    width: Annotated[
        int | None,
        typer.Option(
            "--width",
            min=40,
            max=1000,
            help="Columns of text. [default: 80, or those of a narrower terminal]",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Check a model: freedom, conserved quantities, units.

    Shows the constraints with their kinds and virtual displacements, the rank of their Jacobian at
    the start and nearby, redundant constraints and which multipliers are unique, whether velocity
    constraints are integrable, conserved quantities with their proofs, adjusted initial
    values, time scales, and units.
    """
    from lagcli.analysis.check.check import check as check_model
    from lagcli.model.loader import load

    loaded = load(
        model,
        set=assignments("--set", set),
        set_initial=assignments("--set-initial", set_initial),
        preset=preset,
    )
    result = check_model(loaded)
    if json:
        from lagcli.analysis.check.description import to_mapping
        from lagcli.cli.summary import to_json

        print(to_json(to_mapping(result)))
        return
    from lagcli.analysis.check.description import page
    from lagcli.cli.streams import text_width
    from lagcli.cli.styles import print_page

    print_page(page(result, width or min(80, text_width())))
