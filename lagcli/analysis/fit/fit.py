"""Find parameters and initial values of a model from measured data."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from lagcli.analysis.fit.experiment import (
    Experiment,
    FailedRun,
    experiments_of,
    read_measured,
    sigma_estimated,
)
from lagcli.analysis.fit.result import FitResult, FittedData
from lagcli.analysis.fit.search import Problem, SearchResult
from lagcli.analysis.fit.uncertainty import profile_interval, quantile, uncertainty
from lagcli.arrays import Array
from lagcli.columns import unit_quotient
from lagcli.engine.constraints.initial import ConsistentState
from lagcli.errors import Diagnostic, ModelError, NumericalError, UsageError
from lagcli.model.expression.units import si_notation
from lagcli.model.loader import load_text
from lagcli.model.model import DataFile, FitBlock, Model, check_is_model
from lagcli.prose import counted
from lagcli.settings.settings import SettingsOverrides, resolve
from lagcli.simulations.directions import direction_names
from lagcli.simulations.inputs import input_tables
from lagcli.simulations.threads import one_thread

#: Limit of the steps of a run: this multiple of the steps at the model's values, plus this number.
#: A motion at distant values may need far more steps than the data justify.
_STEPS = (100, 20_000)
#: Number of times of the fitted curve, if the data have fewer.
_DRAWN = 501
#: Times that the best search is continued if it ended before it converged.
_AGAIN = 3
#: Part of chi-square by which another assembly fits better, beyond the searches' accuracy.
_BETTER = 1e-6
#: Distance from a bound, relative to its size, below which a value may lie on it, and the largest
#: rise of chi-square from there to the bound: a hundredth of a standard error.
_ON_BOUND, _RISE = 1e-6, 1e-4


def fit(
    model: Model,
    settings: SettingsOverrides | None = None,
    *,
    starts: int = 1,
    ci: Literal["wald", "profile"] = "wald",
    level: float = 0.95,
    progress: Callable[[int, int], None] | None = None,
    **options: Any,
) -> FitResult:
    """Find parameters and initial values from measured data, by weighted least squares.

    Minimizes Σ ((model − measured) / sigma)² with the exact derivatives of the motion and of λ.

    Parameters
    ----------
    model : Model
        Model with a `fit` block. Its values are the first starting point.
    settings : SettingsOverrides, optional
        Settings of the runs; the times are those of the data.
    starts : int
        Number of starting points; all but the first lie between the bounds. From each, there is a
        search in the assembly of the model's guesses and, with several starting points, in another
        assembly, if the constraints have one.
    ci : "wald" or "profile"
        Confidence intervals from standard errors, or from the profiles of the sum of squares.
    level : float
        Level of the intervals.
    progress : callable, optional
        Called with the numbers of completed and of all searches.
    **options
        Settings by name, instead of ``settings``.

    Returns
    -------
    FitResult

    Raises
    ------
    UsageError
        There is no `fit` block, or an argument is out of its range.
    ModelError
        A value of the model lies outside its bounds.
    FileError
        The data cannot be read.
    NumericalError
        No search has found a minimum: all runs failed.
    """
    check_is_model(model, "fit")
    if options:
        settings = SettingsOverrides(**options).over(settings or SettingsOverrides())
    if starts < 1:
        raise UsageError(f"starts must be at least 1, not {starts}")
    if ci not in ("wald", "profile"):
        raise UsageError(f"there are no {ci!r} intervals; known are wald and profile")
    if not 0 < level < 1:
        raise UsageError(f"level must lie between 0 and 1, not {level:g}")
    began = time.perf_counter()
    block = _block(model)
    with one_thread():
        problem, estimated = prepared(model, settings)
        first = np.array(problem.experiments[0].directions.values)
        results = list[SearchResult]()
        for done, start in enumerate(problem.starts(first, starts), 1):
            results += problem.searches(start) if starts > 1 else [problem.search(start)]
            if progress is not None:
                progress(done, starts)
        best = _best(results, problem)
        while (other := _in_another_assembly(best, problem)) is not None:
            results.append(other)
            best = other
        return _result(model, block, problem, best, results, estimated, ci, level, began)


def _block(model: Model) -> FitBlock:
    if model.fit is None:
        raise UsageError(
            f"{model.path} has no `fit` block, which names the data and the quantities to fit;"
            " see docs/fit.md"
        )
    return model.fit


def prepared(model: Model, settings: SettingsOverrides | None = None) -> tuple[Problem, bool]:
    """Read the data and prepare the runs of a fit; for the parameters and errors see `fit`.

    Returns
    -------
    problem : Problem
    estimated : bool
        Whether the standard deviation of the data is to be estimated.
    """
    block = _block(model)
    names = direction_names(model, [x.name for x in block.fitted], "`parameters` of `fit`")
    folder = os.path.dirname(model.path) if model.path else ""
    data = [read_measured(file, folder, model, block.observed) for file in block.data]
    models = [_with_values(model, file) for file in block.data]
    overrides = (settings or SettingsOverrides()).replace(sensitivity=None)
    chosen = [resolve(overrides, x.settings.replace(sensitivity=None, **_NO_GRID)) for x in models]
    experiments = experiments_of(models, chosen, data, names)
    first = experiments[0].directions
    low, high = (np.array([getattr(x, end) for x in block.fitted]) for end in ("low", "high"))
    for name, entry, value in zip(names, block.fitted, first.values, strict=True):
        if not entry.low <= value <= entry.high:
            raise ModelError(
                [
                    Diagnostic(
                        "bad-setting",
                        f"the model's value {value:g} of `{name}` lies outside {entry.low:g} to"
                        f" {entry.high:g}",
                        entry.location,
                        "it is where the search begins: change the value, or the bounds",
                    )
                ]
            )
    problem = Problem(experiments, low, high, first.scales)
    _limit_steps(problem, first.values)
    return problem, sigma_estimated(data)


#: The times are those of the data.
_NO_GRID: dict[str, None] = dict.fromkeys(("samples", "dt", "times", "t_end"))


def _with_values(model: Model, file: DataFile) -> Model:
    """Return the model with the values of one experiment."""
    if not file.set and not file.initial:
        return model
    try:
        return load_text(
            model.text,
            model.path,
            {**model.set, **file.set},
            {**model.set_initial, **file.initial},
            model.data,
        )
    except ModelError as error:
        place = (f"the value is that of {file.path} under `data` of `fit`", file.location)
        raise ModelError([x._replace(notes=(*x.notes, place)) for x in error.diagnostics]) from None


def _limit_steps(problem: Problem, values: Array) -> None:
    """Limit the steps of each run relative to those at the model's values."""
    factor, more = _STEPS
    for experiment in problem.experiments:
        try:
            steps = experiment.steps(values.tolist())
        except FailedRun:
            continue
        most = min(experiment.settings.max_steps, factor * steps + more)
        experiment.settings = experiment.settings.replace(max_steps=most)


def _best(results: list[SearchResult], problem: Problem) -> SearchResult:
    ended = [x for x in results if x.evaluation is not None]
    if not ended:
        reasons = "; ".join(
            f"{reason} ({counted(n, 'run')})" for reason, n in problem.failures.most_common(3)
        )
        raise NumericalError(
            f"no fit: every search failed at its first run: {reasons}; begin with values for which"
            " the model runs, or give --starts 20"
        )
    least = min(ended, key=lambda x: x.cost)
    for _ in range(_AGAIN):
        if least.converged:
            return least
        assert least.evaluation is not None
        least = problem.search(least.values, near=least.evaluation.assembly)
    return min([*ended, least], key=lambda x: (not x.converged, x.cost))


def _in_another_assembly(best: SearchResult, problem: Problem) -> SearchResult | None:
    """Return the result of a search in another assembly if it fits better."""
    assert best.evaluation is not None
    for assembly in problem.others(best.values, best.evaluation.assembly):
        found = problem.search(best.values, near=assembly)
        if found.converged and found.cost < (1 - _BETTER) * best.cost:
            return found
    return None


def _reproduced(
    best: SearchResult, problem: Problem
) -> tuple[SearchResult, dict[str, float], tuple[str, ...]]:
    """Return the result of runs that begin at guesses, these, and the data that need others.

    The search has followed an assembly from run to run, to which the model's guesses need not lead.
    """
    assert best.evaluation is not None
    own, values = best.evaluation.assembly, best.values.tolist()
    pairs = list(zip(problem.experiments, own, strict=True))
    guesses: dict[str, float] = {}
    if not all(x.leads_to(state, values, guesses) for x, state in pairs):
        guesses = problem.experiments[0].guesses(own[0])
    apart = tuple(x.data.path for x, state in pairs if not x.leads_to(state, values, guesses))
    evaluation = problem.evaluate(best.values, own if guesses else None)
    if evaluation is None:
        return best, guesses, apart
    cost = 0.5 * float(evaluation.residuals @ evaluation.residuals)
    return best._replace(cost=cost, evaluation=evaluation), guesses, apart


def _result(
    model: Model,
    block: FitBlock,
    problem: Problem,
    best: SearchResult,
    results: list[SearchResult],
    estimated: bool,
    ci: Literal["wald", "profile"],
    level: float,
    began: float,
) -> FitResult:
    shown = problem.experiments[0]
    names = shown.directions.names
    active = _active(best, problem, estimated)
    best, guesses, apart = _reproduced(_at_bounds(best, active, problem), problem)
    evaluation = best.evaluation
    assert evaluation is not None
    free = np.array([not bound for bound in active])
    residuals, jacobian = evaluation.residuals, evaluation.jacobian
    sure = uncertainty(residuals, jacobian, best.values, problem.scales, names, free, estimated)
    errors, half = sure.standard_errors, quantile(level, sure.freedom, estimated)
    low, high = best.values - half * errors, best.values + half * errors
    if ci == "profile":
        for i in np.flatnonzero(np.isfinite(errors)):
            rise = (half * sure.sigma) ** 2
            low[i], high[i] = profile_interval(
                problem, best.values, evaluation.assembly, int(i), errors[i], rise
            )
    square = 2 * best.cost / sure.sigma**2 if sure.sigma else 0.0
    probability = math.nan
    if not estimated and sure.freedom > 0:
        from scipy.stats import chi2

        probability = float(chi2.sf(square, sure.freedom))
    data = tuple(
        _fitted(x, best.values, state, sure.sigma)
        for x, state in zip(problem.experiments, evaluation.assembly, strict=True)
    )
    return FitResult(
        model_name=model.name,
        model=model.text,
        model_sha256=model.sha256,
        inputs=input_tables(model),
        names=names,
        units=_units(model, block),
        values=best.values,
        start=shown.directions.values,
        bound_low=problem.low,
        bound_high=problem.high,
        active=active,
        standard_errors=errors,
        low=low,
        high=high,
        covariance=sure.covariance,
        correlation=sure.correlation,
        level=level,
        intervals=ci,
        chi_square=square,
        freedom=sure.freedom,
        probability=probability,
        sigma_estimated=estimated,
        combinations=sure.combinations,
        converged=best.converged,
        message=best.message,
        starts=np.array([x.start for x in results]),
        ends=np.array([x.values for x in results]),
        costs=np.array([2 * x.cost for x in results]),
        runs=problem.runs,
        failures=dict(problem.failures),
        guesses=guesses,
        apart=apart,
        observed=tuple(x.name for x in block.observed),
        data=data,
        parameters=dict(
            zip(model.parameters, shown.directions.state(0.0, best.values.tolist()).p, strict=True)
        ),
        options=shown.settings.as_dict(),
        seconds=time.perf_counter() - began,
    )


def _active(best: SearchResult, problem: Problem, estimated: bool) -> tuple[str, ...]:
    """Return the bounds on which values lie: near them and, within the data's errors, on them."""
    assert best.evaluation is not None
    values, (residuals, jacobian, _) = best.values, best.evaluation
    near = _ON_BOUND * np.maximum(np.abs(values), problem.scales)
    freedom = len(residuals) - len(values)
    variance = 2 * best.cost / freedom if estimated and freedom > 0 else 1.0

    def on(bound: float, i: int) -> bool:
        step = bound - values[i]
        if abs(step) > near[i]:
            return False
        column = jacobian[:, i] * step
        rise = 2 * float(residuals @ column) + float(column @ column)
        return step == 0.0 or rise <= _RISE * variance

    return tuple(
        "min" if on(problem.low[i], i) else "max" if on(problem.high[i], i) else ""
        for i in range(len(values))
    )


def _at_bounds(best: SearchResult, active: tuple[str, ...], problem: Problem) -> SearchResult:
    """Return a result with the values that lie on a bound equal to it, if the model runs there.

    The search approaches a bound without reaching it.
    """
    limits = {"min": problem.low, "max": problem.high, "": best.values}
    values = np.array([limits[bound][i] for i, bound in enumerate(active)])
    if (values == best.values).all():
        return best
    assert best.evaluation is not None
    evaluation = problem.evaluate(values, best.evaluation.assembly)
    if evaluation is None:
        return best
    cost = 0.5 * float(evaluation.residuals @ evaluation.residuals)
    return best._replace(values=values, cost=cost, evaluation=evaluation)


def _fitted(
    experiment: Experiment, values: Array, near: ConsistentState, sigma: float
) -> FittedData:
    model = experiment.simulate(values.tolist(), near)
    data = experiment.data
    sigmas = np.where(np.isfinite(data.sigmas), data.sigmas, sigma)
    times, curve = data.times, model
    if len(times) < _DRAWN:
        times = np.linspace(times[0], times[-1], _DRAWN)
        curve = experiment.simulate(values.tolist(), near, times)
    return FittedData(data.path, data.times, data.values, model, sigmas, times, curve)


def _units(model: Model, block: FitBlock) -> dict[str, str]:
    """Return the known units, in SI."""
    coordinates = {c.name: si_notation(c.unit) for c in model.coordinates if c.unit}
    units = {p.name: si_notation(p.unit) for p in model.parameters.values() if p.unit}
    units |= coordinates
    units |= {f"{q}'": unit_quotient(unit, "s") for q, unit in coordinates.items()}
    units |= {name: si_notation(unit) for name, unit in model.output_units.items()}
    units |= {x.name: si_notation(x.unit) for x in block.observed if x.unit}
    wanted = {*(x.name for x in block.fitted), *(x.name for x in block.observed)}
    return {name: unit for name, unit in units.items() if name in wanted}
