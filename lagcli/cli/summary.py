"""Summary of a run, as JSON and as text."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.cli.streams import visible, visible_json
from lagcli.columns import RESIDUALS, ColumnName, impulse_unit, unit_of_column
from lagcli.errors import LagcliError
from lagcli.model.model import RATE, Model
from lagcli.prose import counted
from lagcli.trajectory.extremes import Extremes, known
from lagcli.trajectory.samples import ENDED, Record

_LISTED = 20  # largest number of names and of lines of a list in a summary
#: Columns of the labels of a summary.
LABEL = 14


def summarize(
    record: Record,
    extremes: Extremes,
    initial: Mapping[str, float],
    output: str | None,
    seconds: Mapping[str, float],
    nonlinear: Sequence[str] = (),
) -> dict[str, Any]:
    """Return the summary of a run, as documented in docs/command-line.md.

    Residuals are relative to the constraints' scales; the energy balance is in J. Constraints that
    are nonlinear in the velocities are named, because their forces follow Chetaev's rule.
    """
    options = record.options
    return {
        "status": record.status,
        "message": record.message,
        "warnings": list(record.warnings),
        "output": output,
        "t_start": float(options["t_start"]),
        "t_end": known(extremes.last),
        "samples": extremes.samples,
        **record.counts,
        "method": options["method"],
        "choice": options.get("choice"),
        "formulation": options["formulation"],
        "rtol": options["rtol"],
        "atol": options.get("atol"),
        "tolerances": dict(record.tolerances),
        **{q.name: _worst(getattr(extremes, q.name), getattr(record, q.scale)) for q in RESIDUALS},
        "energy_balance": known(extremes.energy_balance) or 0.0,
        "energy_scale": extremes.energy_scale,
        "conserved": {
            name: {
                "formula": record.conserved_formulas.get(name),
                "first": extreme.first,
                "drift": extreme.drift,
            }
            for name, extreme in extremes.conserved.items()
        },
        "multipliers": {
            name: {
                "min": extreme.low,
                "t_min": extreme.low_time,
                "max": extreme.high,
                "t_max": extreme.high_time,
                "unit": unit_of_column(ColumnName("multipliers", name), record.units),
            }
            for name, extreme in extremes.multipliers.items()
            if known(extreme.low) is not None
        },
        "impulses": {}
        if record.events is None
        else {
            name: {
                **impulses,
                "unit": impulse_unit(unit_of_column(ColumnName("multipliers", name), record.units)),
            }
            for name, impulses in record.events.impulses(tuple(extremes.multipliers)).items()
        },
        "events": None if record.events is None else record.events.to_mapping(),
        "parameters": record.parameters,
        "given": record.display["given"],
        "initial": dict(initial),
        "initial_correction": {k: list(v) for k, v in record.initial_correction.items()},
        "coordinates": len(initial) // 2,
        **_freedom(record),
        "nonlinear": list(nonlinear),
        "sensitivity": list(options.get("sensitivity", ())),
        "seconds": dict(seconds),
    }


def _freedom(record: Record) -> dict[str, Any]:
    """Return the rank of B at the initial state, the degrees of freedom, and redundant
    constraints."""
    names = ("constraints", "rank", "degrees_of_freedom", "redundant")
    return {name: record.freedom[name] for name in names}


def _worst(residual: Array, scale: Array) -> float | None:
    """Return the largest scaled residual; None if no constraint has one."""
    return known(np.fmax.reduce(residual / scale, initial=math.nan))


def to_json(value: Mapping[str, Any]) -> str:
    """Return strict JSON: numbers that are not finite become null.

    On a terminal it is indented; otherwise it is one line, so that the objects of many runs form a
    file of JSON lines.
    """
    indent = 2 if sys.stdout.isatty() else None
    import json

    from lagcli.json_values import json_values

    return visible_json(json.dumps(json_values(value), indent=indent, ensure_ascii=False))


def error_object(error: LagcliError) -> dict[str, Any]:
    """Return the JSON object of an error."""
    mapping: dict[str, Any] = {
        "status": "failed" if error.exit_status == 3 else "error",
        "message": str(error),
    }
    if error.diagnostics:
        mapping["diagnostics"] = [
            {
                "kind": d.kind,
                "message": d.message,
                "file": d.location.path if d.location else None,
                "line": d.location.line if d.location else None,
                "column": d.location.column if d.location else None,
                "help": d.help,
            }
            for d in error.diagnostics
        ]
    return mapping


def _absolute(summary: Mapping[str, Any]) -> str:
    """Return how the absolute tolerances were chosen."""
    given, reached = summary["atol"], summary["tolerances"].values()
    if isinstance(given, (int, float)):
        return f"{given:g}"
    between = f": {min(reached):.1e} to {max(reached):.1e} at the end" if reached else ""
    if given is None:
        return f"by size{between}"
    listed = ", ".join(f"{name} {x:g}" for name, x in islice(given.items(), 4))
    return f"{listed}{', …' if len(given) > 4 else ''}, others by their size{between}"


def format_summary(summary: Mapping[str, Any], model: Model, columns: int = 100) -> str:
    """Return the summary as text.

    Parameters
    ----------
    summary : mapping
        Result of `summarize`.
    model : Model
    columns : int
        Length of the longest line.
    """
    from lagcli.results.listing import entry, pairs

    s = summary

    def said(label: str, text: str) -> None:
        lines.extend(entry(f"  {label}" if label else "", visible(text), LABEL, columns))

    end = f" to {s['t_end']:.6g} s" if s["t_end"] is not None else ""
    when = f"t = {s['t_start']:.6g}{end}, {counted(s['samples'], 'sample')}"
    lines = entry("", f"{visible(model.name)}: {s['status']}, {when}", 0, columns)
    began = s["samples"] > 0  # a run that fails at its start has no method, energy or residuals
    if began:
        said(
            "method",
            f"{s['method']} with {s['formulation']}: {counted(s['steps'], 'step')},"
            f" {s['rejected']} rejected, {counted(s['evaluations'], 'evaluation')}",
        )
        said("", s["choice"] or "")
    for warning in s["warnings"]:
        said("warning", warning)
    if began:
        said("tolerance", f"rtol {s['rtol']:g}, atol {_absolute(s)}")
    if s["status"] in ENDED:
        said("", s["message"])
    if given := s["given"]:
        units = {name: model.units.of(name) or "" for name in given}
        said("in SI", pairs({name: s["parameters"][name] for name in given}, units, given))
    lines += _start(s["initial_correction"], columns)
    if s["redundant"] and began:
        said("constraints", _redundancy(s, model))
    if s["nonlinear"]:
        names = ", ".join(s["nonlinear"][:_LISTED]) + ", …" * (len(s["nonlinear"]) > _LISTED)
        said("postulate", f"Chetaev's rule: the force of {names} is along ∂ψ/∂q̇")
    residuals = [f"{q.label} {s[q.name]:.1e}" for q in RESIDUALS if s[q.name] is not None]
    if residuals:
        worst = f"{', '.join(residuals)} (largest, relative to each constraint's scale)"
        said("residuals", worst)
    if began:
        scale = s["energy_scale"]
        relative = f", {s['energy_balance'] / scale:.1e} of {scale:.4g} J" if scale else ""
        said("energy", f"balance within {s['energy_balance']:.1e} J{relative}")
    if s["conserved"]:
        said("conserved", _conserved(s["conserved"]))
    if s.get("kinks"):
        times = "once" if s["kinks"] == 1 else f"{s['kinks']} times, each"
        said("kinks", f"crossed {times} at the end of a step")
    if s["events"] is not None:
        from lagcli.trajectory.event_log import event_sentences

        for i, sentence in enumerate(event_sentences(s["events"])):
            said("" if i else "events", sentence)
    lines += _forces(s, columns)
    if s["sensitivity"]:
        of = "q, v and λ" if s["events"] is None else "q, v, λ and times of events"
        said("derivatives", f"of {of} with respect to {', '.join(s['sensitivity'])}")
    total = s["seconds"]["total"]
    said("time", f"{total:.2f} s, of which integrating {s['seconds']['integrate']:.2f} s")
    if s["output"]:
        said("written", "standard output" if s["output"] == "-" else s["output"])
    else:
        said("written", "nothing" + began * " (-o run.h5 keeps the trajectory)")
    return "\n".join(lines)


def _start(moved: Mapping[str, Sequence[float]], columns: int) -> list[str]:
    """Return the lines on initial values that were adjusted."""
    if not moved:
        return []
    from lagcli.results.listing import distinct_numbers, entry

    lines = entry("  start", "adjusted to satisfy the constraints:", LABEL, columns)
    listed = dict(islice(moved.items(), _LISTED))
    width = max(map(len, listed))
    lines += [
        f"    {name:<{width}}  {' → '.join(distinct_numbers(before, after, 10))}"
        for name, (before, after) in listed.items()
    ]
    if len(moved) > _LISTED:
        lines.append(f"    … {len(moved) - _LISTED} more (--json)")
    return lines


def _forces(summary: Mapping[str, Any], columns: int) -> list[str]:
    """Return the lines on multipliers and impulses: smallest and largest values, and where.

    Those of the equations of first-order coordinates, which are 0, are left out.
    """
    multipliers = {
        f"lambda.{n}": x for n, x in summary["multipliers"].items() if not n.endswith(RATE)
    }
    impulses = {f"impulse.{n}": x for n, x in summary["impulses"].items()}
    if not multipliers:
        return []
    from lagcli.results.ranges import range_lines, ranges_of

    units = {n: x["unit"] for n, x in (multipliers | impulses).items()}
    forces, strokes = ranges_of(multipliers, units), ranges_of(impulses, units)
    lines = range_lines([*forces[:_LISTED], *strokes[:_LISTED]], columns, 4)
    hidden = max(0, len(forces) - _LISTED) + max(0, len(strokes) - _LISTED)
    if hidden:
        output = summary["output"]
        where = f"lagcli info {output}" if output not in (None, "-") else "--json"
        lines.append(f"    … {hidden} more ({where})")
    return ["  multipliers", *lines]


def _conserved(drifts: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the drift of the monitored conserved quantities."""
    shown = [
        f"{name} = {x['first'] + 0.0:.6g} within {x['drift']:.1e}"
        for name, x in islice(drifts.items(), _LISTED)
    ]
    if len(drifts) > _LISTED:
        shown.append(f"and {len(drifts) - _LISTED} more (--json lists all)")
    return "; ".join(shown)


def _redundancy(summary: Mapping[str, Any], model: Model) -> str:
    """Return the sentence on redundant constraints."""
    from lagcli.equations.derivation.degrees_of_freedom import RedundantSet
    from lagcli.model.locations import lines_of
    from lagcli.results.listing import folded
    from lagcli.results.ranges import span

    surplus = sum(x["surplus"] for x in summary["redundant"])
    freedom = summary["degrees_of_freedom"]
    text = (
        f"{surplus} of {summary['constraints']} redundant (rank of B {summary['rank']},"
        f" {counted(freedom, 'degree')} of freedom): "
    )
    sets = []
    for redundant in summary["redundant"]:
        named = folded((name, "") for name in redundant["constraints"])
        names = ", ".join(named[:_LISTED])
        more = len(named) - _LISTED
        names += f" and {more} more" if more > 0 else ""
        if lines := lines_of(model, redundant["constraints"]):
            numbers = span(lines).replace("..", " to ")
            names += f" (line{'s' * (len(lines) > 1)} {numbers} of the model)"
        one = RedundantSet(tuple(redundant["constraints"]), redundant["surplus"])
        sets.append(one.sentence([names]))
    return (
        f"{text}{'; '.join(sets)}; their multipliers are not unique, the constraint forces are;"
        " remove redundant constraints for unique multipliers"
    )
