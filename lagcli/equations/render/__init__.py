"""Rendering of equations and derivations: text, LaTeX, Markdown, JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from lagcli.errors import UsageError, check_argument

if TYPE_CHECKING:
    from lagcli.equations.derivation.degrees_of_freedom import DegreesOfFreedom
    from lagcli.equations.derivation.lagrange import Equations
    from lagcli.equations.reduction.partition import CoordinatePartition

FORMATS = ("text", "latex", "markdown", "json")


def render(
    equations: Equations,
    format: str = "text",
    steps: bool = False,
    numeric: bool = False,
    width: int = 100,
    fragment: bool = False,
    freedom: DegreesOfFreedom | None = None,
    full: bool = False,
    kinds: Sequence[str] = ("first",),
    partition: CoordinatePartition | None = None,
    solve: bool = False,
) -> str:
    """Render the equations of motion.

    Parameters
    ----------
    equations : Equations
    format : str
        One of `FORMATS`.
    steps : bool
        Whether to show the derivation step by step instead of only its result.
    numeric : bool
        Whether parameters are replaced by their values.
    width : int
        Width of text in columns, at least 40.
    fragment : bool
        LaTeX only: omit the preamble, for inclusion in a document that loads amsmath.
    freedom : DegreesOfFreedom, optional
        The degrees of freedom from `lagcli.degrees_of_freedom`; by default, the constraints are
        assumed to be independent.
    full : bool
        Whether to write everything out, regardless of length.
    kinds : sequence of str
        ``first``, ``second`` and ``maggi``, in the order of printing.
    partition : CoordinatePartition, optional
        The independent and dependent coordinates from `lagcli.partition`; required for other kinds
        than the first and for ``solve``.
    solve : bool
        Whether to give λ and the accelerations in closed form, where that is short.

    Returns
    -------
    str
        Text that ends with a newline.

    Raises
    ------
    UsageError
        The format or a kind is unknown, the partition is missing, the width is below 40, or the
        second kind is requested with nonholonomic constraints.
    """
    # not at the top: plots use the notation of names without deriving equations
    from lagcli.equations.derivation.lagrange import Equations

    check_argument("render", equations, Equations, "lagcli.derive returns them")
    from lagcli.equations.presentation.assembly import KINDS, Contents, shown_steps
    from lagcli.equations.presentation.formulas import Formulas
    from lagcli.equations.typesetting.notation import Notation
    from lagcli.equations.typesetting.text import TextFormula
    from lagcli.equations.typesetting.writer import written_decimals

    if format not in FORMATS:
        raise UsageError(f"there is no format `{format}`; known are {', '.join(FORMATS)}")
    for kind in kinds:
        if kind not in KINDS:
            raise UsageError(f"there is no kind `{kind}`; known are {', '.join(KINDS)}")
    if partition is None and (solve or set(kinds) != {"first"}):
        raise UsageError("the kinds second and maggi, and solve, need lagcli.partition(equations)")
    f = Formulas(equations, numeric, freedom=freedom)
    contents = Contents(kinds, partition, solve, steps, full)
    if format == "json":
        from lagcli.equations.render.json import render_json

        return render_json(f, contents)
    shown = shown_steps(f, contents)
    names = Notation(f.model)
    if format == "text":
        from lagcli.equations.typesetting.text import NARROWEST, render_text

        if width < NARROWEST:
            raise UsageError(f"a width of {width} columns is too small: give {NARROWEST} or more")
        formula = TextFormula(names, written_decimals(f.model), numeric)
        return render_text(f.model, shown, formula, width, numbered=steps)
    from lagcli.equations.typesetting.latex import LatexFormula

    latex = LatexFormula(names, written_decimals(f.model), numeric)
    if format == "markdown":
        from lagcli.equations.typesetting.markdown import render_markdown

        return render_markdown(f.model, shown, latex, numbered=steps)
    from lagcli.equations.typesetting.latex import render_latex

    return render_latex(f.model, shown, latex, numbered=steps, fragment=fragment)
