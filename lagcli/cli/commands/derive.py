"""`lagcli derive`: print the equations."""

import shutil
import sys
from enum import StrEnum
from typing import Annotated

import typer

from lagcli.cli.options import (
    Force,
    ModelPath,
    Output,
    Quiet,
    SetParameter,
    assignments,
    refuse_same_file,
)
from lagcli.cli.streams import visible_json


class Format(StrEnum):
    """How equations are printed."""

    text = "text"
    latex = "latex"
    markdown = "markdown"
    json = "json"


def derive(
    model: ModelPath,
    format: Annotated[Format, typer.Option("--format", "-f", help="How to print.")] = Format.text,
    steps: Annotated[
        bool, typer.Option("--steps", help="Show the derivation, the textbook's way.")
    ] = False,
    numeric: Annotated[
        bool, typer.Option("--numeric", help="Put in the values of the parameters.")
    ] = False,
    fragment: Annotated[
        bool, typer.Option("--fragment", help="LaTeX without preamble, to be included.")
    ] = False,
    full: Annotated[
        bool,
        typer.Option(
            "--full", help="Write everything out: of a large model thousands of lines, in minutes."
        ),
    ] = False,
    width: Annotated[
        int | None,
        typer.Option(
            "--width",
            min=40,
            max=1000,
            help="Columns of text. [default: the terminal's, 80 to 120]",
        ),
    ] = None,
    set: SetParameter = None,
    output: Output = None,
    force: Force = False,
    json: Annotated[bool, typer.Option("--json", help="The same as --format json.")] = False,
    quiet: Quiet = False,
) -> None:
    """Derive Lagrange's equations of the first kind and print them.

    Shows the coordinates, the constraints with their kinds and virtual displacements, the degrees
    of freedom, and the equations with Σ λ b on the right.
    """
    from lagcli.equations.derivation.lagrange import derive as derive_equations
    from lagcli.equations.render import render
    from lagcli.equations.render.names import invalid_latex_warnings
    from lagcli.model.loader import load
    from lagcli.results.atomic import check_writable, whole_file
    from lagcli.simulations.start import degrees_of_freedom

    refuse_same_file(model, output)
    target = None if output in (None, "-") else output
    if target is not None:
        check_writable(target, force)
    loaded = load(model, set=assignments("--set", set))
    if not quiet:
        for warning in invalid_latex_warnings(loaded):
            print(warning.render(), file=sys.stderr)
    equations = derive_equations(loaded)
    text = render(
        equations,
        format="json" if json else format.value,
        steps=steps,
        numeric=numeric,
        width=width or _terminal_width(),
        fragment=fragment,
        freedom=degrees_of_freedom(equations),
        full=full,
    )
    if not text.endswith("\n"):
        text += "\n"
    if target is None:
        sys.stdout.write(visible_json(text) if json or format == Format.json else text)
        return
    with whole_file(target, force) as file:
        file.write(text.encode())
    if not quiet:
        print(f"written: {target}", file=sys.stderr)


def _terminal_width() -> int:
    if not sys.stdout.isatty():
        return 100
    return min(120, max(80, shutil.get_terminal_size().columns))
