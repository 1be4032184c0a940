"""The result of a fit as text of at most 80 columns."""

from __future__ import annotations

import math

import numpy as np

from lagcli.analysis.fit.result import FitResult
from lagcli.results.listing import wrapped

_WIDTH = 80
#: Smallest correlation that is listed, and the largest number of them.
_STRONG, _LISTED = 0.9, 6


def format_fit(result: FitResult) -> str:
    """Return the text that ``lagcli fit`` and ``lagcli info`` print."""
    files = len(result.data)
    lines = _wrapped(
        f"{result.model_name}: {len(result.names)} quantities from {result.count} measured values"
        f" in {files} file{'s' * (files != 1)}, {'fitted' if result.converged else 'not fitted'}",
        "",
    )
    square = f"{result.chi_square:.5g} for {result.freedom} degrees of freedom"
    if result.sigma_estimated:
        sigma = ", ".join(
            f"{name} {x:.4g}{_unit(result, name)}"
            for name, x in zip(result.observed, result.data[0].sigmas, strict=True)
        )
        lines += _entry("sigma", f"estimated from the residuals: {sigma}")
    else:
        chance = f" (probability {result.probability:.2g})"
        lines += _entry("chi-square", square + (chance if result.freedom > 0 else ""))
    lines += [""]
    percent = f"{100 * result.level:g} % interval ({result.intervals})"
    width = max(10, *(len(_label(result, i)) for i in range(len(result.names))))
    lines.append(f"  {'quantity':<{width}}  {'value':>12}  {'std. error':>10}  {percent}")
    for i in range(len(result.names)):
        error, low, high = (x[i] for x in (result.standard_errors, result.low, result.high))
        note = _note(result, i)
        shown = note or f"{_number(low, error)} to {_number(high, error)}"
        said = f"{error:>10.2g}" if math.isfinite(error) else f"{'-':>10}"
        value = _number(result.values[i], error)
        lines.append(f"  {_label(result, i):<{width}}  {value:>12}  {said}  {shown}")
    lines += [""]
    strong = _strong(result)
    if strong:
        lines += _entry("correlation", "; ".join(strong))
    for data in result.data:
        parts = []
        for j, name in enumerate(result.observed):
            kept = data.residuals[:, j][np.isfinite(data.residuals[:, j])]
            if len(kept):
                parts.append(f"{name} {float(np.sqrt(np.mean(kept**2))):.3g} sigma")
        lines += _entry("residuals", f"{data.path}: rms {', '.join(parts)}")
    if len(result.costs) > 1:
        agreeing = result.agreeing_starts
        lines += _entry("starts", f"{agreeing} of {len(result.costs)} end at these values")
    failed = sum(result.failures.values())
    lines += _entry("runs", f"{result.runs}" + (f", {failed} failed" if failed else ""))
    for reason, count in sorted(result.failures.items(), key=lambda x: -x[1])[:3]:
        lines += _entry("", f"{count}: {reason}")
    return "\n".join(lines)


def _strong(result: FitResult) -> list[str]:
    """Return the strongest correlations."""
    found = []
    for i, a in enumerate(result.names):
        for j in range(i):
            r = float(result.correlation[i, j])
            if abs(r) >= _STRONG:
                found.append((abs(r), f"{result.names[j]}, {a} {r:+.3f}"))
    return [text for _, text in sorted(found, reverse=True)[:_LISTED]]


def _note(result: FitResult, i: int) -> str:
    if result.active[i]:
        return f"at its bound `{result.active[i]}`"
    if math.isnan(result.standard_errors[i]):
        return "not identified"
    return ""


def _label(result: FitResult, i: int) -> str:
    name = result.names[i]
    unit = result.units.get(name)
    return f"{name} [{unit}]" if unit else name


def _unit(result: FitResult, name: str) -> str:
    unit = result.units.get(name)
    return f" {unit}" if unit else ""


def _number(value: float, error: float) -> str:
    """Return a number with two digits more than its error justifies."""
    if not math.isfinite(value):
        return "-"
    digits = 6
    if math.isfinite(error) and error > 0 and value:
        digits = min(12, max(3, math.floor(math.log10(abs(value)) - math.log10(error)) + 3))
    return f"{value:.{digits}g}"


def _entry(label: str, text: str) -> list[str]:
    return _wrapped(text, f"  {label:<12}")


def _wrapped(text: str, label: str) -> list[str]:
    lines = wrapped(text, _WIDTH - len(label))
    first, *rest = lines or [""]
    return [label + first, *(" " * len(label) + line for line in rest)]
