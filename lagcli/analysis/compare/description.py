"""Results of `lagcli compare` as JSON values and as text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lagcli.analysis.compare.comparison import ComparedRun, FormulationComparison
from lagcli.analysis.compare.two_models import ModelComparison, QuantityDifference
from lagcli.analysis.output.tables import (
    ModelName,
    Phrase,
    PlotPlace,
    Remark,
    ResultColumn,
    ResultSection,
    ResultTable,
    SectionBlock,
    TextColumn,
    names_of,
    unit_of,
)
from lagcli.analysis.output.text import width
from lagcli.arrays import Array, Indices
from lagcli.prose import wrapped
from lagcli.trajectory.samples import Samples
from lagcli.trajectory.trajectory import Trajectory

_FORMULATIONS = {"ggl": "GGL", "maggi": "Maggi", "second": "second kind"}
#: Number of points of a curve in a file.
_POINTS = 400
_CURVES = 12  # number of multipliers with curves in a file of two models: those that differ most
_SHOWN = 12  # largest number of names in a line
_IDENTIFYING = 3  # columns of formulation, method and tolerance
#: Differences below this part of the size are rounding errors.
_ROUNDING = 1e-13
#: Largest residual of constraints, relative to their terms, of a run that is still the model's.
_VIOLATED = 0.01


def describe_comparison(comparison: FormulationComparison) -> dict[str, Any]:
    """Return the content of a comparison of formulations and methods."""
    exact = comparison.reference.samples
    assert exact is not None
    return {
        "command": "compare",
        "model": comparison.model.name,
        "unique_multipliers": comparison.unique,
        "reference": _run(comparison.reference),
        "runs": [{**_run(run), "curves": _curves(run, exact)} for run in comparison.runs],
    }


def _run(run: ComparedRun) -> dict[str, Any]:
    return {
        "formulation": run.row.formulation,
        "method": run.row.method,
        "rtol": run.row.rtol,
        "status": run.status,
        "message": run.message,
        "drift_position": _number(run.drift_position),
        "drift_velocity": _number(run.drift_velocity),
        "energy": _number(run.energy),
        "difference_q": _number(run.difference_q),
        "difference_lambda": _number(run.difference_lambda),
        "steps": run.steps,
        "evaluations": run.evaluations,
        "seconds": _number(run.seconds),
    }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _curves(run: ComparedRun, exact: Samples) -> dict[str, list[float]]:
    """Return the residual, the energy balance and the difference of q as functions of time."""
    samples = run.samples
    if samples is None or not len(samples.time):
        return {"time": [], "residual": [], "energy": [], "q": []}
    count = min(len(samples.time), len(exact.time))
    chosen = _thinned(count)
    levels = [samples.residual_position, samples.residual_velocity]
    residual = np.nan_to_num(np.abs(np.hstack(levels))).max(axis=1, initial=0.0)
    off = np.abs(samples.q[:count] - exact.q[:count]).max(axis=1, initial=0.0)
    values: dict[str, Array] = {
        "time": samples.time,
        "residual": residual,
        "energy": np.abs(samples.energy_balance),
        "q": off,
    }
    return {name: x[chosen].tolist() for name, x in values.items()}


def describe_models(comparison: ModelComparison, first: str, second: str) -> dict[str, Any]:
    """Return the content of a comparison of two models with these names."""
    return {
        "command": "compare",
        "model": first,
        "other": second,
        "status": [comparison.first.status, comparison.second.status],
        "coordinates": [_difference(x) for x in comparison.coordinates],
        "multipliers": [
            {**_difference(x), "explained": x.name in comparison.explained}
            for x in comparison.multipliers
        ],
        "outputs": [_difference(x) for x in comparison.outputs],
        "only_first": list(comparison.only_first),
        "only_second": list(comparison.only_second),
        "curves": _both(comparison),
    }


def _both(comparison: ModelComparison) -> dict[str, Any]:
    """Return the largest difference of the coordinates, and both models' λ, as functions of
    time."""
    first, second = comparison.first, comparison.second
    count = min(len(first.time), len(second.time))
    chosen = _thinned(count)

    def columns(run: Trajectory, field: str, axis: str, names: Sequence[str]) -> Array:
        places = [getattr(run, axis).index(name) for name in names]
        return np.asarray(getattr(run, field)[chosen][:, places])

    q = [x.name for x in comparison.coordinates]
    most = sorted(comparison.multipliers, key=lambda x: -x.difference)[:_CURVES]
    constraints = [x.name for x in comparison.multipliers if x in most]
    off = columns(second, "q", "coordinates", q) - columns(first, "q", "coordinates", q)
    one, other = (columns(x, "multipliers", "constraints", constraints) for x in (first, second))
    return {
        "time": first.time[chosen].tolist(),
        "q": np.abs(off).max(axis=1, initial=0.0).tolist(),
        "multipliers": {
            name: {"first": one[:, i].tolist(), "second": other[:, i].tolist()}
            for i, name in enumerate(constraints)
        },
    }


def _thinned(count: int) -> Indices:
    return np.unique(np.linspace(0, count - 1, min(count, _POINTS)).astype(int))


def _difference(x: QuantityDifference) -> dict[str, Any]:
    return {"name": x.name, "difference": x.difference, "time": x.time, "size": x.size}


def format_comparison(content: Mapping[str, Any]) -> str:
    """Return the text that ``lagcli compare`` prints."""
    if "other" in content:
        return "\n".join(_two_models(content))
    return "\n".join(_formulations(content))


def _formulations(content: Mapping[str, Any]) -> list[str]:
    reference = content["reference"]
    table = _runs_table(content["runs"])
    names = table._replace(columns=table.columns[:_IDENTIFYING]).lines()[1:]
    lines = wrapped(
        f"{content['model']}: compared with {reference['formulation']}, {reference['method']},"
        f" rtol {reference['rtol']:.0e}",
        width(),
        "",
        " " * 4,
    )
    for number, (head, *rows) in enumerate(table.parts(_IDENTIFYING)):
        lines += ["", head]
        for run, row, identified in zip(content["runs"], rows, names, strict=True):
            if run["status"] != "not available":
                lines.append(row)
            elif not number:
                lines += wrapped(run["message"], width(), f"{identified}  ", " " * 4)
    notes = []
    for run in content["runs"]:
        name = _FORMULATIONS.get(run["formulation"], run["formulation"])
        if run["status"] == "not available":
            continue
        if run["status"] != "completed":
            notes.append(f"{name}, {run['method']}: {run['status']}: {run['message']}")
        drifts = (run["drift_position"], run["drift_velocity"], 0.0)
        violated = max(x for x in drifts if x is not None)
        if violated > _VIOLATED:
            notes.append(
                f"{name}, {run['method']}, rtol {run['rtol']:.0e}: the constraints are violated by"
                f" {violated:.2g} of their terms, so that this is not the motion of the model"
            )
    if not content["unique_multipliers"]:
        notes.append("the constraints are redundant: λ is not unique and not compared")
    notes.append(
        "largest values of: pos. and vel., residuals of position and of velocity constraints"
        " relative to their terms; E, the error of the energy balance relative to the energy; Δq"
        " and Δλ, differences relative to the largest value of the same unit"
    )
    for note in notes:
        lines += wrapped(f"note: {note}", width(), "  ", " " * 8)
    return lines


def _runs_table(runs: Sequence[Mapping[str, Any]], caption: str = "") -> ResultTable:
    """Return the table of runs, with the names of formulations as text shows them."""

    def values(key: str) -> list[Any]:
        return [run[key] for run in runs]

    formulations = [_FORMULATIONS.get(x, x) for x in values("formulation")]
    figures = (
        ("drift_position", "Position residual", "pos."),
        ("drift_velocity", "Velocity residual", "vel."),
        ("energy", "Error of the energy balance [J]", "E"),
        ("difference_q", "Largest Δq", "Δq"),
        ("difference_lambda", "Largest Δλ", "Δλ"),
    )

    def rounded(key: str) -> list[str]:
        return ["–" if x is None else f"{x:.0e}" for x in values(key)]

    seconds = ["" if x is None else f"{x:.2f}" for x in values("seconds")]
    columns = (
        ResultColumn(
            "Formulation",
            values("formulation"),
            text=TextColumn("formulation", "  {:<11}", formulations),
        ),
        ResultColumn("Method", values("method"), text=TextColumn("method", " {:<7}")),
        ResultColumn("rtol", values("rtol"), "", 3, TextColumn("rtol", " {:>5}", rounded("rtol"))),
        ResultColumn("Status", values("status")),
        *(
            ResultColumn(label, values(key), "", 2, TextColumn(head, " {:>5}", rounded(key)))
            for key, label, head in figures
        ),
        ResultColumn("Steps", values("steps"), text=TextColumn("steps", " {:>6}")),
        ResultColumn("Time", values("seconds"), "s", 2, TextColumn("CPU s", " {:>6}", seconds)),
    )
    return ResultTable(Phrase(caption), columns)


def _two_models(content: Mapping[str, Any]) -> list[str]:
    lines = [f"{content['model']} and {content['other']}, differences of common quantities:"]
    for kind in ("coordinates", "multipliers", "outputs"):
        for x in content[kind]:
            name = f"lambda.{x['name']}" if kind == "multipliers" else x["name"]
            small = x["difference"] <= _ROUNDING * x["size"]
            text = f"  {name:<24}"
            if small:
                text += "equal"
            else:
                share = (
                    f", {x['difference'] / x['size']:.1e} of its largest value" if x["size"] else ""
                )
                text += f"{x['difference']:.3e} at t = {x['time']:.6g} s{share}"
            if x.get("explained"):
                text += "; explained"
            lines += wrapped(text.lstrip(), width(), "  ", " " * 26)
    if any(x.get("explained") for x in content["multipliers"]):
        said = (
            "explained: the Lagrangians differ by F times the constraint, which does not change the"
            " motion but reduces λ by F"
        )
        lines += wrapped(said, width(), "  ", "  ")
    for number, names in enumerate((content["only_first"], content["only_second"])):
        if names:
            more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
            where = content["model"] if number == 0 else content["other"]
            lines.append(f"  only in {where}: {', '.join(names[:_SHOWN])}{more}")
    return lines


# tables


def sections(content: Mapping[str, Any], units: Mapping[str, str]) -> list[ResultSection]:
    """Return the section of a comparison; ``units`` by coordinate, and of λ by column."""
    if "other" in content:
        return [_models_section(content, units)]
    table = _runs_table([content["reference"], *content["runs"]], "The first row is the reference")
    drawn = PlotPlace("Residuals and differences over time")
    return [ResultSection("runs", "Comparison", [table, drawn])]


def _models_section(content: Mapping[str, Any], units: Mapping[str, str]) -> ResultSection:
    parts = ("coordinates", ""), ("multipliers", "lambda."), ("outputs", "")
    quantities = [(prefix + x["name"], x) for part, prefix in parts for x in content[part]]
    rows = [x for _, x in quantities]
    columns = (
        ResultColumn("Quantity", [ModelName(name) for name, _ in quantities]),
        ResultColumn("Largest difference", [x["difference"] for x in rows], digits=3),
        ResultColumn("Unit", [unit_of(name, units) for name, _ in quantities]),
        ResultColumn("At time", [x["time"] for x in rows], "s"),
        ResultColumn(
            "Relative", [x["difference"] / x["size"] if x["size"] else "" for x in rows], digits=2
        ),
        ResultColumn(
            "Remark", ["explained: see below" if x.get("explained") else "" for x in rows]
        ),
    )
    failed = any(status != "completed" for status in content["status"])
    blocks: list[SectionBlock] = []
    if failed:
        blocks.append(Remark(", ".join(content["status"]), kind="failure"))
    blocks.append(ResultTable(Phrase(f"Models {content['model']} and {content['other']}"), columns))
    if any(x.get("explained") for x in content["multipliers"]):
        said = (
            "Explained: the Lagrangians differ by F times the constraint, which does not change the"
            " motion but reduces λ by F."
        )
        blocks.append(Remark(said, kind="note"))
    for model, key in (("model", "only_first"), ("other", "only_second")):
        if content[key]:
            only = f"Only in {content[model]}: "
            blocks.append(Remark(only, names_of(content[key]), ".", "note"))
    blocks.append(PlotPlace("Differences and multipliers over time"))
    return ResultSection("models", "Two models", blocks)
