"""What `simulate` says about a run: one mapping, as JSON or as text."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from lagcli.errors import LagcliError, ModelError
from lagcli.trajectory import Trajectory


def summarize(
    trajectory: Trajectory, output: str | None, seconds: Mapping[str, float]
) -> dict[str, Any]:
    """Return the summary of a run, as documented in docs/command-line.md.

    Residuals are relative to the constraints' own scales; the energy balance is in J.
    """
    tr = trajectory
    time = tr.time
    multipliers = {}
    for i, name in enumerate(tr.constraints):
        values = tr.multipliers[:, i]
        if len(values):
            low, high = int(values.argmin()), int(values.argmax())
            multipliers[name] = {
                "min": float(values[low]),
                "t_min": float(time[low]),
                "max": float(values[high]),
                "t_max": float(time[high]),
            }
    return {
        "status": tr.status,
        "message": tr.message,
        "output": output,
        "t_start": float(tr.options["t_start"]),
        "t_end": float(time[-1]) if len(time) else None,
        "samples": len(time),
        **tr.counts,
        "engine": tr.options["engine"],
        "method": tr.options["method"],
        "formulation": tr.options["formulation"],
        "residual_position": _worst(tr.residual_position, tr.scale_position),
        "residual_velocity": _worst(tr.residual_velocity, tr.scale_velocity),
        "energy_balance": float(np.abs(tr.energy_balance).max(initial=0.0)),
        "energy_scale": tr.energy_scale,
        "multipliers": multipliers,
        "initial_correction": {k: list(v) for k, v in tr.initial_correction.items()},
        "coordinates": len(tr.coordinates),
        "seconds": dict(seconds),
    }


def _worst(residual: np.ndarray, scale: np.ndarray) -> float | None:
    """Return the largest scaled residual; None where no constraint has one."""
    relative = np.abs(residual) / scale
    relative = relative[~np.isnan(relative)]
    return float(relative.max()) if relative.size else None


def to_json(value: Mapping[str, Any]) -> str:
    """Return strict JSON: numbers that are not finite become null."""
    return json.dumps(_finite(value), indent=2, ensure_ascii=False)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def error_object(error: LagcliError) -> dict[str, Any]:
    """Return what --json prints when there is no run."""
    found: dict[str, Any] = {
        "status": "failed" if error.exit_status == 3 else "error",
        "message": str(error),
    }
    if isinstance(error, ModelError):
        found["diagnostics"] = [
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
    return found


def format_summary(summary: Mapping[str, Any], name: str) -> str:
    """Return the summary as text of at most 100 columns."""
    s = summary
    end = f" to {s['t_end']:.6g} s" if s["t_end"] is not None else ""
    lines = [
        f"{name}: {s['status']}, t = {s['t_start']:.6g}{end}, {s['samples']} samples",
        f"  {'method':<12}{s['method']} with {s['formulation']} ({s['engine']} engine):"
        f" {s['steps']} steps, {s['rejected']} rejected, {s['evaluations']} evaluations",
    ]
    moved = s["initial_correction"]
    if moved:
        lines.append(f"  {'start':<12}moved onto the constraints:")
        width = max(map(len, moved))
        lines += [
            f"    {k:<{width}}  {before:.10g} → {after:.10g}"
            for k, (before, after) in moved.items()
        ]
    residuals = [
        f"{what} {s[f'residual_{what}']:.1e}"
        for what in ("position", "velocity")
        if s[f"residual_{what}"] is not None
    ]
    if residuals:
        lines.append(
            f"  {'residuals':<12}{', '.join(residuals)} (largest, relative to each constraint's"
            " terms)"
        )
    scale = s["energy_scale"]
    relative = f", {s['energy_balance'] / scale:.1e} of {scale:.4g} J" if scale else ""
    lines.append(f"  {'energy':<12}balance within {s['energy_balance']:.1e} J{relative}")
    if s["multipliers"]:
        width = max(len(f"lambda.{n}") for n in s["multipliers"])
        lines.append("  multipliers")
        for n, m in s["multipliers"].items():
            lines.append(
                f"    {'lambda.' + n:<{width}}  min {m['min']:>13.6g} at t = {m['t_min']:<9.4g}"
                f"  max {m['max']:>13.6g} at t = {m['t_max']:.4g}"
            )
    total = s["seconds"]["total"]
    lines.append(
        f"  {'time':<12}{total:.2f} s, of which integrating {s['seconds']['integrate']:.2f} s"
    )
    if s["output"]:
        lines.append(f"  {'written':<12}{'standard output' if s['output'] == '-' else s['output']}")
    else:
        lines.append(f"  {'written':<12}nothing (-o run.h5 keeps the trajectory)")
    return "\n".join(lines)
