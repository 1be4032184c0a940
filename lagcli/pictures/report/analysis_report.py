"""The page of an analysis: results in tables and pictures, equations, provenance."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from functools import partial
from html import escape
from typing import Any, NamedTuple

import numpy as np

from lagcli.analysis.fit.result import FitResult
from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.presentation.formulas import Formulas
from lagcli.errors import UsageError
from lagcli.model.loader import load_text
from lagcli.model.model import Model
from lagcli.model.result_units import result_units
from lagcli.pictures.page import asset, number, table, unit
from lagcli.pictures.plots.analysis_plot import draw_result, plot_analysis
from lagcli.pictures.report.equations import EquationSystem
from lagcli.pictures.report.report_page import AnalysisSection, picture, report_page, section_html
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
        from lagcli.pictures.report.sweep_report import sweep_model, sweep_sections

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


#: Largest numbers of modes, components of shapes, rows and columns of matrices, and equilibria.
_MODES, _COMPONENTS, _ENTRIES, _LISTED = 12, 24, 12, 24
#: Components below this part of the largest of a shape are omitted.
_NONE = 1e-9


def content_sections(content: Mapping[str, Any], units: Mapping[str, str]) -> list[AnalysisSection]:
    """Return the sections of an analysis file.

    Parameters
    ----------
    content : mapping
        Content printed by ``--json``.
    units : mapping of str to str
        Units of coordinates, and of λ by column.
    """
    match content["command"]:
        case "modes":
            return [_point(content, units), *_modes(content, units)]
        case "linearize":
            return [_point(content, units), _matrices(content)]
        case "equilibrium" if "branches" in content:
            return _branches(content, units)
        case "equilibrium":
            return [_equilibria(content, units)]
        case "compare" if "runs" in content:
            return _comparison(content, units)
        case "compare":
            return _two_models(content, units)
    return []


def _unit_of(name: str, units: Mapping[str, str], rate: bool = False) -> str:
    found = units.get(name, "")
    if not rate or not found:
        return unit(found)
    return unit("1/s" if found == "1" else f"{found}/s")


def _named(name: str) -> str:
    return f'<span class="name">{escape(name)}</span>'


def _point(content: Mapping[str, Any], units: Mapping[str, str]) -> AnalysisSection:
    """Return the description of the point of linearization."""
    point = content["operating_point"]
    rows = [[_named(q), number(x, 8), _unit_of(q, units)] for q, x in point["q"].items()]
    rows += [
        [_named(f"{q}'"), number(x, 8), _unit_of(q, units, rate=True)]
        for q, x in point["v"].items()
        if x
    ]
    rows += [
        [_named(f"lambda.{c}"), number(x, 8), _unit_of(f"lambda.{c}", units)]
        for c, x in point["multipliers"].items()
    ]
    rows += [[_named(c["name"]), c["state"], ""] for c in point.get("contacts", ())]
    shown = rows[: 3 * _LISTED]
    note = "".join(f'<p class="note">{escape(x[0].upper() + x[1:])}.</p>' for x in content["notes"])
    body = table(
        f"About {escape(point['name'])}, t = {number(point['time'])} s",
        ["Quantity", "Value", "Unit"],
        shown,
        numeric=(1,),
    )
    return AnalysisSection("point", "Operating point", body + _more(rows, shown) + note)


def _more(rows: Sequence[Any], shown: Sequence[Any]) -> str:
    rest = len(rows) - len(shown)
    return f'<p class="note">And {rest} more in the file.</p>' if rest else ""


def _modes(content: Mapping[str, Any], units: Mapping[str, str]) -> list[AnalysisSection]:
    every = content["modes"]
    if not every:
        nothing = "<p>None: the constraints determine the motion.</p>"
        return [AnalysisSection("modes", "Modes", nothing)]
    rows = []
    for mode in every:
        s = complex(*mode["eigenvalue"])
        swings = bool(s.imag)
        rows.append(
            [
                str(mode["number"]),
                _complex(s),
                number(mode["frequency"]) if swings else "",
                number(mode["damping_ratio"], 4) if swings else "",
                number(mode["time_constant"], 4) if mode["time_constant"] else "",
                escape(mode["kind"]),
            ]
        )
    head = ["Mode", "Eigenvalue [1/s]", "Frequency [Hz]", "Damping ratio", "Time constant [s]"]
    body = table("By the magnitude of the eigenvalue", [*head, "Kind"], rows, numeric=(1, 2, 3, 4))
    drawn = picture(
        partial(plot_analysis, content, (), units=units), "Eigenvalues in the complex plane"
    )
    sections = [AnalysisSection("modes", "Modes", body + drawn)]
    parts = ("position", "δ", ""), ("multipliers", "δλ ", "lambda.")
    shown = every[:_MODES]
    tables = []
    for part, sign, prefix in parts:
        names = list(every[0][part])
        rows = [
            [
                f"{sign}{_named(name)}",
                _unit_of(prefix + name, units),
                *(_component(mode[part], name) for mode in shown),
            ]
            for name in names[:_COMPONENTS]
        ]
        if rows:
            head = [
                "Multiplier" if prefix else "Coordinate",
                "Unit",
                *(f"Mode {mode['number']}" for mode in shown),
            ]
            caption = "δλ in the same scale" if prefix else "Shapes"
            numeric = range(2, 2 + len(shown))
            tables.append(table(caption, head, rows, numeric=list(numeric)) + _more(names, rows))
    about = (
        '<p class="note">The coordinate that carries the most kinetic energy is 1; complex'
        " components are magnitude and phase. An oscillation of amplitude ε about λ₀ has"
        " λ(t) = λ₀ + ε Re(δλ e<sup>st</sup>). <code>lagcli animate FILE --mode N</code> shows the"
        " motion.</p>"
    )
    return [*sections, AnalysisSection("shapes", "Shapes", "".join(tables) + about)]


def _complex(s: complex) -> str:
    real, imaginary = number(s.real, 9), number(abs(s.imag), 9)
    if not s.imag:
        return real
    return f"{real} ± {imaginary} i" if s.real else f"± {imaginary} i"


def _component(shape: Mapping[str, Sequence[float]], name: str) -> str:
    z, largest = complex(*shape[name]), max(abs(complex(*x)) for x in shape.values())
    if abs(z) <= _NONE * largest:
        return "0"
    if abs(z.imag) <= _NONE * abs(z):
        return number(z.real, 4)
    return f"{number(abs(z), 4)} ∠ {math.degrees(math.atan2(z.imag, z.real)):.0f}°"


def _matrices(content: Mapping[str, Any]) -> AnalysisSection:
    names = ["A", "B", "C", "D"] + ["E"] * (content["form"] == "descriptor")
    lists = {"states x": "states", "inputs u": "inputs", "outputs y": "outputs"}
    parts = [
        f"<p>{escape(label)}: {', '.join(map(_named, content[key]))}</p>"
        for label, key in lists.items()
        if content[key]
    ]
    columns = {"A": "states", "E": "states", "B": "inputs", "C": "states", "D": "inputs"}
    for name in names:
        rows = content[name]
        if not rows or not rows[0]:
            continue
        if len(rows) > _ENTRIES or len(rows[0]) > _ENTRIES:
            filled = sum(1 for row in rows for x in row if x)
            parts.append(
                f"<p>{name}: {len(rows)} by {len(rows[0])}, {filled} entries are not zero;"
                " the file has them.</p>"
            )
            continue
        head = ["", *map(_named, content[columns[name]])]
        label = content["outputs"] if name in "CD" else content["states"]
        lines = [
            [_named(row), *(number(x, 8) for x in values)]
            for row, values in zip(label, rows, strict=False)
        ]
        parts.append(table(name, head, lines, numeric=list(range(1, len(head)))))
    equation = "ẋ = A x" if content["form"] == "reduced" else "E ẋ = A x"
    equation += " + B u" * bool(content["inputs"])
    return AnalysisSection("linear", f"Linear model, {equation}", "".join(parts))


def _equilibria(content: Mapping[str, Any], units: Mapping[str, str]) -> AnalysisSection:
    found = content["equilibria"]
    if not found:
        return AnalysisSection("equilibria", "Equilibria", "<p>None were found.</p>")
    shown = found[:_LISTED]
    head = ["Quantity", "Unit", *(f"No. {i}" for i in range(1, 1 + len(shown)))]
    rows = [["Stability", "", *(escape(x["stability"]) for x in shown)]]
    rows += [
        [_named(q), _unit_of(q, units), *(number(x["q"][q], 8) for x in shown)]
        for q in shown[0]["q"]
    ]
    rows += [
        [_named(f"{q}'"), _unit_of(q, units, rate=True), *(number(x["v"][q], 8) for x in shown)]
        for q in shown[0]["v"]
        if any(x["v"][q] for x in shown)
    ]
    rows += [
        [
            _named(f"lambda.{c}"),
            _unit_of(f"lambda.{c}", units),
            *(number(x["multipliers"][c], 8) if c in x["multipliers"] else "" for x in shown),
        ]
        for c in dict.fromkeys(c for x in shown for c in x["multipliers"])
    ]
    rows += [
        [_named(c["name"]), "", *(escape(x["contacts"][k]["state"]) for x in shown)]
        for k, c in enumerate(shown[0].get("contacts", ()))
    ]
    if any(x["potential"] is not None for x in shown):
        rows.append(["Potential energy", "J", *(number(x["potential"], 8) for x in shown)])
    body = table(
        f"{len(found)} from {content['starts']} starts" if content["starts"] > 1 else "Found",
        head,
        rows,
        numeric=list(range(2, len(head))),
    )
    return AnalysisSection("equilibria", "Equilibria", body + _more(found, shown))


def _branches(content: Mapping[str, Any], units: Mapping[str, str]) -> list[AnalysisSection]:
    name = content["parameter"]
    drawn = picture(
        partial(plot_analysis, content, (), units=units), f"Branches of equilibria over {name}"
    )
    rows = []
    for i, branch in enumerate(content["branches"]):
        stable, at = branch["stable"], branch["parameter"]
        origin = "" if branch["origin"] is None else f"branch {branch['origin']}"
        rows.append(
            [
                str(i), origin, str(len(at)), number(min(at)), number(max(at)),
                f"{sum(stable)} of {len(stable)} points",
            ]
        )  # fmt: skip
    head = ["Branch", "Leaves", "Points", f"{escape(name)} from", "to", "Stable"]
    listed = table("Branches", head, rows, numeric=(2, 3, 4))
    sections = [AnalysisSection("branches", f"Equilibria over {name}", drawn + listed)]
    points = content["special_points"]
    if points:
        first = points[0]
        head = ["Point", "Branch", f"{escape(name)} [{_unit_of(name, units) or '1'}]"]
        head += ["Frequency [rad/s]"]
        head += [*map(_named, first["q"]), *(_named(f"lambda.{c}") for c in first["multipliers"])]
        rows = [
            [
                escape(_special(x)),
                str(x["branch"]),
                number(x["parameter"], 12),
                "" if x["frequency"] is None else number(x["frequency"], 8),
                *(number(value) for part in ("q", "multipliers") for value in x[part].values()),
            ]
            for x in points
        ]
        numeric = list(range(2, len(head)))
        body = table(
            "Folds, branch points, Hopf points, changes of contacts", head, rows, numeric=numeric
        )
        sections.append(AnalysisSection("special", "Bifurcations", body))
    return sections


def _special(point: Mapping[str, Any]) -> str:
    note = point.get("crossing") or point.get("contact")
    return str(point["kind"]) + (f" ({note})" if note else "")


def _comparison(content: Mapping[str, Any], units: Mapping[str, str]) -> list[AnalysisSection]:
    reference, head = content["reference"], ["Formulation", "Method", "rtol", "Status"]
    head += [
        "Position residual",
        "Velocity residual",
        "Error of the energy balance [J]",
        "Largest Δq",
        "Largest Δλ",
    ]
    head += ["Steps", "Time [s]"]
    rows = [
        [
            escape(run["formulation"]),
            escape(run["method"]),
            number(run["rtol"], 3),
            escape(run["status"]),
            *(
                number(run[key], 2)
                for key in (
                    *("drift_position", "drift_velocity", "energy"),
                    *("difference_q", "difference_lambda"),
                )
            ),
            str(run["steps"]),
            number(run["seconds"], 2),
        ]
        for run in (reference, *content["runs"])
    ]
    body = table("The first row is the reference", head, rows, numeric=list(range(3, 12)))
    drawn = picture(
        partial(plot_analysis, content, (), units=units), "Residuals and differences over time"
    )
    return [AnalysisSection("runs", "Comparison", body + drawn)]


def _two_models(content: Mapping[str, Any], units: Mapping[str, str]) -> list[AnalysisSection]:
    rows = []
    for part, prefix in (("coordinates", ""), ("multipliers", "lambda."), ("outputs", "")):
        for x in content[part]:
            name = prefix + x["name"]
            relative = number(x["difference"] / x["size"], 2) if x["size"] else ""
            explained = "explained: see below" if x.get("explained") else ""
            rows.append(
                [
                    _named(name), number(x["difference"], 3), _unit_of(name, units),
                    number(x["time"]), relative, explained,
                ]
            )  # fmt: skip
    names = [escape(content[x]) for x in ("model", "other")]
    head = ["Quantity", "Largest difference", "Unit", "At time [s]", "Relative", "Remark"]
    body = table(f"{names[0]} and {names[1]}", head, rows, numeric=(1, 3, 4))
    ended = [s for s in content["status"] if s != "completed"]
    body = f'<p class="status bad">{escape(", ".join(content["status"]))}</p>' * bool(ended) + body
    if any(x["explained"] for x in content["multipliers"]):
        body += (
            '<p class="note">Explained: the Lagrangians differ by F times the constraint, which'
            " does not change the motion but reduces λ by F.</p>"
        )
    for name, key in zip(names, ("only_first", "only_second"), strict=True):
        if content[key]:
            listed = ", ".join(map(_named, content[key]))
            body += f'<p class="note">Only in {name}: {listed}.</p>'
    drawn = picture(
        partial(plot_analysis, content, (), units=units), "Differences and multipliers over time"
    )
    return [AnalysisSection("models", "Two models", body + drawn)]


def fit_sections(result: FitResult) -> list[AnalysisSection]:
    """Return the sections of a fit."""
    rows = []
    for i, name in enumerate(result.names):
        known = math.isfinite(result.standard_errors[i])
        note = f"at its bound {result.active[i]}" if result.active[i] else ""
        note = note or ("" if known else "not identified by the data")
        interval = f"{number(result.low[i], 8)} to {number(result.high[i], 8)}" if known else ""
        rows.append(
            [
                _named(name), number(result.values[i], 8), unit(result.units.get(name)),
                number(result.standard_errors[i], 2) if known else "", interval,
                number(result.start[i]), escape(note),
            ]
        )  # fmt: skip
    percent = f"{100 * result.level:g} % interval ({escape(result.intervals)})"
    head = ["Quantity", "Value", "Unit", "Standard error", percent, "Start", "Remark"]
    ended = "" if result.converged else f'<p class="status bad">{escape(result.message)}</p>'
    fitted = ended + table("Fitted quantities", head, rows, numeric=(1, 3, 4, 5))
    facts = [
        ("Measured values", str(result.count)),
        ("Chi-square", f"{number(result.chi_square)} for {result.freedom} degrees of freedom"),
        ("Probability", "" if math.isnan(result.probability) else number(result.probability, 2)),
        ("Standard deviations", "estimated from the residuals" * result.sigma_estimated),
        ("Runs", f"{result.runs}, {sum(result.failures.values())} failed"),
    ]
    if len(result.costs) > 1:
        agreeing = f"{result.agreeing_starts} of {len(result.costs)} end at these values"
        facts.append(("Starts", agreeing))
    fitted += table("The fit", ["", ""], [x for x in facts if x[1]], kind="facts")
    drawn = picture(partial(draw_result, result, ()), "Measured values, the model and residuals")
    correlation = table(
        "Correlation of the errors",
        ["", *map(_named, result.names)],
        [
            [_named(name), *(number(x, 3) for x in row)]
            for name, row in zip(result.names, np.asarray(result.correlation), strict=True)
        ],
        numeric=list(range(1, 1 + len(result.names))),
    )
    combinations = "".join(
        "<p>Not identified: "
        + ", ".join(f"{_named(n)} {number(x, 3)}" for n, x in zip(c.names, c.changes, strict=True))
        + "</p>"
        for c in result.combinations
    )
    return [
        AnalysisSection("fit", "Fitted quantities", fitted),
        AnalysisSection("data", "Data and model", drawn),
        AnalysisSection("correlation", "Correlation", correlation + combinations),
    ]


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
        found = modes(model, equilibrium=about == "equilibrium")
    else:
        try:
            found = modes(model, at=float(about))
        except ValueError:
            raise UsageError(
                f"--modes {about}: give start, equilibrium or a time of the run in s: --modes start"
            ) from None
    return content_sections(describe_modes(found), result_units(model))
