"""Assembly of the page of a report."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np

from lagcli.columns import ColumnName
from lagcli.equations.derivation.degrees_of_freedom import DegreesOfFreedom
from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.presentation.formulas import Formulas
from lagcli.pictures.event_marks import marks
from lagcli.pictures.page import PLAYER_SCRIPTS, PLAYER_STYLES, asset, script_data
from lagcli.pictures.plots.style import PALETTE
from lagcli.pictures.plots.thinning import evenly
from lagcli.pictures.report import tables
from lagcli.pictures.report.analysis_sections import section_html
from lagcli.pictures.report.curves import (
    POWERS,
    RESIDUALS_TITLE,
    Packed,
    Plot,
    ReportCurve,
    Section,
    by_scale,
    curve_of,
    gather,
    scalar_curves,
    sections,
    to_json,
    without_errors,
)
from lagcli.pictures.report.equations import EquationSystem
from lagcli.pictures.report.event_table import events_contents, events_section
from lagcli.pictures.report.modes_sections import modes_sections
from lagcli.pictures.report.report_page import report_page
from lagcli.pictures.report.sensitivity_section import sensitivity_contents, sensitivity_section
from lagcli.pictures.report.writing import chosen
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.timing import timing
from lagcli.pictures.scene.view_evaluator import scene_of
from lagcli.trajectory.extremes import Extreme, Extremes

_UPLOT = "vendor/uplot/"
_SCRIPTS = (_UPLOT + "uPlot.iife.min.js", *PLAYER_SCRIPTS, "plots.js", "report.js")
_STYLES = (_UPLOT + "uPlot.min.css", *PLAYER_STYLES, "plots.css", "report.css")

#: Largest numbers of frames, and of values, of the animation.
_FRAMES, _FRAME_NUMBERS = 3000, 90_000
#: Number of rows of each kind in the table of extremes.
_ROWS = 24
#: Relative integral of powers that counts as rounding error.
_ROUNDING = 1e-10


def assembled(run: RunFile, title: str | None = None, modes: str | None = None) -> str:
    """Return the page of a run.

    Parameters
    ----------
    run : Run
    title : str, optional
        Title instead of the model's name.
    modes : str, optional
        See `lagcli.pictures.report.report`.

    Raises
    ------
    FileError, UsageError, ModelError
        See `lagcli.pictures.report.report`.
    """
    model = run.model
    asked = [] if modes is None else modes_sections(run.written_model, modes)
    recorded = DegreesOfFreedom.from_mapping(run.record.freedom) if run.record.freedom else None
    system = EquationSystem(run, Formulas(derive(model), freedom=recorded))
    found = sections(run, system.names) if run.count else []
    plots = [plot for section in found for plot in section.plots]
    extremes = {curve: Extreme() for curve in _looked_at(run, system)}
    gather(run, plots, extremes)
    found = _notable(found, extremes)
    packed = Packed()
    scene = _scene(run)
    data = {
        "name": title or model.title,
        "palette": list(PALETTE),
        "scene": scene,
        "speed": timing(*_ends(scene)).speed if scene else 1,
        "plots": [to_json(plot, packed) for section in found for plot in section.plots],
        "arrays": list(packed.texts),
        "marks": marks(run.record.events).tolist(),
    }
    start = run.columns(("q", "v"), np.zeros(1, dtype=np.intp))
    plotted = [x for x in found if x.title != RESIDUALS_TITLE]
    return report_page(
        model,
        system,
        template="report.html",
        title=title,
        contents=[
            ("equations", "Equations"),
            *((_anchor(x.title), x.title) for x in plotted),
            *events_contents(run),
            *sensitivity_contents(run),
            *((x.anchor, x.title) for x in asked),
            ("system", "System"),
            ("extremes", "Extremes"),
            ("computation", "Computation"),
            ("model", "Model file"),
        ],
        styles=map(asset, (*_STYLES, *(["analysis.css"] if asked else []))),
        scripts=[f"/*\n{asset(_UPLOT + 'LICENSE')}\n*/", *map(asset, _SCRIPTS)],
        layout="with-motion" if scene else "without-motion",
        status=tables.status(run),
        start=[x[0] for x in start.values()] if run.count else (),
        conserved=system.conserved(),
        steps=system.steps(),
        data=script_data(data),
        motion=_MOTION if scene else "",
        plots=_plots(plotted, run.count),
        residuals=_residual_plots(found),
        events=events_section(run),
        sensitivities=sensitivity_section(run, system.names),
        asked="".join(map(section_html, asked)),
        images=bool(asked),
        extremes=tables.extremes_table(extremes, system),
        moved=tables.moved(run, system),
        solver=tables.solver(run, _residuals(run)),
        provenance=tables.provenance(run),
    )


_MOTION = """<aside id="motion" aria-label="Animation">
<div id="player"></div>
<p class="hint">Point at a plot, or click it, to show that time in the animation.</p>
<div class="strip" aria-hidden="true"></div>
</aside>"""


def _scene(run: RunFile) -> dict[str, Any] | None:
    """Return the scene as JSON values, at some of the samples; None if there is none."""
    if run.model.view is None or run.count < 2:
        return None
    few = scene_of(run, evenly(run.count, 2))
    assert few is not None
    series = sum(len(axes) for axes in few.points.values()) + 4 * len(few.vectors) + 1
    frames = max(100, min(_FRAMES, _FRAME_NUMBERS // series))
    scene = scene_of(run, evenly(run.count, frames))
    assert scene is not None
    return scene.to_json()


def _ends(scene: Mapping[str, Any]) -> tuple[float, float]:
    return scene["time"][0], scene["time"][-1]


def _looked_at(run: RunFile, system: EquationSystem) -> list[ReportCurve]:
    """Return the curves whose extremes are listed."""
    names = system.names
    q, constraints = run.coordinates, run.constraints
    places = chosen(q, _ROWS)
    found = [curve_of(ColumnName(field, "", q[j]), names, (j,)) for field in "qv" for j in places]
    found += [
        curve_of(ColumnName("multipliers", constraints[i]), names, (i,))
        for i in chosen(constraints, _ROWS)
    ]
    outputs = [run.outputs[i] for i in chosen(run.outputs, _ROWS)]
    found += [ReportCurve(name, name, f"outputs/{name}") for name in outputs]
    return found + scalar_curves("energies", names)


def _residuals(run: RunFile) -> Extremes:
    found = Extremes(run.constraints, run.conserved_names)
    for columns in run.blocks(Extremes.COLUMNS):
        found.add(columns)
    return found


def _notable(found: list[Section], extremes: Mapping[ReportCurve, Extreme]) -> list[Section]:
    """Return the sections without insignificant curves."""
    energies = [x for curve, x in extremes.items() if curve.name.startswith("energy")]
    scale = max((x.high - x.low for x in energies if x.high >= x.low), default=0.0)
    kept = []
    for section in found:
        for plot in section.plots:
            if plot.title == POWERS and len(plot.time):
                duration = float(plot.time[-1] - plot.time[0])
                plot.least = _ROUNDING * scale / duration if duration else 0.0
        plots = [part for plot in without_errors(section.plots) for part in by_scale(plot)]
        if plots:
            kept.append(section._replace(plots=plots))
    return kept


def _plots(found: list[Section], count: int) -> str:
    """Return the placeholders of the plots; the script fills them in this order."""
    if not found:
        return "<p>There are no samples.</p>"
    parts = []
    drawn = min(len(plot.time) for section in found for plot in section.plots)
    if drawn < count:
        parts.append(
            f'<p class="note">Each plot shows at least {drawn} of the {count} samples: the'
            " smallest and"
            " the largest value of each curve in each interval of time, exactly as in the file."
            " Zooming in shows no further samples.</p>"
        )
    return "".join([*parts, *map(_section, found)])


def _residual_plots(found: list[Section]) -> str:
    """Return the places of the residuals, which come last."""
    return "".join(_section(x) for x in found if x.title == RESIDUALS_TITLE)


def _section(section: Section) -> str:
    about = f"<p>{escape(section.about)}</p>" if section.about else ""
    narrow = ' class="narrow"' if len(section.plots) == 1 else ""
    return (
        f'<section id="{_anchor(section.title)}"{narrow}><h3>{section.title}</h3>{about}'
        f'<div class="plots">{"".join(map(_place, section.plots))}</div></section>'
    )


def _place(plot: Plot) -> str:
    note = f'<p class="note">{escape(plot.note)}</p>' if plot.note else ""
    return f'<div class="place"><figure></figure>{note}</div>'


def _anchor(title: str) -> str:
    return "plots-" + title.lower().replace(" ", "-")
