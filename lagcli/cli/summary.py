"""Summary of a run, as JSON and as text."""

from __future__ import annotations

import math
import sys
import textwrap
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.cli.streams import visible_json
from lagcli.columns import RESIDUALS, ColumnName, unit_of_column
from lagcli.errors import LagcliError
from lagcli.model.model import Model
from lagcli.trajectory.extremes import Extremes, known
from lagcli.trajectory.samples import ENDED, Record

_LISTED = 20  # largest number of multipliers in a summary


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
        "events": None if record.events is None else record.events.to_mapping(),
        "parameters": record.parameters,
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


def format_summary(summary: Mapping[str, Any], model: Model) -> str:
    """Return the summary as text of at most 100 columns."""
    s = summary
    end = f" to {s['t_end']:.6g} s" if s["t_end"] is not None else ""
    method = f"  {'method':<12}{s['method']} with {s['formulation']}:"
    counts = f"{s['steps']} steps, {s['rejected']} rejected, {s['evaluations']} evaluations"
    fits = len(method) + 1 + len(counts) <= 100
    lines = [
        f"{model.name}: {s['status']}, t = {s['t_start']:.6g}{end}, {s['samples']} samples",
        *([f"{method} {counts}"] if fits else [method, f"  {'':<12}{counts}"]),
    ]
    if s["choice"]:
        wrapped = textwrap.wrap(s["choice"], 86, break_on_hyphens=False)
        lines += [f"  {'':<12}{line}" for line in wrapped]
    lines += [f"  {'warning':<12}{warning}" for warning in s["warnings"]]
    lines.append(f"  {'tolerance':<12}rtol {s['rtol']:g}, atol {_absolute(s)}")
    if s["status"] in ENDED and s["message"]:
        lines.append(f"  {'':<12}{s['message']}")
    moved = s["initial_correction"]
    if moved:
        from lagcli.results.listing import told_apart

        lines.append(f"  {'start':<12}adjusted to satisfy the constraints:")
        width = max(map(len, moved))
        lines += [
            f"    {k:<{width}}  {' → '.join(told_apart(before, after, 10))}"
            for k, (before, after) in moved.items()
        ]
    if s["redundant"]:
        lines += _redundancy(s, model)
    if s["nonlinear"]:
        names = ", ".join(s["nonlinear"][:_LISTED]) + ", …" * (len(s["nonlinear"]) > _LISTED)
        lines.append(f"  {'postulate':<12}Chetaev's rule: the force of {names} is along ∂ψ/∂q̇")
    residuals = [f"{q.label} {s[q.name]:.1e}" for q in RESIDUALS if s[q.name] is not None]
    if residuals:
        lines.append(
            f"  {'residuals':<12}{', '.join(residuals)} (largest, relative to each constraint's"
            " scale)"
        )
    scale = s["energy_scale"]
    relative = f", {s['energy_balance'] / scale:.1e} of {scale:.4g} J" if scale else ""
    lines.append(f"  {'energy':<12}balance within {s['energy_balance']:.1e} J{relative}")
    if s["conserved"]:
        lines += _conserved(s["conserved"])
    if s.get("kinks"):
        times = "once" if s["kinks"] == 1 else f"{s['kinks']} times, each"
        lines.append(f"  {'kinks':<12}crossed {times} at the end of a step")
    if s["events"] is not None:
        lines += _events(s["events"])
    if s["multipliers"]:
        listed = dict(islice(s["multipliers"].items(), _LISTED))
        labels = {
            n: f"lambda.{n} [{m['unit']}]" if m["unit"] else f"lambda.{n}"
            for n, m in listed.items()
        }
        width = max(map(len, labels.values()))
        lines.append("  multipliers")
        for n, m in listed.items():
            lines.append(
                f"    {labels[n]:<{width}}  min {m['min']:>13.6g} at t = {m['t_min']:<9.4g}"
                f"  max {m['max']:>13.6g} at t = {m['t_max']:.4g}"
            )
        if len(s["multipliers"]) > _LISTED:
            where = f"lagcli info {s['output']}" if s["output"] not in (None, "-") else "--json"
            lines.append(f"    … {len(s['multipliers']) - _LISTED} more ({where})")
    if s["sensitivity"]:
        of = "q, v and λ" if s["events"] is None else "q, v, λ and times of events"
        lines.append(f"  {'derivatives':<12}of {of} with respect to {', '.join(s['sensitivity'])}")
    total = s["seconds"]["total"]
    lines.append(
        f"  {'time':<12}{total:.2f} s, of which integrating {s['seconds']['integrate']:.2f} s"
    )
    if s["output"]:
        lines.append(f"  {'written':<12}{'standard output' if s['output'] == '-' else s['output']}")
    else:
        lines.append(f"  {'written':<12}nothing (-o run.h5 keeps the trajectory)")
    return "\n".join(lines)


def _events(log: Mapping[str, Any]) -> list[str]:
    """Return the lines on contacts and events."""
    from lagcli.trajectory.event_log import event_sentences

    lines = [
        line
        for sentence in event_sentences(log)
        for line in textwrap.wrap(sentence, 86, break_on_hyphens=False)
    ]
    return [f"  {'events' if not i else '':<12}{line}" for i, line in enumerate(lines)]


def _conserved(drifts: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the drift of the monitored conserved quantities."""
    shown = [
        f"{name} = {x['first']:.6g} within {x['drift']:.1e}"
        for name, x in islice(drifts.items(), _LISTED)
    ]
    if len(drifts) > _LISTED:
        shown.append(f"and {len(drifts) - _LISTED} more (--json lists all)")
    first, *rest = textwrap.wrap("; ".join(shown), 86, break_on_hyphens=False)
    return [f"  {'conserved':<12}{first}", *(f"  {'':<12}{line}" for line in rest)]


def _redundancy(summary: Mapping[str, Any], model: Model) -> list[str]:
    """Return the line on redundant constraints."""
    from lagcli.model.locations import lines_of

    surplus = sum(x["surplus"] for x in summary["redundant"])
    freedom = summary["degrees_of_freedom"]
    text = (
        f"{surplus} of {summary['constraints']} redundant (rank of B {summary['rank']},"
        f" {freedom} degree{'s' * (freedom != 1)} of freedom): "
    )
    sets = []
    for redundant in summary["redundant"]:
        names = ", ".join(redundant["constraints"][:_LISTED])
        more = len(redundant["constraints"]) - _LISTED
        names += f" and {more} more" if more > 0 else ""
        follow = "follows" if redundant["surplus"] == 1 else "follow"
        where = lines_of(model, redundant["constraints"])
        sets.append(
            f"{redundant['surplus']} of {names}{f' ({where})' if where else ''} {follow} from the"
            " others"
        )
    text += "; ".join(sets) + (
        "; their multipliers are not unique, the constraint forces are; remove redundant"
        " constraints for unique multipliers"
    )
    first, *rest = textwrap.wrap(text, 86)
    return [f"  {'constraints':<12}{first}", *(f"  {'':<12}{line}" for line in rest)]
