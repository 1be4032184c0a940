"""`lagcli equilibrium`: equilibria and steady motions."""

from typing import Annotated

import typer

from lagcli.cli.operating_point import check_target, load_along, load_steady, print_analysis
from lagcli.cli.options import Force, Json, ModelPath, PresetName, Quiet, SetInitial, SetParameter
from lagcli.errors import UsageError


def equilibrium(
    model: ModelPath,
    all: Annotated[
        bool, typer.Option("--all", help="Search for all equilibria, from many starts.")
    ] = False,
    starts: Annotated[
        int, typer.Option("--starts", metavar="N", help="Starts for --all.", min=1)
    ] = 64,
    steady: Annotated[
        list[str] | None,
        typer.Option(
            "--steady",
            metavar="NAME[=VALUE]",
            help='Find steady motions with this velocity, e.g. "phi\'=10", rate of a symmetry that'
            ' lagcli check finds, "rate(J_1)=10", its momentum, "J_1=3", or expression,'
            ' "omega(e).z=10". A velocity or rate without a value is looked for. Repeatable.',
        ),
    ] = None,
    along: Annotated[
        str | None,
        typer.Option(
            "--along",
            metavar="NAME=START:END",
            help="Follow the equilibrium as a parameter varies, e.g. P=0:3, or a value of steady"
            ' motions, e.g. "phi\'=1:10"; with folds, branch points, Hopf points, and changes'
            " of stability and contacts.",
        ),
    ] = None,
    branches: Annotated[
        bool,
        typer.Option(
            "--branches", help="With --along: also follow branches that cross, in both directions."
        ),
    ] = False,
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Output file, .json or .h5; lagcli plot draws the branches of a .h5 file.",
        ),
    ] = None,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    preset: PresetName = None,
    json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Find equilibria and steady motions with their stability.

    Finds one equilibrium from the initial values; with --all as many as possible; with --along
    branches as a parameter varies. Shows multipliers, constraint forces and closed contacts.
    """
    from lagcli.analysis.equilibria.description import (
        describe_diagram,
        describe_equilibria,
        diagram_arrays,
        format_diagram,
        format_equilibria,
    )
    from lagcli.analysis.equilibria.diagram import follow_equilibria
    from lagcli.analysis.equilibria.equilibrium import equilibrium as find
    from lagcli.analysis.output.files import ANALYSIS_SUFFIXES, write_content

    if along is not None and all:
        raise UsageError("--along follows one equilibrium, --all looks for many; choose one")
    if branches and along is None:
        raise UsageError("--branches needs --along, as in --along P=0:3 --branches")
    check_target(model, output, ANALYSIS_SUFFIXES, force)
    loaded, held = load_steady(model, set, set_initial, steady, preset)
    arrays, note = {}, ""
    if along is None:
        content = describe_equilibria(find(loaded, steady=held, all=all, starts=starts))
        format = format_equilibria
    else:
        loaded, name, start, end = load_along(loaded, along)
        diagram = follow_equilibria(loaded, name, start, end, steady=held, branches=branches)
        content, arrays = describe_diagram(diagram), diagram_arrays(diagram)
        format = format_diagram
        if not branches and any(x.kind == "branch point" for x in diagram.special):
            note = "\n  note: other branches cross at branch points; --branches follows them"
    if output is not None:
        write_content(content, arrays, loaded, output, force)
    print_analysis(content, lambda: format(content) + note, output, json, quiet)
