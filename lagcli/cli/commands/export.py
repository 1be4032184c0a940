"""`lagcli export`: the equations as code."""

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


class CodeLanguage(StrEnum):
    """Languages and libraries."""

    c = "c"
    python = "python"
    casadi = "casadi"
    jax = "jax"
    matlab = "matlab"
    modelica = "modelica"


def export(
    model: ModelPath,
    to: Annotated[
        CodeLanguage | None,
        Option("--to", help="Language or library. [default: that of the file's suffix]"),
    ] = None,
    output: Output = None,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write the equations of motion as code for other programs.

    The code computes M, f, B and γ, accelerations, multipliers, residuals, energies and outputs.
    Files end in .c, .py (NumPy; CasADi or JAX with --to), .m (MATLAB, Octave) or .mo (Modelica).
    """
    from lagcli.export.content import content_of
    from lagcli.export.formats import format_of
    from lagcli.model.loader import load
    from lagcli.results.atomic import check_writable, whole_file

    refuse_same_file(model, output)
    target = None if output in (None, "-") else output
    chosen = format_of(None if to is None else to.value, target)
    if target is not None:
        check_writable(target, force)
    loaded = load(model, assignments("--set", set), assignments("--set-initial", set_initial))
    text = chosen.write(content_of(loaded))
    if target is None:
        sys.stdout.write(text)
        return
    with whole_file(target, force) as file:
        file.write(text.encode())
    if not quiet:
        print(f"written: {target}", file=sys.stderr)
