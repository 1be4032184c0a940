"""The page of an analysis: results in tables and pictures, equations, provenance."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from html import escape
from typing import Any

from lagcli.analysis.contents import content_sections
from lagcli.analysis.output.tables import (
    Cell,
    ModelName,
    Phasor,
    Phrase,
    PlotPlace,
    Remark,
    ResultColumn,
    ResultSection,
    SectionBlock,
    UnitText,
)
from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.typesetting.mathml import MathmlFormula, inline
from lagcli.equations.typesetting.nodes import Symbol
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.writer import written_decimals
from lagcli.errors import UsageError
from lagcli.model.loader import load_text
from lagcli.model.model import Model
from lagcli.model.result_units import result_units
from lagcli.pictures.page import asset, axis_unit, number, own_words, table, unit, with_code
from lagcli.pictures.plots.analysis_plot import draw_result, plot_analysis
from lagcli.pictures.plots.figure import FigureTarget
from lagcli.pictures.report.equations import EquationSystem
from lagcli.pictures.report.report_page import AnalysisSection, picture, report_page, section_html
from lagcli.version import __version__

#: Imaginary parts below this part of a component of a shape are not shown.
_REAL = 1e-9
_STYLES = ("report.css", "analysis.css")

#: Sections after those of the analysis.
_CONTENTS = (
    ("equations", "Equations"),
    ("system", "System"),
    ("provenance", "Provenance"),
    ("model", "Model file"),
)


def analysis_page(path: str, kind: str, title: str | None, lang: str) -> str:
    """Return the page of an analysis file.

    Parameters
    ----------
    path : str
        HDF5.
    kind : str
        The command that wrote it.
    title : str, optional
        Title instead of the model's.
    lang : str
        Language of the page's own words.

    Raises
    ------
    FileError, UsageError, ModelError
        See `lagcli.pictures.report.report`.
    """
    if kind == "fit":
        from lagcli.analysis.fit.file import read_fit
        from lagcli.analysis.fit.result import fit_sections
        from lagcli.simulations.inputs import input_data

        result = read_fit(path)
        model = load_text(result.model, path, data=input_data(result.inputs))
        draw = partial(draw_result, result, ())
        sections = rendered(fit_sections(result), draw, names_of(model))
        return _assembled(model, result.parameters, sections, path, kind, title, lang)
    if kind == "sweep":
        from lagcli.pictures.report.sweep_report import sweep_model, sweep_sections

        model = sweep_model(path)
        sections = sweep_sections(path, names_of(model))
        return _assembled(model, model.declared_values, sections, path, kind, title, lang)
    from lagcli.analysis.output.files import stored_model
    from lagcli.results.hdf5.analysis_file import read_analysis

    content, model = read_analysis(path), stored_model(path)
    sections = _sections(content, model)
    return _assembled(model, model.declared_values, sections, path, kind, title, lang)


def _assembled(
    model: Model,
    parameters: Mapping[str, float],
    sections: list[AnalysisSection],
    path: str,
    kind: str,
    title: str | None,
    lang: str,
) -> str:
    system = EquationSystem(Formulas(derive(model)), result_units(model), parameters)
    changed = {**model.set, **model.set_initial}
    rows = [
        ("File", own_words(os.path.basename(path))),
        ("Made by", f"lagcli {escape(kind)}, page by lagcli {__version__}"),
        ("Changed", escape(", ".join(f"{k} = {x}" for k, x in changed.items()))),
        ("Model", f"<code>sha256 {escape(model.sha256)}</code>"),
    ]
    return report_page(
        system,
        template="analysis.html",
        title=title,
        lang=lang,
        contents=[*((x.anchor, x.title) for x in sections), *_CONTENTS],
        styles=map(asset, _STYLES),
        scripts=[asset("theme.js"), "new PageTheme();"],
        sections="".join(map(section_html, sections)),
        provenance=table("Files and versions", ["", ""], [x for x in rows if x[1]], kind="facts"),
    )


def names_of(model: Model) -> Callable[[str], str]:
    """Return a function that writes a name as a formula in HTML, if it is one of the model."""
    names = Notation(model)
    mathml = MathmlFormula(names, written_decimals(model))

    def written(name: str) -> str:
        part, _, constraint = name.partition("lambda.")
        small, rest = ("δ", name[1:]) if name.startswith("δ") else ("", name)
        base = rest.rstrip("'")
        if rest.startswith("λ ") or (constraint and not part):
            node = Symbol(constraint or rest[2:], kind="multiplier")
        elif base in names.declared:
            node = Symbol(base, len(rest) - len(base))
        else:
            return _as_it_is(name)
        return f'<span title="{escape(name)}">{small}{inline(node, mathml)}</span>'

    return written


def _as_it_is(name: str) -> str:
    return f'<span class="name">{escape(name)}</span>'


def rendered(
    sections: Iterable[ResultSection],
    draw: Callable[[FigureTarget], object] | None,
    named: Callable[[str], str] = _as_it_is,
) -> list[AnalysisSection]:
    """Return sections of an analysis in HTML.

    Parameters
    ----------
    sections : iterable of ResultSection
    draw : callable or None
        Function that draws the plot of the analysis to the given target; None to omit it.
    named : callable
        Function that writes a name of the model in HTML; see `names_of`.

    Raises
    ------
    UsageError
        matplotlib is not installed.
    """
    return [
        AnalysisSection(
            x.anchor,
            " ".join([escape(x.title), *map(named, x.of)]),
            "".join(_block(block, draw, named) for block in x.blocks),
        )
        for x in sections
    ]


def _block(
    block: SectionBlock,
    draw: Callable[[FigureTarget], object] | None,
    named: Callable[[str], str],
) -> str:
    if isinstance(block, PlotPlace):
        return "" if draw is None else picture(draw, block.caption)
    if isinstance(block, Remark):
        class_ = {"": "", "note": ' class="note"', "failure": ' class="status bad"'}[block.kind]
        names = ", ".join(
            named(name) + ("" if value is None else f" {number(value, 3)}")
            for name, value in block.names
        )
        return f"<p{class_}>{with_code(block.text)}{names}{escape(block.end)}</p>"

    def cell(value: Cell, digits: int = 6) -> str:
        return named(value) if isinstance(value, ModelName) else _cell(value, digits)

    cells = [[cell(x, column.digits) for x in column.values] for column in block.columns]
    numeric = [] if block.facts else [i for i, x in enumerate(block.columns) if i and _numeric(x)]
    heads = [cell(x.name) + (f" [{axis_unit(x.unit)}]" if x.unit else "") for x in block.columns]
    rows = list(zip(*cells, strict=True))
    return table(cell(block.caption), heads, rows, numeric, kind="facts" * block.facts)


def _numeric(column: ResultColumn) -> bool:
    """Whether a column has numbers."""
    return any(isinstance(x, (int, float, complex, Phrase)) for x in column.values)


def _cell(value: Cell, digits: int = 6) -> str:
    """Return a value in HTML."""
    match value:
        case UnitText():
            return unit(value)
        case str():
            return escape(value)
        case Phrase():
            text = escape(value.text)
            for x in value.values:
                text = text.replace("{}", number(x, value.digits), 1)
            return text
        case Phasor():
            if abs(value.imag) <= _REAL * abs(value):
                return number(value.real, digits)
            degrees = math.degrees(math.atan2(value.imag, value.real))
            return f"{number(abs(value), digits)} ∠ {degrees:.0f}°"
        case complex():
            real, imaginary = number(value.real, digits), number(abs(value.imag), digits)
            if not value.imag:
                return real
            return f"{real} ± {imaginary} i" if value.real else f"± {imaginary} i"
        case int():
            return str(value)
    return number(value, digits)


def modes_sections(model: Model, about: str) -> list[AnalysisSection]:
    """Return the sections of the modes about a point of a run.

    Parameters
    ----------
    model : Model
        Model with the values of the run.
    about : str
        ``start``, ``equilibrium`` or a time, s.

    Raises
    ------
    UsageError
        The point is invalid, or matplotlib is not installed.
    ModelError, NumericalError
        As `lagcli.modes`.
    """
    from lagcli.analysis.linear.description import describe_modes
    from lagcli.analysis.linear.modes import modes

    if about in ("start", "equilibrium"):
        result = modes(model, equilibrium=about == "equilibrium")
    else:
        try:
            result = modes(model, at=float(about))
        except ValueError:
            raise UsageError(
                f"--modes {about}: give start, equilibrium or a time of the run in s: --modes start"
            ) from None
    return _sections(describe_modes(result), model)


def _sections(content: Mapping[str, Any], model: Model) -> list[AnalysisSection]:
    """Return the sections of a content in HTML."""
    units = result_units(model)
    return rendered(
        content_sections(content, units),
        partial(plot_analysis, content, (), model=model, units=units),
        names_of(model),
    )
