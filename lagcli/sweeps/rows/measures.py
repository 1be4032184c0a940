"""Measures of many runs: signals of samples, and their extremes, means, times of conditions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
import symengine as se
from symengine import Basic

from lagcli.arrays import Array
from lagcli.columns import RESIDUALS, SAMPLED, SCALARS, column_names, read_dotted_name
from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.tape.interpreter import run_arrays
from lagcli.engine.tape.tape import Tape
from lagcli.equations.derivation.column_expressions import (
    ENERGY_BEFORE,
    WORK,
    column_expression,
    largest,
)
from lagcli.equations.derivation.lagrange import ConstraintEquation, Equations, with_forces
from lagcli.errors import UsageError
from lagcli.model.measures import EventMeasure, Measure, Reduction, reduced
from lagcli.model.model import TIME, multiplier
from lagcli.simulations.sampling import ParameterChanges, parts_of_constant_parameters
from lagcli.trajectory.event_log import EventLog


class Grid:
    """Sample times, and additional times for measures.

    Parameters
    ----------
    times : (nt,) array
        Times of the samples, over which measures are evaluated.
    more : sequence of float
        Times of ``at``.

    Attributes
    ----------
    all : array
        All times, in order.
    """

    def __init__(self, times: Array, more: Sequence[float]):
        self.times = times
        self.all = np.union1d(times, np.array(more, dtype=np.float64))
        self.samples = np.searchsorted(self.all, times)
        self.same = len(self.all) == len(times)
        #: weight of each sample in a mean over time, by the trapezoidal rule
        self.weights = np.ones(1)
        if len(times) > 1:
            steps = np.diff(times)
            self.weights = np.concatenate([steps, [0.0]]) + np.concatenate([[0.0], steps])
            self.weights /= 2 * (times[-1] - times[0])

    def reached(self, count: int) -> Grid:
        """Return the first of the times: those of a run that an event stops."""
        samples = self.samples[self.samples < count]
        return Grid(self.all[samples], self.all[:count].tolist())

    def of_samples(self, signals: Array) -> Array:
        """Return signals at the sample times; time is their last axis."""
        return signals if self.same else np.ascontiguousarray(signals[..., self.samples])

    def place(self, time: float) -> int:
        """Return the index of a time among all times."""
        return int(np.searchsorted(self.all, time))


class Measuring:
    """Evaluates measures of many runs.

    Parameters
    ----------
    measures : sequence of m Measure
    parameters : sequence of str
        Names, in the model's order.

    Attributes
    ----------
    reductions : list of Reduction
        Distinct reductions of all measures; the signals passed are in this order.
    names : list of str
        The first measure that uses each reduction.
    count : int
        Values of m measures.
    expected : list of int
        The measures that always have a value: those without times of conditions, values at given
        times and entries of event logs.
    """

    def __init__(self, measures: Sequence[Measure], parameters: Sequence[str]):
        self.reductions: list[Reduction] = []
        self.names: list[str] = []
        self.count = len(measures)
        self.expected = [
            i
            for i, measure in enumerate(measures)
            if not any(r.kind in ("time_of", "at") or r.event for r in measure.reductions)
        ]
        values = []
        for measure in measures:
            places = {}
            for i, reduction in enumerate(measure.reductions):
                if reduction not in self.reductions:
                    self.reductions.append(reduction)
                    self.names.append(measure.name)
                places[reduced(i)] = se.Symbol(f"#all{self.reductions.index(reduction)}")
            values.append(measure.value.xreplace(places))
        symbols = [se.Symbol(f"#all{i}") for i in range(len(self.reductions))]
        self._tape = compile_tape(values, symbols, [se.Symbol(name) for name in parameters])

    @property
    def times(self) -> list[float]:
        """The times of ``at``."""
        return [r.time for r in self.reductions if r.time is not None]

    @property
    def of_events(self) -> list[EventMeasure]:
        """Values requested from event logs."""
        return [r.event for r in self.reductions if r.event is not None]

    def __call__(
        self, signals: Array, parameters: Array, grid: Grid, happened: Array | None = None
    ) -> Array:
        """Return the measures, (runs, m).

        Parameters
        ----------
        signals : (runs, reductions, times of the grid) array
        parameters : (runs, np) array
        grid : Grid
        happened : (runs, len(of_events)) array, optional
            Values from event logs, if any are requested.
        """
        logged = iter(() if happened is None else happened.T)
        reductions = [
            next(logged) if reduction.event else _number(reduction, signals[:, i], grid)
            for i, reduction in enumerate(self.reductions)
        ]
        return run_arrays(self._tape, [*reductions, *parameters.T], len(signals)).T


def of_log(log: EventLog, asked: EventMeasure, constraints: Sequence[str]) -> float:
    """Return a value from an event log; NaN for the time of an event that did not occur.

    Parameters
    ----------
    log : EventLog
    asked : EventMeasure
    constraints : sequence of str
        Names of constraints in the order of the impulses.
    """
    if asked.kind == "impulse":
        return float(log.total_impulse()[constraints.index(asked.name)])
    times = log.instants(asked.name, asked.occurrence)
    if asked.kind == "count":
        return float(len(times))
    return float(times[0]) if len(times) else math.nan


def _number(reduction: Reduction, signal: Array, grid: Grid) -> Array:
    """Return one number of each run's signal, (runs,); max, min, argmax and argmin ignore NaN."""
    kind = reduction.kind
    if kind == "at":
        assert reduction.time is not None
        if reduction.time > grid.all[-1]:
            return np.full(len(signal), np.nan)
        return signal[:, grid.place(reduction.time)]
    x = np.ascontiguousarray(grid.of_samples(signal))
    if kind == "final":
        return x[:, -1]
    if kind == "max":
        return np.fmax.reduce(x, axis=1)
    if kind == "min":
        return np.fmin.reduce(x, axis=1)
    if kind == "mean":
        # sums along each run in order: they do not depend on the other runs
        return (x * grid.weights).sum(axis=1)
    if kind == "rms":
        return np.sqrt((x * x * grid.weights).sum(axis=1))
    if kind == "time_of":
        wanted = x > 0.5
    else:
        extreme = np.fmax.reduce(x, axis=1) if kind == "argmax" else np.fmin.reduce(x, axis=1)
        wanted = x == extreme[:, None]
    first = np.argmax(wanted, axis=1)
    return np.where(wanted[np.arange(len(x)), first], grid.times[first], np.nan)


#: Columns of stored trajectories.
STATE = ("time", "q", "v", "a", "multipliers")
_SCALARS = {quantity.name for quantity in SCALARS}
_RESIDUALS = {quantity.name for quantity in RESIDUALS}
#: Number of samples evaluated at once: their registers fit in the cache.
_TOGETHER = 1 << 12


class Signals:
    """Expressions in t, q, v, a, λ and the columns of result files, over many runs at once.

    Parameters
    ----------
    equations : Equations
    expressions : sequence of expressions
        See `lagcli.model.measures`.

    Raises
    ------
    UsageError
        The residual of a position constraint is requested for a nonholonomic constraint.
    """

    def __init__(self, equations: Equations, expressions: Sequence[Basic]):
        eq = equations
        numbered = {str(i): x for i, x in enumerate(expressions)}
        written = with_forces(eq.model, eq.constraints, numbered)
        columns = _ColumnSymbols(eq)
        outputs = [x.xreplace(columns.in_expression(x)) for x in written.values()]
        parameters = [se.Symbol(name) for name in eq.model.parameters]
        lambdas = [multiplier(c.constraint.name) for c in eq.constraints]
        state = [TIME, *eq.q, *eq.v, *eq.a, *lambdas, WORK]
        functions = input_functions(eq.model)
        tape = compile_tape(outputs, state, [*parameters, ENERGY_BEFORE], functions)
        self._evaluate: Callable[[Array, Array], Array] = partial(_run_blocks, tape)
        if not functions.functions:
            from lagcli.engine.integrate.batch import SampleTape

            self._evaluate = SampleTape(tape)
        self._balance = any(ENERGY_BEFORE in x.free_symbols for x in outputs)
        self._energy = compile_tape([eq.energy - WORK], state, parameters, functions)

    def __call__(self, samples: Array, parameters: Array, changes: ParameterChanges = ()) -> Array:
        """Return the signals, (runs, signals, nt).

        Parameters
        ----------
        samples : (runs, nt, width) array
            Sample rows t, q, v, a, λ, W.
        parameters : (runs, np) array
            Values at the first sample.
        changes : sequence of (int, tuple of float), optional
            For a single run: samples from which events set other parameter values.
        """
        runs, count = samples.shape[:2]
        before = np.zeros(runs)
        if self._balance and count:
            first = [*samples[:, 0].T, *parameters.T]
            before = run_arrays(self._energy, first, runs)[0]
        if changes:
            own = tuple(parameters[0].tolist())
            parts = parts_of_constant_parameters(count, own, changes)
            blocks = [self._evaluate(samples[:, k], np.array([[*p, before[0]]])) for k, p in parts]
            return np.concatenate(blocks, axis=2)
        return self._evaluate(samples, np.column_stack([parameters, before]))


def _run_blocks(tape: Tape, samples: Array, constants: Array) -> Array:
    """Run a tape over samples, as `lagcli.engine.integrate.batch.SampleTape` does."""
    runs, count = samples.shape[:2]
    values = np.empty((runs, len(tape.outputs), count))
    step = max(1, _TOGETHER // max(1, count))
    for start in range(0, runs, step):
        part = slice(start, start + step)
        mine = samples[part]
        inputs = np.ascontiguousarray(mine.reshape(-1, mine.shape[2]).T)
        steady = np.repeat(constants[part], count, axis=0).T
        out = run_arrays(tape, [*inputs, *steady], len(mine) * count)
        values[part] = out.reshape(-1, len(mine), count).swapaxes(0, 1)
    return values


class _ColumnSymbols:
    """The columns of results in expressions, as expressions."""

    def __init__(self, equations: Equations):
        self.equations = equations
        self.rows = {c.constraint.name: c for c in equations.constraints}

    def in_expression(self, expression: Basic) -> dict[Basic, Basic]:
        """Return the expressions of the columns that an expression names, by symbol."""
        parameters = self.equations.model.parameters
        names = (s for s in expression.free_symbols if s.name not in parameters)
        columns = {s: self._column(s.name) for s in names}
        return {symbol: column for symbol, column in columns.items() if column is not None}

    def _column(self, name: str) -> Basic | None:
        """Return the expression of a column; None for any other symbol."""
        if name in _SCALARS:
            return column_expression(self.equations, name)
        if name in _RESIDUALS:  # of all constraints
            parts = (_part(c, name) for c in self.equations.constraints)
            return largest([part for part in parts if part is not None])
        named = read_dotted_name(name)
        if named is None or named.quantity not in _RESIDUALS:
            return None
        residual = _part(self.rows[named.constraint], named.quantity)
        if residual is None:
            other = named._replace(quantity="residual_velocity")
            raise UsageError(
                f"`{name}`: the constraint `{named.constraint}` is nonholonomic and has no"
                f" position; take {other}"
            )
        return residual


def _part(constraint: ConstraintEquation, residual: str) -> Basic | None:
    """Return a residual of one constraint; None for the position of a nonholonomic one."""
    return constraint.position if residual == "residual_position" else constraint.velocity


def kept_signals(equations: Equations) -> Mapping[str, Basic]:
    """Return the signals of a stored trajectory besides the state, by column."""
    model = equations.model
    derived = [q for q in SAMPLED if q.kept and q.name not in STATE]
    names = [
        str(name)
        for quantity in derived
        for name in column_names(quantity, model.coordinate_names, model.constraint_names)
    ]
    columns = {name: se.Symbol(name) for name in names}
    return {**columns, **{f"outputs.{n}": x for n, x in model.outputs.items()}}
