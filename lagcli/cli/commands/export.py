"""`lagcli export`: a model as code, as an FMU, or as a page that simulates it."""

import os
import sys
from collections.abc import Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from lagcli.cli import completion
from lagcli.cli.options import (
    Force,
    Output,
    PresetName,
    Quiet,
    SetInitial,
    SetParameter,
    assignments,
)
from lagcli.files import refuse_same_file
from lagcli.pictures.languages import Language

if TYPE_CHECKING:
    from lagcli.model.model import Model


class ExportTarget(StrEnum):
    """Languages, libraries and standards."""

    c = "c"
    python = "python"
    casadi = "casadi"
    jax = "jax"
    matlab = "matlab"
    modelica = "modelica"
    fmu = "fmu"
    page = "page"


class FmiVersion(StrEnum):
    """Versions of FMI."""

    fmi2 = "2.0"
    fmi3 = "3.0"


def export(
    models: Annotated[
        list[str],
        typer.Argument(
            metavar="MODEL…",
            autocompletion=completion.models,
            help="Model file (YAML), name of a shipped model, or - for standard input; several for"
            " a folder of pages.",
        ),
    ],
    to: Annotated[
        ExportTarget | None,
        typer.Option(
            "--to", help="Language, library or standard. [default: that of the file's suffix]"
        ),
    ] = None,
    output: Output = None,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    preset: PresetName = None,
    fmi: Annotated[
        FmiVersion, typer.Option("--fmi", help="Version of FMI, of an FMU.")
    ] = FmiVersion.fmi2,
    input: Annotated[
        list[str] | None,
        typer.Option(
            "--input",
            metavar="NAME",
            help="A parameter that is an input of the FMU. Repeatable.",
        ),
    ] = None,
    wheels: Annotated[
        str | None,
        typer.Option(
            "--wheels",
            metavar="FOLDER",
            help="Wheels of lagcli for other platforms, on which the FMU is to run, too.",
        ),
    ] = None,
    lang: Annotated[
        Language, typer.Option("--lang", help="Language of the words of a page.")
    ] = Language.en,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a model for other programs: as code, an FMU or a page.

    The code computes M, f, B and γ, accelerations, multipliers, residuals, energies and outputs.
    Files end in .c, .py (NumPy; CasADi or JAX with --to), .m (MATLAB, Octave) or .mo (Modelica).
    An FMU (.fmu) simulates the model, also with contacts and events, in any tool that knows FMI; a
    page (.html) does in any browser, with sliders, without lagcli or a network. Pages of several
    models with an index go to a folder: -o course/
    """
    from lagcli.errors import UsageError
    from lagcli.export.formats import ExportOptions, format_of
    from lagcli.model.loader import load
    from lagcli.results.atomic import check_writable, whole_file

    given = assignments("--set", set), assignments("--set-initial", set_initial)
    options = ExportOptions(fmi.value, tuple(input or ()), wheels, lang.value)
    if output is not None and (output.endswith(("/", os.sep)) or os.path.isdir(output)):
        options.check("page")
        _export_folder(
            [load(model, *given, preset=preset) for model in models], to, output, lang.value, force
        )
        if not quiet:
            print(f"written: {len(models) + 1} pages in {output}", file=sys.stderr)
        return
    if len(models) > 1:
        raise UsageError("pages of several models go to a folder: -o course/")
    [model] = models
    refuse_same_file(model, output)
    target = None if output in (None, "-") else output
    chosen = format_of(None if to is None else to.value, target)
    if target is not None:
        check_writable(target, force)
    loaded = load(model, *given, preset=preset)
    content = chosen.write(loaded, options)
    if target is None:
        if chosen.name == "fmu":
            sys.stdout.buffer.write(content)
        else:
            sys.stdout.write(content.decode())
        return
    with whole_file(target, force) as file:
        file.write(content)
    if not quiet:
        print(f"written: {target}", file=sys.stderr)


def _export_folder(
    models: "Sequence[Model]", to: ExportTarget | None, folder: str, lang: str, force: bool
) -> None:
    """Write the pages of models and their index to a folder, which is made if it is missing."""
    from lagcli.errors import FileError, UsageError
    from lagcli.live.course import course
    from lagcli.results.atomic import check_writable, whole_file

    if to not in (None, ExportTarget.page):
        raise UsageError(f"--to {to}: a folder is for pages alone; name a file for {to}")
    pages = course(models, lang)
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise FileError(f"{folder}: {error.strerror}") from None
    targets = {os.path.join(folder, name): text for name, text in pages.items()}
    for target in targets:
        check_writable(target, force)
    for target, text in targets.items():
        with whole_file(target, force) as file:
            file.write(text.encode())
