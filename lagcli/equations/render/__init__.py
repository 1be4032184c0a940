"""Rendering of equations and derivations: text, LaTeX, Markdown, JSON."""

from __future__ import annotations

from lagcli.equations.derivation.degrees_of_freedom import DegreesOfFreedom
from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.presentation.extent import Extent
from lagcli.equations.presentation.formulas import Formulas, Step
from lagcli.equations.presentation.overview import convention, in_matrices, in_short, overview
from lagcli.equations.presentation.steps import steps as derivation
from lagcli.errors import UsageError

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

    Returns
    -------
    str
        Text that ends with a newline.

    Raises
    ------
    UsageError
        The format is unknown, or the width is below 40.
    """
    from lagcli.equations.render.formula_text import TextFormula
    from lagcli.equations.render.names import Notation
    from lagcli.equations.render.numbers import written_decimals

    if format not in FORMATS:
        raise UsageError(f"there is no format `{format}`; known are {', '.join(FORMATS)}")
    f = Formulas(equations, numeric, freedom=freedom)
    if format == "json":
        from lagcli.equations.render.json import render_json

        return render_json(f, steps, full)
    shown = _derivation(f, full) if steps else overview(f, full)
    names = Notation(f.model)
    if format == "text":
        from lagcli.equations.render.text import NARROWEST, render_text

        if width < NARROWEST:
            raise UsageError(f"a width of {width} columns is too small: give {NARROWEST} or more")
        formula = TextFormula(names, written_decimals(f.model), numeric)
        return render_text(f.model, shown, formula, width, numbered=steps)
    from lagcli.equations.render.formula_latex import LatexFormula

    latex = LatexFormula(names, written_decimals(f.model), numeric)
    if format == "markdown":
        from lagcli.equations.render.markdown import render_markdown

        return render_markdown(f.model, shown, latex, numbered=steps)
    from lagcli.equations.render.latex import render_latex

    return render_latex(f.model, shown, latex, numbered=steps, fragment=fragment)


def _derivation(f: Formulas, full: bool) -> tuple[Step, ...]:
    """Return the derivation step by step; for a large system, only the result."""
    if in_matrices(f, full):
        return in_short(f, "The derivation is long; --full writes it out.")
    found = [*derivation(f), convention(f)]
    return tuple(found if full else Extent(f).shortened(found))
