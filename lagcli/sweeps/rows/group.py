"""Rows with the same structure: derived once, then run in batches."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from lagcli.arrays import Array, Flags, Indices
from lagcli.engine.constraints.initial import ConsistentState
from lagcli.engine.contract import Block, IntegrationRequest, Interrupted, Outcome
from lagcli.engine.integrate.engine import integrate, switches
from lagcli.engine.layout import Counts, SampleLayout
from lagcli.engine.switching.free_starts import FreeStarts
from lagcli.engine.system import State, System
from lagcli.errors import LagcliError, ModelError, NumericalError, UsageError
from lagcli.model.measures import read_measures
from lagcli.model.model import InitialValue, Model
from lagcli.simulations.sampling import ParameterChanges, sample_times
from lagcli.simulations.simulation import Simulation, ready, warnings_of
from lagcli.simulations.start import freedom_at, message_of, warnings_at_start
from lagcli.simulations.trust import undefined_rows
from lagcli.simulations.variants import Values, Variants
from lagcli.sweeps.rows.measures import Grid, Measuring, Signals, kept_signals, of_log

if TYPE_CHECKING:
    from lagcli.engine.constraints.initial_batch import StartSearch


class FinishedRuns(NamedTuple):
    """Completed runs, including those that could not start.

    Parameters
    ----------
    places : (k,) array of int
        Indices of the requested rows.
    samples : (k, nt, width) array
        Sample rows, as in `SampleLayout`, at all times of the grid; for a failed run, if k is 1, up
        to its end.
    runs : list of k Run or LagcliError
        Outcome of each run, or why it did not start.
    parameters : (k, np) array
    starts : list of k ConsistentState
        The initial states; empty if the run did not start.
    changes : sequence of (int, tuple of float)
        For a single run: samples from which events set other parameter values.
    """

    places: Indices
    samples: Array
    runs: list[Outcome | LagcliError]
    parameters: Array
    starts: list[ConsistentState]
    changes: ParameterChanges = ()


class MeasuredRuns(NamedTuple):
    """What is computed from the samples of k runs.

    Parameters
    ----------
    measures : (k, m) array
    kept : (k, samples, columns) array
        Stored columns.
    undefined : mapping of int to str
        Warnings of runs with signals or measures that are not finite, by index.
    """

    measures: Array
    kept: Array
    undefined: Mapping[int, str]


class RowGroup:
    """A model derived once, for rows that differ only in values.

    Parameters
    ----------
    variants : Variants
    columns : sequence of str
        The varied parameters and initial values, for which `Variants.together` is true.
    measures : sequence of (name, text)
    kept : bool
        Whether the samples are stored.

    Raises
    ------
    ModelError, UsageError
        A measure or a setting is invalid for the model.
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
        plan = read_measures(model, measures)
        self._measures = plan
        self.measuring = Measuring(plan, list(model.parameters))
        self.grid = Grid(sample_times(variants.settings), self.measuring.times)
        self._check_times()
        self._request: IntegrationRequest | Literal[False] | None = None  # not prepared yet
        self._extra = kept_signals(variants.equations) if kept else {}
        self._layout = SampleLayout(Counts(len(model.coordinates), len(model.constraints)))
        self.kept_names = _state_names(model) + list(self._extra) if kept else []
        wanted = [r.signal for r in self.measuring.reductions]
        self.signals = Signals(variants.equations, [*wanted, *self._extra.values()])
        self._signal_names = [*self.measuring.names, *self._extra]

    def _check_times(self) -> None:
        start, end = self.variants.settings.t_start, self.variants.settings.t_end
        for time in self.measuring.times:
            if not start <= time <= end:
                raise UsageError(
                    f"--measure is evaluated at t = {time:g} s, but the run goes from {start:g} to"
                    f" {end:g} s; take a time in it, or another --t-end"
                )

    def run(
        self,
        table: Array,
        sink: Callable[[FinishedRuns], None],
        check_cancelled: Callable[[], None],
    ) -> None:
        """Run rows; each is passed to ``sink`` once, in any order.

        Parameters
        ----------
        table : (n, columns) array
            The varied values, in SI.
        sink : callable
            Receives the completed rows, at most a few dozen at a time.
        check_cancelled : callable
            Called several times per 0.1 s; may raise `Interrupted`.
        """
        values = self.variants.values(self.columns, table)
        rest = self._together(values, sink, check_cancelled)
        own = self._free_request if switches(self.variants.system) else None
        free = np.zeros(len(table), dtype=bool)
        if own is not None:
            free = self._free(own.state.t, values.parameters, values.q, values.v)
        for place in rest:
            if own is not None and free[place]:
                p, q, v = (x[place] for x in (values.parameters, values.q, values.v))
                state = State(own.state.t, q.copy(), v.copy(), tuple(p.tolist()))
                request = own._replace(state=state)
                sink(self._alone(place, request, self.variants.system, values, check_cancelled))
            else:
                sink(self.single(place, table[place], values, check_cancelled))

    def measured(self, ended: FinishedRuns) -> MeasuredRuns:
        """Return the measures and stored columns of runs.

        Parameters
        ----------
        ended : FinishedRuns
        """
        parameters = ended.parameters
        signals = self.signals(ended.samples, parameters, ended.changes)
        runs, _, reached = signals.shape
        split = len(self.measuring.reductions)
        measures = np.full((runs, self.measuring.count), np.nan)
        grid = self.grid if reached == len(self.grid.all) else self.grid.reached(reached)
        if len(grid.times):
            happened = self._happened(ended)
            measures = self.measuring(signals[:, :split], parameters, grid, happened)
        undefined = undefined_rows(self._signal_names, grid.all, signals)
        for i, k in np.argwhere(~np.isfinite(measures[:, self.measuring.expected])).tolist():
            name = [m.name for m in self._measures][self.measuring.expected[k]]
            undefined.setdefault(i, f"the measure `{name}` is not finite")
        if not self.kept_names:
            return MeasuredRuns(measures, np.empty((runs, 0, 0)), undefined)
        rows = np.concatenate(
            [
                ended.samples[:, :, self._layout.q.start : self._layout.work.start],
                signals[:, split:].swapaxes(1, 2),
            ],
            axis=2,
        )
        kept = rows[:, self.grid.samples[self.grid.samples < reached]]
        return MeasuredRuns(measures, kept, undefined)

    def _happened(self, ended: FinishedRuns) -> Array | None:
        """Return the values that measures take from event logs, (k, n); None if they take none."""
        asked = self.measuring.of_events
        if not asked:
            return None
        from lagcli.simulations.event_logs import event_log

        system = self.variants.system
        counts = np.full((len(ended.runs), len(asked)), np.nan)
        for i, run in enumerate(ended.runs):
            log = event_log(system, run) if isinstance(run, Outcome) else None
            if log is not None:
                counts[i] = [of_log(log, x, system.constraints) for x in asked]
        return counts

    def warnings(self, ended: FinishedRuns, i: int) -> tuple[str, ...]:
        """Return the warnings of the i-th run, which is completed."""
        run = ended.runs[i]
        assert isinstance(run, Outcome)
        variants, p, start = self.variants, tuple(ended.parameters[i].tolist()), ended.starts[i]
        system, settings = variants.system, variants.settings
        return (
            *variants.model.units.warnings,
            *warnings_at_start(
                system,
                start,
                lambda: freedom_at(variants.equations, system, start, settings.closed),
            ),
            *warnings_of(system, p, settings, ended.samples[i], run, ended.changes),
            *run.notes,
        )

    # in batches

    def _common(self, check_cancelled: Callable[[], None]) -> IntegrationRequest | None:
        """Return the common data of all runs; None if they are not run in batches.

        The preparation uses the model's own values, so that no row depends on the others in its
        batch. It takes as long as one run.
        """
        if self._request is None:
            self._request = self._prepare(check_cancelled)
        return self._request or None

    def _prepare(self, check_cancelled: Callable[[], None]) -> IntegrationRequest | Literal[False]:
        variants = self.variants
        if switches(variants.system):  # each row ends steps where its own branches change
            return False
        from lagcli.engine.integrate.batch import prepare_batch

        try:
            simulation = ready(variants.equations, variants.system, variants.settings, {})
        except (ModelError, NumericalError):
            return False
        request = simulation.request._replace(times=self.grid.all)
        prepared = prepare_batch(variants.system, request, check_cancelled)
        return request._replace(prepared=prepared)

    @cached_property
    def _search(self) -> StartSearch:
        """The search for initial states, whose programs serve all rows that run in batches."""
        from lagcli.engine.constraints.initial_batch import StartSearch

        assert self._request
        return StartSearch(self.variants.system, self._request.rank)

    def _together(
        self,
        values: Values,
        sink: Callable[[FinishedRuns], None],
        check_cancelled: Callable[[], None],
    ) -> Indices:
        """Run the rows that can be run in batches; return the indices of the others."""
        request, system = self._common(check_cancelled), self.variants.system
        if request is None:
            return np.arange(len(values.q))
        from lagcli.engine.integrate.batch import Finished, run_batch, suits_batch

        if not suits_batch(system, request):
            return np.arange(len(values.q))
        starts = self._search(request.settings.t_start, *values)
        ordinary = np.flatnonzero(starts.found)

        def take(finished: Finished) -> None:
            places = ordinary[finished.rows]
            runs = [self._said(run) for run in finished.runs]
            began = [
                ConsistentState(
                    State(
                        request.state.t,
                        starts.q[k],
                        starts.v[k],
                        tuple(values.parameters[k].tolist()),
                    ),
                    request.rank,
                    request.elimination,
                    {},
                )
                for k in places
            ]
            sink(FinishedRuns(places, finished.samples, [*runs], values.parameters[places], began))

        parameters, q, v = (x[ordinary] for x in (values.parameters, starts.q, starts.v))
        run_batch(system, request, parameters, q, v, take, check_cancelled)
        return np.flatnonzero(~starts.found)

    def _said(self, run: Outcome) -> Outcome:
        """Return a run whose message includes the location in the model of its cause."""
        run.message = message_of(self.variants.equations, run)
        return run

    # one by one

    def single(
        self, place: int, given: Array, values: Values, check_cancelled: Callable[[], None]
    ) -> FinishedRuns:
        """Run one row by itself.

        Parameters
        ----------
        place : int
            Index of the row in the values.
        given : (columns,) array
            Its varied values, in SI.
        values : Values
            Values of all rows.
        check_cancelled : callable
            As for `run`.
        """
        places = np.array([place])
        width = self._layout.size
        try:
            simulation = self._simulation(place, given, values)
        except LagcliError as error:
            return FinishedRuns(
                places, np.empty((1, 0, width)), [error], values.parameters[places], []
            )
        return self._alone(place, simulation.request, simulation.system, values, check_cancelled)

    def _alone(
        self,
        place: int,
        request: IntegrationRequest,
        system: System,
        values: Values,
        check_cancelled: Callable[[], None],
    ) -> FinishedRuns:
        """Integrate one row from its initial state."""
        places = np.array([place])
        rows = [np.empty((0, self._layout.size))]
        changes: list[tuple[int, tuple[float, ...]]] = []
        request = request._replace(
            times=self.grid.all,
            on_parameters=lambda p: changes.append((sum(map(len, rows)), p)),
        )

        def take(block: Block) -> None:
            rows.append(np.column_stack(block))

        run = integrate(system, request, take, lambda t: check_cancelled())
        if run.status == "interrupted":
            raise Interrupted
        said = self._said(run)
        parameters = values.parameters[places]
        samples = np.concatenate(rows)[None]
        start = ConsistentState(request.state, request.rank, request.elimination, {})
        return FinishedRuns(places, samples, [said], parameters, [start], changes)

    # those that switch, from their given values

    @cached_property
    def _free(self) -> FreeStarts:
        """The check of initial values, for all rows."""
        return FreeStarts(self.variants.system)

    @cached_property
    def _free_request(self) -> IntegrationRequest | None:
        """The request of rows that start at their given values; None if none does."""
        variants = self.variants
        system, model = variants.system, variants.model
        if system.switching is None or model.inputs or model.events or not self._free.any:
            return None
        try:
            own = ready(variants.equations, system, variants.settings, {})
        except (ModelError, NumericalError):
            return None
        return None if own.start.elimination else own.request

    def _simulation(self, place: int, given: Array, values: Values) -> Simulation:
        """Return the simulation of one row; raises an error if it cannot start."""
        variants = self.variants
        parameters, q, v = (x[place] for x in (values.parameters, values.q, values.v))
        if not all(np.isfinite(x).all() for x in (parameters, q, v)):
            return self._explained(given)
        model = self._model(place, values)
        equations = dataclasses.replace(variants.equations, model=model)
        prepared = self._request.prepared if self._request else None
        return ready(equations, variants.system, variants.settings, {}, prepared)

    def _model(self, place: int, values: Values) -> Model:
        """Return the model with the values of one row."""
        model = self.variants.model
        return dataclasses.replace(
            model,
            parameters={
                name: p._replace(value=float(x))
                for (name, p), x in zip(
                    model.parameters.items(), values.parameters[place], strict=True
                )
            },
            initial_positions=_initial(model.initial_positions, values.q[place], values.fixed_q),
            initial_velocities=_initial(model.initial_velocities, values.v[place], values.fixed_v),
            spins={spin.name: spin.fixed for spin in values.spins},
        )

    def _explained(self, given: Array) -> Simulation:
        """Raise the loader's error for the values of a row."""
        model = self.variants.model
        values = dict(zip(self.columns, given.tolist(), strict=True))
        return self.variants.varied(
            {name: x for name, x in values.items() if name in model.parameters},
            {name: x for name, x in values.items() if name not in model.parameters},
        )


def _initial(
    table: Mapping[str, InitialValue], values: Array, fixed: Flags
) -> dict[str, InitialValue]:
    return {
        name: entry._replace(value=float(x), fixed=bool(f))
        for (name, entry), x, f in zip(table.items(), values, fixed, strict=True)
    }


def _state_names(model: Model) -> list[str]:
    q, c = model.coordinate_names, model.constraint_names
    return [*q, *(f"{x}'" for x in q), *(f"{x}''" for x in q), *(f"lambda.{x}" for x in c)]
