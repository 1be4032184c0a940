"""The report of a run as PDF: equations and plots in one document, set by LaTeX."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lagcli.columns import ColumnName
from lagcli.equations.presentation.overview import overview
from lagcli.equations.typesetting.latex import LatexFormula, document, escape, render_latex
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.writer import written_decimals
from lagcli.pictures.pdf import pdf_of
from lagcli.pictures.plots.figure import HeldFigure
from lagcli.pictures.plots.run_plot import plot_runs
from lagcli.pictures.report.run_report import method_phrase
from lagcli.pictures.run_file import RunFile, formulas_of
from lagcli.pictures.selection import chosen

_PACKAGES = "\\usepackage{graphicx}\n"
#: Largest number of curves of one kind that are drawn.
_CURVES = 24


def assembled_pdf(run: RunFile, title: str | None) -> bytes:
    """Return the report of a run as PDF.

    Parameters
    ----------
    run : RunFile
    title : str, optional
        Title instead of the model's name.

    Raises
    ------
    FileError, UsageError, ModelError
        See `lagcli.pictures.report.report`.
    """
    model = run.model
    latex = LatexFormula(Notation(model), written_decimals(model))
    equations = render_latex(
        model, overview(formulas_of(run, model)), latex, numbered=False, fragment=True, title=title
    )
    parts = [equations, r"\section*{Run}", rf"\noindent {escape(_account(run))}"]
    pictures: dict[str, bytes] = {}
    for heading, names in _plots(run):
        held = HeldFigure("pdf")
        plot_runs([run], names, held)
        file = f"plot{len(pictures) + 1}.pdf"
        pictures[file] = held.content
        parts.append(
            rf"\subsection*{{{heading}}}"
            "\n\n"
            rf"\noindent\includegraphics[width=\textwidth,height=0.85\textheight,keepaspectratio]"
            f"{{{file}}}"
        )
    return pdf_of(document("\n\n".join(parts), _PACKAGES), pictures)


def _plots(run: RunFile) -> Iterator[tuple[str, list[str]]]:
    if not run.count:
        return
    groups = {
        "Coordinates": list(run.coordinates),
        "Multipliers": [str(ColumnName("multipliers", c)) for c in run.constraints],
        "Outputs": list(run.outputs),
        "Energies": ["energy_kinetic", "energy_potential", "energy_total"],
    }
    for heading, names in groups.items():
        if names:
            yield heading, [names[i] for i in chosen(names, _CURVES)]


def _account(run: RunFile) -> str:
    """Return a description of the run: status, samples, method and warnings."""
    record = run.record
    said = [f"The run is {record.status}" + (f": {record.message}" if record.message else "") + "."]
    if run.count:
        ends = np.array([0, run.count - 1], dtype=np.intp)
        first, last = run.columns(("time",), ends)["time"].tolist()
        said.append(f"{run.count} samples from t = {first:g} s to {last:g} s.")
    if phrase := method_phrase(record.options):
        said.append(f"Method: {phrase}.")
    said += record.warnings
    return " ".join(said)
