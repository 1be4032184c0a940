"""The page of an analysis: results, equations, and provenance."""

from __future__ import annotations

import os
from collections.abc import Mapping
from html import escape
from typing import NamedTuple

from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.presentation.formulas import Formulas
from lagcli.model.loader import load_text
from lagcli.model.model import Model
from lagcli.model.result_units import result_units
from lagcli.pictures.page import asset
from lagcli.pictures.report.analysis_sections import (
    AnalysisSection,
    content_sections,
    fit_sections,
    section_html,
)
from lagcli.pictures.report.equations import EquationSystem
from lagcli.pictures.report.report_page import report_page
from lagcli.pictures.report.writing import table
from lagcli.version import __version__

_STYLES = ("report.css", "analysis.css")

#: Sections after those of the analysis.
_CONTENTS = (
    ("equations", "Equations"),
    ("system", "System"),
    ("provenance", "Provenance"),
    ("model", "Model file"),
)


class _Values(NamedTuple):
    """Values of a model in the form of a run's record."""

    units: Mapping[str, str]
    parameters: Mapping[str, float]


class _AnalysedModel:
    """A model without a run."""

    def __init__(self, model: Model, parameters: Mapping[str, float]):
        self.coordinates, self.constraints = model.coordinate_names, model.constraint_names
        self.record = _Values(result_units(model), parameters)


def analysis_page(path: str, kind: str, title: str | None = None) -> str:
    """Return the page of an analysis file.

    Parameters
    ----------
    path : str
        HDF5.
    kind : str
        The command that wrote it.
    title : str, optional
        Title instead of the model's.

    Raises
    ------
    FileError, UsageError, ModelError
        See `lagcli.pictures.report.report`.
    """
    if kind == "fit":
        from lagcli.analysis.fit.file import read_fit

        result = read_fit(path)
        model, found = load_text(result.model, path), fit_sections(result)
        return _assembled(model, result.parameters, found, path, kind, title)
    if kind == "sweep":
        from lagcli.pictures.report.sweep_sections import sweep_model, sweep_sections

        model = sweep_model(path)
        return _assembled(model, model.parameter_values, sweep_sections(path), path, kind, title)
    from lagcli.results.hdf5.analysis_file import read_analysis, read_model_text

    content, given = read_analysis(path), read_model_text(path)
    model = load_text(given.text, given.path, given.set, given.set_initial)
    found = content_sections(content, result_units(model))
    return _assembled(model, model.parameter_values, found, path, kind, title)


def _assembled(
    model: Model,
    parameters: Mapping[str, float],
    found: list[AnalysisSection],
    path: str,
    kind: str,
    title: str | None,
) -> str:
    system = EquationSystem(_AnalysedModel(model, parameters), Formulas(derive(model)))
    changed = {**model.set, **model.set_initial}
    rows = [
        ("File", escape(os.path.basename(path))),
        ("Made by", f"lagcli {escape(kind)}, page by lagcli {__version__}"),
        ("Changed", escape(", ".join(f"{k} = {x}" for k, x in changed.items()))),
        ("Model", f"<code>sha256 {escape(model.sha256)}</code>"),
    ]
    return report_page(
        model,
        system,
        template="analysis.html",
        title=title,
        contents=[*((x.anchor, escape(x.title)) for x in found), *_CONTENTS],
        styles=map(asset, _STYLES),
        scripts=[asset("theme.js")],
        images=True,
        sections="".join(map(section_html, found)),
        provenance=table("Files and versions", ["", ""], [x for x in rows if x[1]], kind="facts"),
    )
