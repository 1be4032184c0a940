"""Reductions of the signals of many runs: extremes, means, times of conditions."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import symengine as se

from lagcli.arrays import Array
from lagcli.engine.tape.compiler import compile_tape
from lagcli.engine.tape.interpreter import run_arrays
from lagcli.model.measures import EventMeasure, Measure, Reduction, reduced
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
        found = [se.Symbol(f"#all{i}") for i in range(len(self.reductions))]
        self._tape = compile_tape(values, found, [se.Symbol(name) for name in parameters])

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
        found = [
            next(logged) if reduction.event else _number(reduction, signals[:, i], grid)
            for i, reduction in enumerate(self.reductions)
        ]
        return run_arrays(self._tape, [*found, *parameters.T], len(signals)).T


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
