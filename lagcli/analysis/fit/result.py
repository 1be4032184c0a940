"""The result of a fit, as JSON values and as text."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from lagcli.analysis.fit.uncertainty import ParameterCombination
from lagcli.analysis.output.tables import (
    Cell,
    ModelName,
    Phrase,
    PlotPlace,
    Remark,
    ResultColumn,
    ResultSection,
    ResultTable,
    SectionBlock,
    TextColumn,
    UnitText,
)
from lagcli.analysis.output.text import width
from lagcli.arrays import Array
from lagcli.prose import counted, wrapped
from lagcli.trajectory.samples import InputTable


class FittedData(NamedTuple):
    """One experiment: the measured values, and those of the fitted model.

    Parameters
    ----------
    path : str
        The data file.
    times : (n,) array
        s.
    measured, model : (n, m) arrays
        Of the observed quantities, in SI; ``measured`` is NaN where there is no measured value.
    sigmas : (m,) array
        Standard deviations of measured values: as given, or as estimated.
    curve_times, curve : (k,) and (k, m) arrays
        The fitted model at as many times as a curve needs.
    """

    path: str
    times: Array
    measured: Array
    model: Array
    sigmas: Array
    curve_times: Array
    curve: Array

    @property
    def residuals(self) -> Array:
        """(model − measured) / sigma, (n, m); NaN or infinite where it is not defined."""
        with np.errstate(all="ignore"):
            return np.asarray((self.model - self.measured) / self.sigmas)


@dataclass(frozen=True, kw_only=True, eq=False)
class FitResult:
    """Quantities found from data by least squares; k of them, m observed.

    Parameters
    ----------
    model_name, model, model_sha256 : str
        The model's name, and its text with its digest.
    inputs : mapping of str to InputTable
        Tables of the model's inputs.
    names : tuple of k str
        Parameters and initial values.
    units : mapping of str to str
        Units of the fitted and the observed quantities, in SI, where they are known.
    values, start : (k,) arrays
        Fitted values, and those of the model file, in SI.
    bound_low, bound_high : (k,) arrays
        Infinite without a bound.
    active : tuple of k str
        "min" or "max" if the value lies on that bound, else "".
    standard_errors, low, high : (k,) arrays
        Standard errors, and the ends of the confidence intervals; NaN for quantities that are not
        identified or lie on a bound.
    covariance, correlation : (k, k) arrays
    level : float
        Level of the intervals.
    intervals : str
        "wald" or "profile".
    chi_square : float
        Sum of squares of (model − measured) / sigma.
    freedom : int
        Number of measured values minus the number of free quantities.
    probability : float
        Probability that chi-square is at least as large by chance; NaN if sigma is estimated.
    sigma_estimated : bool
        Whether the standard deviation of the data is estimated from the residuals.
    combinations : tuple of ParameterCombination
        Combinations of quantities that the data do not identify.
    converged : bool
    message : str
    starts : (starts, k) array
    ends : (starts, k) array
        End points of the searches from the starting points.
    costs : (starts,) array
        Chi-square at the end points (with sigma = 1 if it is estimated); NaN if the first run
        failed.
    runs : int
        Evaluations of all experiments.
    failures : mapping of str to int
        Number of failed evaluations by reason.
    guesses : mapping of str to float
        Guesses of coordinates, in SI, that lead to the assembly found; empty if those of the model
        do.
    apart : tuple of str
        Data files with another assembly than the guesses lead to.
    observed : tuple of m str
    data : tuple of FittedData
    parameters : mapping of str to float
        Parameters of the model, with the values found.
    options : mapping
        Settings of the runs.
    seconds : float
    """

    model_name: str
    model: str
    model_sha256: str
    inputs: Mapping[str, InputTable]
    names: tuple[str, ...]
    units: Mapping[str, str]
    values: Array
    start: Array
    bound_low: Array
    bound_high: Array
    active: tuple[str, ...]
    standard_errors: Array
    low: Array
    high: Array
    covariance: Array
    correlation: Array
    level: float
    intervals: str
    chi_square: float
    freedom: int
    probability: float
    sigma_estimated: bool
    combinations: tuple[ParameterCombination, ...]
    converged: bool
    message: str
    starts: Array
    ends: Array
    costs: Array
    runs: int
    failures: Mapping[str, int]
    guesses: Mapping[str, float]
    apart: tuple[str, ...]
    observed: tuple[str, ...]
    data: tuple[FittedData, ...]
    parameters: Mapping[str, float] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def count(self) -> int:
        """The number of measured values."""
        return sum(int(np.isfinite(x.measured).sum()) for x in self.data)

    @property
    def agreeing_starts(self) -> int:
        """Number of searches that ended at the least cost, to a relative difference of 1e-6."""
        least = np.nanmin(self.costs)
        return int((self.costs <= least + 1e-6 * max(least, 1.0)).sum())

    @property
    def warnings(self) -> tuple[str, ...]:
        """Reasons to distrust the values, one sentence each."""
        warnings = [f"the data do not identify {x.text}" for x in self.combinations]
        warnings += [
            f"{name} lies on its bound `{bound}` {value:.6g}; its error is not known"
            for name, bound, value in zip(self.names, self.active, self.values, strict=True)
            if bound
        ]
        for name, value, error in zip(self.names, self.values, self.standard_errors, strict=True):
            if np.isfinite(error) and error > abs(value) > 0:
                warnings.append(
                    f"{name} is hardly identified: its standard error exceeds its value"
                )
        if self.probability < 1e-3:
            warnings.append(
                f"the model does not fit: chi-square {self.chi_square:.4g} for {self.freedom}"
                " degrees of freedom; the model is wrong, or sigma too small"
            )
        if self.apart:
            warnings.append(
                f"the guesses lead to other assemblies than those fitted to"
                f" {', '.join(self.apart)}: give each of the data its own,"
                " `initial: {x: '{guess: 1}'}`"
            )
        if not self.converged:
            warnings.append(f"the search did not converge: {self.message}")
        return tuple(warnings)

    def as_dict(self) -> dict[str, Any]:
        """Return the result as JSON values, without the data."""
        table = {
            name: {
                "value": float(self.values[i]),
                "unit": self.units.get(name),
                "standard_error": float(self.standard_errors[i]),
                "low": float(self.low[i]),
                "high": float(self.high[i]),
                "start": float(self.start[i]),
                "min": float(self.bound_low[i]),
                "max": float(self.bound_high[i]),
                "active_bound": self.active[i] or None,
            }
            for i, name in enumerate(self.names)
        }
        return {
            "model": self.model_name,
            "status": "completed" if self.converged else "failed",
            "message": self.message,
            "warnings": list(self.warnings),
            "parameters": table,
            "correlation": self.correlation.tolist(),
            "covariance": self.covariance.tolist(),
            "level": self.level,
            "intervals": self.intervals,
            "chi_square": self.chi_square,
            "degrees_of_freedom": self.freedom,
            "probability": self.probability,
            "sigma_estimated": self.sigma_estimated,
            "measured_values": self.count,
            "unidentified": [dict(zip(x.names, x.changes, strict=True)) for x in self.combinations],
            "starts": [
                {"start": start.tolist(), "end": end.tolist(), "chi_square": float(cost)}
                for start, end, cost in zip(self.starts, self.ends, self.costs, strict=True)
            ],
            "runs": self.runs,
            "failed_runs": dict(self.failures),
            "guesses": dict(self.guesses),
            "apart": list(self.apart),
            "data": [
                {
                    "file": x.path,
                    "measured_values": int(np.isfinite(x.measured).sum()),
                    "sigma": dict(zip(self.observed, x.sigmas.tolist(), strict=True)),
                    "rms_residual": {
                        name: _rms(x.residuals[:, j]) for j, name in enumerate(self.observed)
                    },
                }
                for x in self.data
            ],
            "seconds": self.seconds,
        }


def _rms(values: Array) -> float:
    """Return the root mean square of the values that are not NaN."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return np.nan
    # a power of two, which changes no digit and keeps squares from overflowing
    scale = math.ldexp(1.0, math.frexp(np.abs(finite).max())[1] - 1)
    return scale * float(np.sqrt(np.mean((finite / scale) ** 2)))


#: Smallest correlation that is listed, and the largest number of them.
_STRONG, _LISTED = 0.9, 6


def format_fit(result: FitResult) -> str:
    """Return the text that ``lagcli fit`` and ``lagcli info`` print."""
    files = len(result.data)
    lines = _wrapped(
        f"{result.model_name}: {counted(len(result.names), 'quantity', 'quantities')} from"
        f" {counted(result.count, 'measured value')} in {counted(files, 'file')},"
        f" {'fitted' if result.converged else 'not fitted'}",
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
    lines += fitted_table(result).lines()
    lines += [""]
    strong = _strong(result)
    if strong:
        lines += _entry("correlation", "; ".join(strong))
    for data in result.data:
        sizes = {name: _rms(data.residuals[:, j]) for j, name in enumerate(result.observed)}
        parts = [f"{name} {x:.3g} sigma" for name, x in sizes.items() if not math.isnan(x)]
        lines += _entry("residuals", f"{data.path}: rms {', '.join(parts)}")
    if result.guesses:
        lines += _entry("assembly", _assembly(result))
    if len(result.costs) > 1:
        agreeing = result.agreeing_starts
        lines += _entry("searches", f"{agreeing} of {len(result.costs)} end at these values")
    failed = sum(result.failures.values())
    lines += _entry("runs", f"{result.runs}" + (f", {failed} failed" if failed else ""))
    for reason, count in sorted(result.failures.items(), key=lambda x: -x[1])[:3]:
        lines += _entry("", f"{count}: {reason}")
    return "\n".join(lines)


def _assembly(result: FitResult) -> str:
    """Return which guesses lead to an assembly that is not that of the model's guesses."""
    guesses = ", ".join(f"{name} {x:.6g}" for name, x in result.guesses.items())
    return f"not that of the model's guesses: begin at {guesses}"


def fitted_table(result: FitResult) -> ResultTable:
    """Return the table of the fitted quantities."""
    every = range(len(result.names))
    errors = [float(x) for x in result.standard_errors]
    known = [math.isfinite(x) for x in errors]
    notes = [_note(result, i) for i in every]
    ends = list(zip(result.low.tolist(), result.high.tolist(), strict=True))
    labels = [_label(result, i) for i in every]
    width = max(10, *map(len, labels))
    shown = [
        note or f"{_number(low, error)} to {_number(high, error)}"
        for note, (low, high), error in zip(notes, ends, errors, strict=True)
    ]
    values = [_number(x, error) for x, error in zip(result.values, errors, strict=True)]
    texts = [f"{error:.2g}" if finite else "-" for error, finite in zip(errors, known, strict=True)]
    percent = f"{100 * result.level:g} % interval ({result.intervals})"
    columns = (
        ResultColumn(
            "Quantity",
            [ModelName(name) for name in result.names],
            text=TextColumn("quantity", f"  {{:<{width}}}", labels),
        ),
        ResultColumn(
            "Value", result.values.tolist(), "", 8, TextColumn("value", "  {:>12}", values)
        ),
        ResultColumn("Unit", [UnitText(result.units.get(name, "")) for name in result.names]),
        ResultColumn(
            "Standard error",
            [error if finite else "" for error, finite in zip(errors, known, strict=True)],
            "",
            2,
            TextColumn("std. error", "  {:>10}", texts),
        ),
        ResultColumn(
            percent,
            [Phrase("{} to {}", x, 8) if ok else "" for x, ok in zip(ends, known, strict=True)],
            text=TextColumn(percent, "  {}", shown),
        ),
        ResultColumn("Start", result.start.tolist()),
        ResultColumn("Remark", [_remark(result, i) for i in every]),
    )
    return ResultTable(Phrase("Fitted quantities"), columns)


def fit_sections(result: FitResult) -> list[ResultSection]:
    """Return the sections of a fit."""
    fitted: list[SectionBlock] = []
    if not result.converged:
        fitted.append(Remark(result.message, kind="failure"))
    freedom = f"{{}} for {result.freedom} degrees of freedom"
    facts: list[tuple[str, Cell]] = [
        ("Measured values", str(result.count)),
        ("Chi-square", Phrase(freedom, (result.chi_square,))),
        ("Probability", ""),
        ("Standard deviations", "estimated from the residuals" * result.sigma_estimated),
        ("Runs", f"{result.runs}, {sum(result.failures.values())} failed"),
    ]
    if not math.isnan(result.probability):
        facts[2] = ("Probability", Phrase("{}", (result.probability,), 2))
    if len(result.costs) > 1:
        agreeing = f"{result.agreeing_starts} of {len(result.costs)} end at these values"
        facts.append(("Searches", agreeing))
    if result.guesses:
        facts.append(("Assembly", _assembly(result)))
    facts = [x for x in facts if x[1]]
    columns = [
        ResultColumn("", [label for label, _ in facts]),
        ResultColumn("", [x for _, x in facts]),
    ]
    fitted += [fitted_table(result), ResultTable(Phrase("The fit"), columns, facts=True)]
    names = [ModelName(name) for name in result.names]
    correlation = [
        ResultColumn("", names),
        *(
            ResultColumn(name, x.tolist(), "", 3)
            for name, x in zip(names, result.correlation.T, strict=True)
        ),
    ]
    unidentified = [
        Remark("Not identified: ", list(zip(x.names, x.changes, strict=True)))
        for x in result.combinations
    ]
    table = ResultTable(Phrase("Correlation of the errors"), correlation)
    return [
        ResultSection("fit", "Fitted quantities", fitted),
        ResultSection(
            "data", "Data and model", [PlotPlace("Measured values, the model and residuals")]
        ),
        ResultSection("correlation", "Correlation", [table, *unidentified]),
    ]


def _remark(result: FitResult, i: int) -> str:
    """Return the remark of a table on a quantity."""
    if result.active[i]:
        return f"at its bound {result.active[i]}"
    return "" if math.isfinite(result.standard_errors[i]) else "not identified by the data"


def _strong(result: FitResult) -> list[str]:
    """Return the strongest correlations."""
    correlations = []
    for i, a in enumerate(result.names):
        for j in range(i):
            r = float(result.correlation[i, j])
            if abs(r) >= _STRONG:
                correlations.append((abs(r), f"{result.names[j]}, {a} {r:+.3f}"))
    return [text for _, text in sorted(correlations, reverse=True)[:_LISTED]]


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
    lines = wrapped(text, width() - len(label))
    first, *rest = lines or [""]
    return [label + first, *(" " * len(label) + line for line in rest)]
