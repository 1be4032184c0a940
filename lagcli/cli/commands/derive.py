"""`lagcli derive`: print the equations."""

import sys
from enum import StrEnum
from pathlib import PurePath
from typing import Annotated

import typer

from lagcli.cli.options import (
    Force,
    ModelPath,
    Output,
    Quiet,
    SetParameter,
    assignments,
)
from lagcli.cli.streams import text_width, visible_json
from lagcli.errors import LagcliError, UsageError
from lagcli.files import refuse_same_file


class Format(StrEnum):
    """How equations are printed."""

    text = "text"
    latex = "latex"
    markdown = "markdown"
    json = "json"
    pdf = "pdf"


_SUFFIXES = {
    ".txt": Format.text,
    ".tex": Format.latex,
    ".md": Format.markdown,
    ".markdown": Format.markdown,
    ".json": Format.json,
    ".pdf": Format.pdf,
}


def derive(
    model: ModelPath,
    format: Annotated[
        Format | None,
        typer.Option(
            "--format",
            "-f",
            help="Output format; pdf needs an installed LaTeX. [default: that of the output file's"
            " suffix, or text]",
        ),
    ] = None,
    steps: Annotated[
        bool, typer.Option("--steps", help="Show the derivation step by step, as in the textbook.")
    ] = False,
    kind: Annotated[
        str | None,
        typer.Option(
            "--kind",
            metavar="KINDS",
            help="first: with multipliers; second: in independent coordinates; maggi: projected on"
            " the null space of B. Several, separated by commas, are compared."
            " [default: first; with --steps also second, where it is short]",
        ),
    ] = None,
    independent: Annotated[
        str | None,
        typer.Option(
            "--independent",
            metavar="NAMES",
            help="Independent coordinates, separated by commas, for the kinds second and maggi."
            " [default: those with fixed initial values]",
        ),
    ] = None,
    solve: Annotated[
        bool,
        typer.Option("--solve", help="Solve for λ and q'' in closed form, where that is short."),
    ] = False,
    numeric: Annotated[
        bool, typer.Option("--numeric", help="Insert the values of the parameters.")
    ] = False,
    fragment: Annotated[
        bool,
        typer.Option("--fragment", help="LaTeX without preamble, for inclusion in a document."),
    ] = False,
    full: Annotated[
        bool,
        typer.Option(
            "--full", help="Write everything out; large models give thousands of lines, in minutes."
        ),
    ] = False,
    width: Annotated[
        int | None,
        typer.Option(
            "--width",
            min=40,
            max=1000,
            help="Columns of text. [default: the terminal's, 60 to 120]",
        ),
    ] = None,
    set: SetParameter = None,
    output: Output = None,
    force: Force = False,
    json: Annotated[bool, typer.Option("--json", help="The same as --format json.")] = False,
    quiet: Quiet = False,
) -> None:
    """Derive Lagrange's equations and print them.

    Shows the coordinates, the constraints with their kinds and virtual displacements, the degrees
    of freedom, and the equations of the first kind, with Σ λ b on the right. With --kind also
    those of the second kind and Maggi's equations.
    """
    from lagcli.equations.derivation.lagrange import derive as derive_equations
    from lagcli.equations.reduction.second_kind import second_kind_is_short
    from lagcli.equations.render import render
    from lagcli.equations.typesetting.notation import invalid_latex_warnings
    from lagcli.model.loader import load
    from lagcli.results.atomic import check_writable, whole_file
    from lagcli.simulations.partition import partition_of
    from lagcli.simulations.start import ModelStart

    refuse_same_file(model, output)
    target = None if output in (None, "-") else output
    chosen = _format(Format.json if json else format, target, json)
    if fragment and chosen != Format.latex:
        raise UsageError(f"--fragment is of LaTeX, and the format is {chosen}: -f latex")
    if chosen == Format.pdf:
        from lagcli.pictures.pdf import check_latex

        if target is None:
            raise UsageError("PDF is written to a file: -o equations.pdf")
        check_latex()
    if target is not None:
        check_writable(target, force)
    loaded = load(model, set=assignments("--set", set), drawn=False)
    if not quiet:
        ignored = [error._replace(severity="warning") for error in loaded.view_errors]
        for warning in [*ignored, *invalid_latex_warnings(loaded)]:
            print(warning.render(), file=sys.stderr)
    equations = derive_equations(loaded)
    start = ModelStart(equations)
    kinds = _kinds(kind or "first")
    names = _names(independent)
    divided = None
    if solve or names is not None or kinds != ["first"]:
        divided = partition_of(start, names)
    elif steps:
        try:
            divided = partition_of(start)
            if kind is None and second_kind_is_short(divided):
                kinds.append("second")
        except LagcliError as error:  # the first kind needs no independent coordinates
            if not quiet:
                print(_without_partition(error), file=sys.stderr)
    text = render(
        equations,
        format="latex" if chosen == Format.pdf else chosen.value,
        steps=steps,
        numeric=numeric,
        width=width or text_width(),
        fragment=fragment,
        freedom=start.freedom,
        full=full,
        kinds=kinds,
        partition=divided,
        solve=solve,
    )
    if not text.endswith("\n"):
        text += "\n"
    if target is None:
        if chosen != Format.text:
            sys.stdout.write(visible_json(text) if chosen == Format.json else text)
        else:
            from lagcli.cli.styles import print_page

            print_page(text)
        return
    content = text.encode()
    if chosen == Format.pdf:
        from lagcli.pictures.pdf import pdf_of

        content = pdf_of(text)
    with whole_file(target, force) as file:
        file.write(content)
    if not quiet:
        print(f"written: {target}", file=sys.stderr)


def _format(given: Format | None, target: str | None, json: bool) -> Format:
    """Return the format that is given, or that of a file name; they must not contradict."""
    suffix = PurePath(target).suffix.lower() if target is not None else ""
    named = _SUFFIXES.get(suffix)
    if given is None:
        if suffix and named is None:
            known = ", ".join(_SUFFIXES)
            raise UsageError(
                f"{target}: no format has the suffix {suffix}; give one of {known}, or --format"
            )
        return named or Format.text
    if named is not None and named != given:
        option = "--json" if json else f"--format {given}"
        raise UsageError(f"{option} contradicts the suffix of {target}, which is that of {named}")
    return given


def _without_partition(error: LagcliError) -> str:
    """Print why a derivation has no independent coordinates."""
    reason = error.diagnostics[0].message if error.diagnostics else str(error)
    return f"note: independent coordinates and the second kind are omitted: {reason}"


def _kinds(text: str) -> list[str]:
    """Return the kinds of an option, each once."""
    from lagcli.equations.presentation.assembly import KINDS

    kinds = [x.strip() for x in text.split(",")]
    for kind in kinds:
        if kind not in KINDS:
            raise UsageError(f"--kind: there is no kind `{kind}`; known are {', '.join(KINDS)}")
    return list(dict.fromkeys(kinds))


def _names(text: str | None) -> list[str] | None:
    """Return the names of an option."""
    if text is None:
        return None
    from lagcli.model.names.members import split_names

    return [x for x in split_names(text) if x]
