"""The page of a run: plots, animation, tables of events, extremes, sensitivities and provenance."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.columns import (
    BY_NAME,
    PANELS,
    ColumnName,
    read_column_name,
    unit_of_column,
    unit_quotient,
)
from lagcli.model.model import Model
from lagcli.pictures.curves import Catalogue, Curve
from lagcli.pictures.jumps import marks
from lagcli.pictures.page import (
    PLAYER_SCRIPTS,
    PLAYER_STYLES,
    asset,
    axis_unit,
    message,
    number,
    own_words,
    script_data,
    table,
    unit,
    with_code,
)
from lagcli.pictures.report.equations import EquationSystem
from lagcli.pictures.report.report_page import AnalysisSection, report_page, section_html
from lagcli.pictures.report.run_plots import (
    POWERS,
    RESIDUALS_TITLE,
    Packed,
    Plot,
    Section,
    by_scale,
    gather,
    sections,
    to_json,
    without_errors,
)
from lagcli.pictures.run_file import RunFile, formulas_of
from lagcli.pictures.scene.arms import arm_units
from lagcli.pictures.scene.automatic_view import with_view
from lagcli.pictures.scene.curve_picture import curve_image
from lagcli.pictures.scene.scene import Scene
from lagcli.pictures.scene.still import still_image
from lagcli.pictures.scene.timing import timing
from lagcli.pictures.scene.view_evaluator import scene_of
from lagcli.pictures.selection import chosen, evenly
from lagcli.pictures.style import PALETTE, constraint_colors
from lagcli.trajectory.event_log import MODES, EventLog, EventRecords, event_sentences
from lagcli.trajectory.extremes import Extreme, Extremes
from lagcli.version import __version__

_UPLOT = "vendor/uplot/"
_SCRIPTS = (
    _UPLOT + "uPlot.iife.min.js",
    *PLAYER_SCRIPTS,
    "plots.js",
    "arms.js",
    "balance.js",
    "theme.js",
    "report.js",
)
_STYLES = (_UPLOT + "uPlot.min.css", *PLAYER_STYLES, "plots.css", "balance.css", "report.css")

#: Largest numbers of frames, and of values, of the animation.
_FRAMES, _FRAME_NUMBERS = 3000, 90_000
#: Number of rows of each kind in the table of extremes.
_ROWS = 24
#: Relative integral of powers that counts as rounding error.
_ROUNDING = 1e-10


def assembled(run: RunFile, title: str | None, modes: str | None, lang: str) -> str:
    """Return the page of a run.

    Parameters
    ----------
    run : Run
    title : str, optional
        Title instead of the model's name.
    modes : str, optional
        See `lagcli.pictures.report.report`.
    lang : str
        Language of the page's own words.

    Raises
    ------
    FileError, UsageError, ModelError
        See `lagcli.pictures.report.report`.
    """
    model = with_view(run.model)
    asked: list[AnalysisSection] = []
    if modes is not None:
        from lagcli.pictures.report.analysis_report import modes_sections

        asked = modes_sections(run.model, modes)
    system = EquationSystem(
        formulas_of(run, model), run.record.units, run.record.parameters, live=run.count > 0
    )
    catalogue = Catalogue(run)
    every = sections(catalogue) if run.count else []
    plots = [plot for section in every for plot in section.plots]
    extremes = {curve: Extreme() for curve in _looked_at(catalogue)}
    instants = gather(run, plots, extremes)
    every = _notable(every, extremes)
    packed = Packed()
    scene = _scene(run, model, instants.samples)
    balance = _balance(run, system, packed, instants.samples) if run.count else None
    colors = constraint_colors(run.constraints)
    data = {
        "name": title or model.title,
        "instants": packed.add(instants.time),
        "palette": list(PALETTE),
        "colors": colors,
        "arms": arm_units(model),
        "scene": scene and {**scene.to_json(), "colors": colors},
        "balance": balance,
        "speed": timing(*scene.time[[0, -1]].tolist()).speed if scene else 1,
        "plots": [to_json(plot, packed) for section in every for plot in section.plots],
        "arrays": list(packed.texts),
        "marks": marks(run.record.events).tolist(),
    }
    start = run.columns(("q", "v"), np.zeros(1, dtype=np.intp))
    plotted = [x for x in every if x.title != RESIDUALS_TITLE]
    return report_page(
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
        lang=lang,
        status=status(run),
        start=[x[0] for x in start.values()] if run.count else (),
        conserved=system.conserved(),
        steps=system.steps(),
        data=script_data(data),
        motion=_MOTION if scene else "",
        plots=_plots(plotted, run.count, len(instants.samples)),
        residuals=_residual_plots(every),
        events=events_section(run),
        sensitivities=sensitivity_section(catalogue),
        asked="".join(map(section_html, asked)),
        without_script=_without_script(_first_plot(every), colors, scene, title or model.title),
        extremes=extremes_table(extremes, system),
        moved=moved(run, system),
        solver=solver(run, _residuals(run)),
        provenance=provenance(run),
    )


_MOTION = """<aside id="motion" aria-label="Animation">
<div id="player"></div>
<div id="arms" class="arms" hidden></div>
<figure id="lambda"></figure>
<p class="hint">Point at a term, an arrow or a curve to see what belongs to it; click a term to keep
it emphasized. Point at a plot, or click it, to show that time.</p>
<div class="strip" aria-hidden="true"></div>
</aside>"""


def _scene(run: RunFile, model: Model, instants: Indices) -> Scene | None:
    """Return the scene at some of the samples, these among them; None if there is none."""
    if model.view is None or run.count < 2:
        return None
    few = scene_of(run, evenly(run.count, 2), model)
    assert few is not None
    series = sum(len(axes) for axes in few.points.values()) + 4 * len(few.vectors) + 1
    frames = max(100, min(_FRAMES, _FRAME_NUMBERS // series))
    return scene_of(run, np.union1d(evenly(run.count, frames), instants), model)


def _balance(
    run: RunFile, system: EquationSystem, packed: Packed, instants: Indices
) -> dict[str, Any] | None:
    """Return the terms of the equations at some of the samples, these among them; None without
    equations."""
    balance, model = system.balance, system.model
    count = sum(map(len, balance.terms.values()))
    if not count:
        return None
    most = max(100, min(_FRAMES, _FRAME_NUMBERS // (count + 1)))
    samples = np.union1d(evenly(run.count, most), instants)
    columns = run.columns(balance.needs, samples)
    values, units = model.declared_values, run.record.units
    return {
        "time": packed.add(columns["time"]),
        "equations": balance.to_json(columns, run.terms, values, units, packed.add),
    }


def _first_plot(every: Sequence[Section]) -> Plot | None:
    """Return the plot of λ, or of the coordinates of a free system."""
    titles = ("Multipliers", "Coordinates")
    return next((x.plots[0] for title in titles for x in every if x.title == title), None)


def _without_script(
    plot: Plot | None, colors: Mapping[str, str], scene: Scene | None, title: str
) -> str:
    """Return HTML for browsers in which scripts are off: the mechanism, a plot and a sentence."""
    images = [] if scene is None else [still_image(scene, title)]
    if plot is not None and len(plot.time) > 1:
        labels = [curve.label for curve in plot.curves]
        own = [colors.get(curve.constraint) for curve in plot.curves]
        images.append(curve_image(plot.time, plot.values, labels, plot.unit, own))
    said = "The animation, the plots and the values of terms need JavaScript, which is switched off"
    said += " here; equations, tables and the model are complete."
    return (
        f'<noscript><figure class="still">{"".join(images)}'
        f'<figcaption class="status stopped">{said}</figcaption></figure></noscript>'
    )


def _looked_at(catalogue: Catalogue) -> list[Curve]:
    """Return the curves whose extremes are listed."""
    energies = [curve for q in PANELS["energies"] for curve in catalogue.of(q.name)]
    groups = [*map(catalogue.of, ("q", "v", "multipliers")), catalogue.outputs()]
    listed = [g[i] for g in groups for i in chosen([c.name for c in g], _ROWS)]
    return listed + energies


def _residuals(run: RunFile) -> Extremes:
    extremes = Extremes(run.constraints, run.conserved_names)
    for columns in run.blocks(Extremes.COLUMNS):
        extremes.add(columns)
    return extremes


def _notable(every: list[Section], extremes: Mapping[Curve, Extreme]) -> list[Section]:
    """Return the sections without insignificant curves."""
    energies = [x for curve, x in extremes.items() if curve.name.startswith("energy")]
    scale = max((x.high - x.low for x in energies if x.high >= x.low), default=0.0)
    kept = []
    for section in every:
        for plot in section.plots:
            if plot.title == POWERS and len(plot.time):
                duration = float(plot.time[-1] - plot.time[0])
                plot.least = _ROUNDING * scale / duration if duration else 0.0
        plots = [part for plot in without_errors(section.plots) for part in by_scale(plot)]
        if plots:
            kept.append(section._replace(plots=plots))
    return kept


def _plots(every: list[Section], count: int, instants: int) -> str:
    """Return the placeholders of the plots; the script fills them in this order."""
    if not every:
        return "<p>There are no samples.</p>"
    parts = []
    drawn = min(len(plot.time) for section in every for plot in section.plots)
    if drawn < count:
        parts.append(
            f'<p class="note">Each plot shows at least {drawn} of the {count} samples: the'
            " smallest and"
            " the largest value of each curve in each interval of time, exactly as in the file."
            f" Zooming in shows no further samples. Numbers are read at {instants} samples that all"
            " plots, the animation and the equations have in common.</p>"
        )
    return "".join([*parts, *map(_section, every)])


def _residual_plots(every: list[Section]) -> str:
    """Return the places of the residuals, which come last."""
    return "".join(_section(x) for x in every if x.title == RESIDUALS_TITLE)


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


_ENDINGS = {
    "failed": "The run failed before its end time.",
    "interrupted": "The run was interrupted before its end time.",
    "stopped-by-event": "The run was stopped by an event.",
    "": "The file does not say how the run ended.",
}


def status(run: RunFile) -> str:
    """Return the banner of a run that is not complete; nothing for a complete one."""
    record = run.record
    if record.status == "completed":
        return ""
    title = _ENDINGS.get(record.status, f"The run has the status {record.status}.")
    said = f"<p>{message(record.message)}</p>" if record.message else ""
    samples = (
        f"<p>All of the {run.count} samples that were written are shown.</p>"
        if run.count
        else "<p>It has no samples to draw.</p>"
    )
    kind = "stopped" if record.status == "stopped-by-event" else "bad"
    return (
        f'<div class="status {kind}" role="alert"><strong>{escape(title)}</strong>'
        f"{said}{samples}</div>"
    )


def extremes_table(extremes: Mapping[Curve, Extreme], system: EquationSystem) -> str:
    """Return the table of extremes, with links at their times."""
    rows = []
    for curve, extreme in extremes.items():
        if math.isnan(extreme.low):
            continue
        symbol, shown = _named(curve, system)
        low, high = number(extreme.low), number(extreme.high)
        times = [time_button(extreme.low_time), time_button(extreme.high_time)]
        rows.append([symbol, shown, low, times[0], high, times[1]])
    head = ["Quantity", "Unit", "Least", "at t [s]", "Largest", "at t [s]"]
    if not rows:
        return "<p>There are no samples.</p>"
    return table("Extremes among all samples", head, rows, numeric=(2, 3, 4, 5), kind="extremes")


def moved(run: RunFile, system: EquationSystem) -> str:
    """Return the adjusted initial values; nothing without constraints."""
    correction = run.record.initial_correction
    if not run.constraints:
        return ""
    if not correction:
        return "<p>The given initial values satisfy the constraints.</p>"
    rows = []
    for name, (before, after) in list(correction.items())[:24]:
        base = name.rstrip("'")
        known = base in system.model.coordinate_names
        symbol = system.symbol(base, len(name) - len(base)) if known else escape(name)
        rows.append([symbol, number(before, 8), number(after, 8), number(after - before, 3)])
    head = ["Initial value", "Guessed", "Used", "Difference"]
    more = len(correction) - len(rows)
    note = f"<p class='note'>And {more} more.</p>" if more else ""
    caption = "Initial values adjusted to satisfy the constraints"
    return table(caption, head, rows, numeric=(1, 2, 3)) + note


def solver(run: RunFile, extremes: Extremes) -> str:
    """Return the table of the solver and its accuracy."""
    record = run.record
    options = record.options
    counts = ", ".join(f"{value} {name}" for name, value in record.counts.items())
    seconds = ", ".join(f"{name} {number(value, 3)} s" for name, value in record.seconds.items())
    scale = extremes.energy_scale
    balance = f"{number(extremes.energy_balance, 2)} J"
    if scale:
        balance += f", {number(extremes.energy_balance / scale, 2)} of {number(scale, 4)} J"
    rows = [
        ("Status", escape(record.status or "not recorded")),
        ("Message", message(record.message)),
        ("Method", escape(method_phrase(options))),
        ("Counts", escape(counts)),
        ("Time", escape(seconds)),
        ("Position residual", _worst(extremes.residual_position, record.scale_position)),
        ("Velocity residual", _worst(extremes.residual_velocity, record.scale_velocity)),
        ("Equation residual", number(extremes.residual_equation, 2)),
        ("Energy balance", balance),
    ]
    return table("Method and accuracy", ["", ""], [row for row in rows if row[1]], kind="facts")


def provenance(run: RunFile) -> str:
    """Return the information needed to reproduce the run."""
    record = run.record
    options = ", ".join(f"{k} = {_plain(v)}" for k, v in record.options.items() if v is not None)
    versions = f"run by lagcli {record.lagcli_version}" if record.lagcli_version else ""
    page = f"page by lagcli {__version__}"
    rows = [
        ("File", own_words(os.path.basename(run.name)) if os.path.exists(run.name) else ""),
        ("Samples", str(run.count)),
        ("Version", escape(", ".join(x for x in (versions, page) if x))),
        ("Model", f"<code>sha256 {escape(record.model_sha256)}</code>"),
        *(
            (f"Input {escape(name)}", f"{escape(x.file)} <code>sha256 {escape(x.sha256)}</code>")
            for name, x in record.inputs.items()
            if x.file
        ),
        ("Options", own_words(options)),
    ]
    return table("Provenance", ["", ""], [row for row in rows if row[1]], kind="facts")


def _named(curve: Curve, system: EquationSystem) -> tuple[str, str]:
    """Return the symbol and the unit of a curve."""
    place, model = curve.place, system.model
    symbol = own_words(curve.name)
    if curve.field in ("q", "v") and place:
        symbol = system.symbol(model.coordinate_names[place[0]], int(curve.field == "v"))
    elif curve.field == "multipliers" and place:
        name = model.constraint_names[place[0]]
        symbol = f'{system.multiplier(name)} <span class="name">{escape(name)}</span>'
    elif curve.field in BY_NAME:
        symbol = f"{escape(curve.label)}, {escape(BY_NAME[curve.field].description)}"
    return symbol, unit(curve.unit)


def time_button(time: float, digits: int = 6) -> str:
    """Return a time as a button that moves the animation to it, in HTML."""
    shown = number(time, digits)
    title = "Show this time in the animation and the plots"
    return f'<button type="button" data-time="{time!r}" title="{title}">{shown}</button>'


def method_phrase(options: Mapping[str, Any]) -> str:
    """Return method, formulation and tolerances of a run in words."""
    method, formulation = options.get("method"), options.get("formulation")
    rtol, atol = options.get("rtol"), options.get("atol")
    parts = [f"{method} with {formulation}" if formulation else method]
    if isinstance(atol, Mapping):
        atol = ", ".join(f"{name} {x:g}" for name, x in atol.items())
    absolute = "by size" if atol is None else atol if isinstance(atol, str) else f"{atol:g}"
    tolerances = f"rtol {rtol:g}, atol {absolute}" if rtol else ""
    return ", ".join(p for p in (*parts, tolerances) if p)


def _worst(residual: Array, scale: Array) -> str:
    """Return the largest residual relative to its constraint's scale."""
    ratios = [r / s for r, s in zip(residual, scale, strict=True) if r == r and s == s and s > 0]
    return f"{number(max(ratios), 2)}, relative to the constraint's scale" if ratios else ""


def _plain(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.9g}"
    if isinstance(value, (list, tuple)) and len(value) > 8:
        return f"{len(value)} values"
    return str(value)


#: Largest number of entries that are listed: of more, the first ones and the last.
_FIRST, _LAST = 60, 20
#: Largest number of recorded columns in a table.
_COLUMNS = 8


def events_section(run: RunFile) -> str:
    """Return the section of a run with contacts or events; nothing for any other."""
    log = run.record.events
    if log is None:
        return ""
    sentences = "".join(f"<p>{with_code(text)}.</p>" for text in event_sentences(log.to_mapping()))
    entries = _entries(run, log) if len(log) else ""
    recorded = _recorded(run, log.records, log) if 0 < len(log.records.columns) <= _COLUMNS else ""
    return (
        f'<section id="events"><h2>Contacts and events</h2>{sentences}{entries}{recorded}</section>'
    )


def events_contents(run: RunFile) -> list[tuple[str, str]]:
    """Return the entry in the table of contents; none for a run without contacts and events."""
    return [] if run.record.events is None else [("events", "Contacts and events")]


def _recorded(run: RunFile, records: EventRecords, log: EventLog) -> str:
    """Return the table of recorded columns."""
    places = _listed(len(records.entry))
    rows = []
    for place in places:
        entry, values = int(records.entry[place]), records.of(place)
        cells = [_limits(values[name]) if name in values else "" for name in records.columns]
        rows.append([time_button(float(log.time[entry]), 9), own_words(log.names[entry]), *cells])
    head = ["t [s]", "Event", *(_headed(run, name) for name in records.columns)]
    caption = "What events recorded, before → after"
    numeric = (0, *range(2, len(head)))
    return table(caption, head, rows, numeric=numeric, kind="extremes") + _left_out(
        len(records.entry) - len(places)
    )


def _limits(both: tuple[float, float]) -> str:
    """Return the values before and after an event, or one if they are equal."""
    return " → ".join(dict.fromkeys(number(x) for x in both))


def _headed(run: RunFile, name: str) -> str:
    column, units = read_column_name(name, run.coordinates, run.constraints), run.record.units
    unit = units.get(name) if column is None else unit_of_column(column, units)
    return f"{name} [{unit}]" if unit else name


def _listed(count: int) -> list[int]:
    """Return the indices of the entries that are listed."""
    places = list(range(count))
    return places if count <= _FIRST + _LAST else places[:_FIRST] + places[-_LAST:]


def _left_out(count: int) -> str:
    return f"<p class='note'>And {count} more between them.</p>" if count else ""


def _impulse_unit(run: RunFile, log: EventLog) -> str:
    """Return the unit of the impulses: that of λ times s, or a general one if they differ."""
    struck = {name for name in log.names if name in run.constraints}
    columns = [ColumnName("multipliers", name) for name in struck]
    units = {axis_unit(unit_of_column(c, run.record.units)) for c in columns}
    common = units.pop() if len(units) == 1 else ""
    return f"{common} s" if common else "λ s"


def _entries(run: RunFile, log: EventLog) -> str:
    places = _listed(len(log))
    struck = set(log.nonzero_impulses.row.tolist())
    rows = []
    for i in places:
        name, impulse, mode = log.names[i], "", ""
        if name in run.constraints and i in struck:
            impulse = number(float(log.nonzero_impulses.at([i], [run.constraints.index(name)])[0]))
        if name in log.rows:
            mode = MODES[log.mode(i, log.rows.index(name))]
        amounts = [number(x[i], 4) if x[i] else "" for x in (log.loss, log.supplied, log.work)]
        time = time_button(float(log.time[i]), 9)
        rows.append([time, own_words(name), log.kinds[i], mode, impulse, *amounts])
    head = ["t [s]", "Name", "What", "Mode after", f"Impulse [{_impulse_unit(run, log)}]"]
    head += ["Loss [J]", "Supplied [J]", "Work [J]"]
    caption = "What happened, in order"
    return table(caption, head, rows, numeric=(0, 4, 5, 6, 7), kind="extremes") + _left_out(
        len(log) - len(places)
    )


#: Largest number of multipliers with a tornado chart, and of listed coordinates.
_CHARTS, _COORDINATES = 12, 24
_HALF, _HEIGHT = 60.0, 12  # of a bar, in units of its picture


def sensitivity_section(catalogue: Catalogue) -> str:
    """Return the section of a run with derivatives; nothing for any other.

    A tornado chart of each multiplier shows the change of its peak for 1 % more of each parameter:
    the derivative of the peak is that of the multiplier at its time.
    """
    run = catalogue.run
    if not run.sensitivity or not run.count:
        return ""
    known = run.values
    values = np.array([known[name] for name in run.sensitivity])
    charts = "".join(_tornado(catalogue, i, values) for i in chosen(run.constraints, _CHARTS))
    about = (
        '<p class="hint">To first order, and for each parameter alone. Of a parameter whose value'
        " is 0 there is no percentage.</p>"
    )
    return (
        f'<section id="sensitivities"><h2>Sensitivities</h2>{about}{charts}{_last(catalogue)}'
        "</section>"
    )


def sensitivity_contents(run: RunFile) -> list[tuple[str, str]]:
    """Return the entry in the table of contents."""
    return [("sensitivities", "Sensitivities")] if run.sensitivity and run.count else []


def _tornado(catalogue: Catalogue, constraint: int, values: Array) -> str:
    """Return the tornado chart of the peak of a multiplier."""
    run, curve = catalogue.run, catalogue.of("multipliers")[constraint]
    peak, when, slopes = 0.0, 0.0, np.zeros(len(run.sensitivity))
    for block in run.blocks(("time", "multipliers", "dmultipliers")):
        multiplier = np.nan_to_num(block["multipliers"][:, constraint])
        if not len(multiplier):
            continue
        place = int(np.argmax(np.abs(multiplier)))
        if abs(multiplier[place]) > peak:
            peak, when = float(abs(multiplier[place])), float(block["time"][place])
            slopes = np.sign(multiplier[place]) * block["dmultipliers"][place, constraint]
    changes = 0.01 * np.abs(values) * slopes
    largest = np.abs(changes).max(initial=0.0)
    rows = []
    for i in sorted(range(len(values)), key=lambda i: -abs(changes[i])):
        name = run.sensitivity[i]
        rows.append(
            [
                escape(name),
                _bar(changes[i] / largest) if changes[i] else "",
                number(float(changes[i])) if values[i] else "",
                number(float(slopes[i])),
                f"{number(float(values[i]))} {unit(_unit(run, name))}".rstrip(),
            ]
        )
    shown = unit(curve.unit)
    title = f"Peak of |{escape(curve.label)}|, {number(peak)} {shown}".rstrip()
    head = ["Parameter", "", "Change for +1 %" + (f" [{shown}]" if shown else "")]
    head += ["Derivative, SI", "Value"]
    return table(f"{title}, at {number(when)} s", head, rows, numeric=(2, 3))


def _bar(part: float) -> str:
    """Return a bar to the right or to the left of the middle."""
    length = _HALF * abs(part)
    start, kind = (_HALF, "up") if part > 0 else (_HALF - length, "down")
    return (
        f'<svg class="tornado" viewBox="0 0 {2 * _HALF:g} {_HEIGHT}" width="{2 * _HALF:g}"'
        f' height="{_HEIGHT}" aria-hidden="true"><rect class="{kind}" x="{start:.4g}" y="1"'
        f' width="{length:.4g}" height="{_HEIGHT - 2}"/><path d="M{_HALF:g} 0V{_HEIGHT}"/></svg>'
    )


def _last(catalogue: Catalogue) -> str:
    """Return the derivatives of the coordinates at the last sample."""
    run, curves = catalogue.run, catalogue.of("q")
    last = run.columns(("time", "q", "dq"), np.array([run.count - 1], dtype=np.intp))
    places: Sequence[int] = chosen(run.coordinates, _COORDINATES)
    rows = [
        [
            escape(curves[j].label),
            unit(curves[j].unit),
            number(float(last["q"][0, j])),
            *(number(float(x)) for x in last["dq"][0, j]),
        ]
        for j in places
    ]
    head = ["Coordinate", "Unit", "Value", *(f"by {escape(x)}" for x in run.sensitivity)]
    caption = f"Coordinates at t = {number(float(last['time'][0]))} s, and their derivatives, SI"
    return table(caption, head, rows, numeric=range(2, len(head)))


def _unit(run: RunFile, name: str) -> str | None:
    """Return the unit of a parameter or of an initial value."""
    base = name.removesuffix("'")
    stated = run.record.units.get(base)
    if base == name or not stated:
        return stated
    return unit_quotient(stated, "s")
