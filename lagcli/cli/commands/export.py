"""`lagcli export`: a model as code, as an FMU, or as a page that simulates it."""

import sys
from enum import StrEnum
from typing import Annotated

from lagcli.cli.options import (
    Force,
    ModelPath,
    Output,
    Quiet,
    SetInitial,
    SetParameter,
    assignments,
    refuse_same_file,
)
from lagcli.cli.parameters import Option


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


class Language(StrEnum):
    """Languages of pages."""

    en = "en"
    de = "de"
    fr = "fr"
    es = "es"


class FmiVersion(StrEnum):
    """Versions of FMI."""

    fmi2 = "2.0"
    fmi3 = "3.0"


def export(
    model: ModelPath,
    to: Annotated[
        ExportTarget | None,
        Option("--to", help="Language, library or standard. [default: that of the file's suffix]"),
    ] = None,
    output: Output = None,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    fmi: Annotated[
        FmiVersion, Option("--fmi", help="Version of FMI, of an FMU.")
    ] = FmiVersion.fmi2,
    input: Annotated[
        list[str] | None,
        Option(
            "--input",
            metavar="NAME",
            help="A parameter that is an input of the FMU. Repeatable.",
        ),
    ] = None,
    wheels: Annotated[
        str | None,
        Option(
            "--wheels",
            metavar="FOLDER",
            help="Wheels of lagcli for other platforms, on which the FMU is to run, too.",
        ),
    ] = None,
    lang: Annotated[
        Language, Option("--lang", help="Language of the words of a page.")
    ] = Language.en,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a model for other programs: as code, as an FMU, or as a page that simulates it.

    The code computes M, f, B and γ, accelerations, multipliers, residuals, energies and outputs.
    Files end in .c, .py (NumPy; CasADi or JAX with --to), .m (MATLAB, Octave) or .mo (Modelica).
    An FMU (.fmu) simulates the model, also with contacts and events, in any tool that knows FMI; a
    page (.html) does in any browser, with sliders, without lagcli or a network.
    """
    from lagcli.export.formats import ExportOptions, format_of
    from lagcli.model.loader import load
    from lagcli.results.atomic import check_writable, whole_file

    refuse_same_file(model, output)
    target = None if output in (None, "-") else output
    chosen = format_of(None if to is None else to.value, target)
    if target is not None:
        check_writable(target, force)
    loaded = load(model, assignments("--set", set), assignments("--set-initial", set_initial))
    options = ExportOptions(fmi.value, tuple(input or ()), wheels, lang.value)
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
