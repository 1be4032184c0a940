"""Rows of one structure: derived once, then run many at a time."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lagcli.engine.run import Block, Interrupted, Run
from lagcli.errors import LagcliError, UsageError
from lagcli.model.measures import read_measures
from lagcli.model.model import InitialValue, Model
from lagcli.simulation import Simulation, engine_of, ready, sample_times
from lagcli.start import describe_undefined
from lagcli.sweeps.reductions import Grid, Measuring
from lagcli.sweeps.signals import Signals, kept_signals
from lagcli.variants import Values, Variants

Array = NDArray[np.float64]


class Ended(NamedTuple):
    """Runs that ended, or never began.

    Parameters
    ----------
    places : (k,) array of int
        Which of the rows that were asked for.
    samples : (k, nt, 2 + 3 nq + nc) array
        t, q, v, a, λ, W at all times of the grid; where k is 1 and the run failed, at those
        that were reached.
    runs : list of k Run or LagcliError
        How each ended, or why it did not begin.
    """

    places: NDArray[np.intp]
    samples: Array
    runs: list[Run | LagcliError]


class Group:
    """A model derived once, for rows that differ in numbers alone.

    Parameters
    ----------
    variants : Variants
    columns : sequence of str
        The varied parameters and initial values, of which `Variants.together` is true.
    measures : sequence of (name, text)
    kept : bool
        Whether the samples are kept.

    Raises
    ------
    ModelError, UsageError
        A measure or a setting does not fit the model.
    """

    def __init__(
        self,
        variants: Variants,
        columns: Sequence[str],
        measures: Sequence[tuple[str, str]],
        kept: bool,
    ):
        self.variants, self.columns = variants, tuple(columns)
        model = variants.model
        found = read_measures(model, measures)
        self.measuring = Measuring(found, list(model.parameters))
        self.grid = Grid(sample_times(variants.settings), self.measuring.times)
        self._check_times()
        self._extra = kept_signals(variants.equations) if kept else {}
        self._state = 1 + 3 * len(model.coordinates) + len(model.constraints)  # t, q, v, a, λ
        self.kept_names = _state_names(model) + list(self._extra) if kept else []
        wanted = [r.signal for r in self.measuring.reductions]
        self.signals = Signals(variants.equations, [*wanted, *self._extra.values()])

    def _check_times(self) -> None:
        start, end = self.variants.settings.t_start or 0.0, self.grid.times[-1]
        for time in self.measuring.times:
            if not start <= time <= end:
                raise UsageError(
                    f"--measure looks at t = {time:g} s, and the run lasts from {start:g} to"
                    f" {end:g} s; take a time in it, or another --t-end"
                )

    def run(self, table: Array, heed: Callable[[], None]) -> Iterator[Ended]:
        """Run rows; each is handed over once, in no certain order.

        Parameters
        ----------
        table : (n, columns) array
            The varied values, in SI.
        heed : callable
            Called several times in 0.1 s; may raise `Interrupted`.
        """
        values = self.variants.values(self.columns, table)
        for place in range(len(table)):
            yield self._single(place, table[place], values, heed)

    def measured(self, ended: Ended, parameters: Array) -> tuple[Array, Array]:
        """Return measures (k, m) and kept columns (k, samples reached, columns) of runs.

        Parameters
        ----------
        ended : Ended
        parameters : (k, np) array
        """
        signals = self.signals(ended.samples, parameters)
        runs, _, reached = signals.shape
        split = len(self.measuring.reductions)
        measures = np.full((runs, self.measuring.count), np.nan)
        if reached == len(self.grid.all):
            measures = self.measuring(signals[:, :split], parameters, self.grid)
        if not self.kept_names:
            return measures, np.empty((runs, 0, 0))
        rows = np.concatenate(
            [ended.samples[:, :, 1 : self._state], signals[:, split:].swapaxes(1, 2)], axis=2
        )
        return measures, rows[:, self.grid.samples[self.grid.samples < reached]]

    # one by one

    def _single(self, place: int, given: Array, values: Values, heed: Callable[[], None]) -> Ended:
        places = np.array([place])
        width = self._state + 1
        try:
            simulation = self._simulation(place, given, values)
        except LagcliError as error:
            return Ended(places, np.empty((1, 0, width)), [error])
        request = dataclasses.replace(simulation.request, times=self.grid.all)
        rows = [np.empty((0, width))]

        def take(b: Block) -> None:
            rows.append(np.column_stack([b.time, b.q, b.v, b.a, b.multipliers, b.work]))

        engine = engine_of(simulation.settings)
        run = engine(simulation.system, request, take, lambda t: heed())
        if run.status == "interrupted":
            raise Interrupted
        if run.undefined is not None:
            run.message += "; " + describe_undefined(simulation.equations, *run.undefined)
        return Ended(places, np.concatenate(rows)[None], [run])

    def _simulation(self, place: int, given: Array, values: Values) -> Simulation:
        """Return the simulation of one row; raises what keeps it from beginning."""
        variants = self.variants
        parameters, q, v = (x[place] for x in (values.parameters, values.q, values.v))
        if not all(np.isfinite(x).all() for x in (parameters, q, v)):
            return self._explained(given)
        model = variants.model
        changed = dataclasses.replace(
            model,
            parameters={
                name: p._replace(value=float(x))
                for (name, p), x in zip(model.parameters.items(), parameters, strict=True)
            },
            initial_positions=_initial(model.initial_positions, q, values.fixed_q),
            initial_velocities=_initial(model.initial_velocities, v, values.fixed_v),
        )
        equations = dataclasses.replace(variants.equations, model=changed)
        system = dataclasses.replace(variants.system, parameters=tuple(parameters.tolist()))
        return ready(equations, system, variants.settings, {})

    def _explained(self, given: Array) -> Simulation:
        """Let the model's own loading say what is wrong with the values of a row."""
        model = self.variants.model
        values = dict(zip(self.columns, given.tolist(), strict=True))
        return self.variants.varied(
            {name: x for name, x in values.items() if name in model.parameters},
            {name: x for name, x in values.items() if name not in model.parameters},
        )


def _initial(
    table: Mapping[str, InitialValue], values: Array, fixed: NDArray[np.bool_]
) -> dict[str, InitialValue]:
    return {
        name: entry._replace(value=float(x), fixed=bool(f))
        for (name, entry), x, f in zip(table.items(), values, fixed, strict=True)
    }


def _state_names(model: Model) -> list[str]:
    q, c = model.coordinate_names, model.constraint_names
    return [*q, *(f"{x}'" for x in q), *(f"{x}''" for x in q), *(f"lambda.{x}" for x in c)]
