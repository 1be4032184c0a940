"""Simulation of a model: samples, block by block, and their record; or a complete Trajectory."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.constraints.initial import ConsistentState
from lagcli.engine.contract import Block, IntegrationRequest, Interrupted, Outcome
from lagcli.engine.lowering.lower import lower
from lagcli.engine.system import System
from lagcli.equations.derivation.degrees_of_freedom import DegreesOfFreedom
from lagcli.equations.derivation.lagrange import Equations, derive
from lagcli.model.model import Model, check_is_model
from lagcli.model.result_units import result_display, result_units
from lagcli.settings.settings import Settings, SettingsOverrides, resolve
from lagcli.simulations.cancellation import Interruption
from lagcli.simulations.derived import NO_MONITOR, DerivedColumns, Monitor, monitor_of
from lagcli.simulations.memory import check_fits, numbers_per_sample
from lagcli.simulations.sampling import (
    ParameterChanges,
    absolute_tolerances,
    parts_of_constant_parameters,
    sample_times,
    unit_kinds,
)
from lagcli.simulations.start import find_start, freedom_at, message_of, warnings_at_start
from lagcli.simulations.threads import one_thread
from lagcli.simulations.trust import FiniteColumns, Trust
from lagcli.trajectory.samples import Record, Samples
from lagcli.version import __version__

if TYPE_CHECKING:
    from lagcli.engine.integrate.prepared import Prepared
    from lagcli.engine.sensitivity.integration import Derivatives
    from lagcli.simulations.sensitivity import SensitivityRun
    from lagcli.trajectory.event_log import EventLog
    from lagcli.trajectory.samples import InputTable
    from lagcli.trajectory.trajectory import Trajectory


#: Number of values of a block that are written at once: CSV, the slowest, takes less than 0.1 s.
_BLOCK_NUMBERS = 1 << 16
#: Smallest number of samples that are worth evaluating together.
_LEAST_ROWS = 64
#: Size of the intermediate results of a block, of which few are alive at a time: 64 MB.
_BLOCK_REGISTERS = 1 << 23
#: Settings that only affect models with contacts.
_OF_CONTACTS = ("impacts", "closed")
#: Number of copies of a block while it is completed and written.
_COPIES = 4


def simulate(
    model: Model,
    settings: SettingsOverrides | None = None,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Trajectory:
    """Simulate a model.

    Parameters
    ----------
    model : Model
    settings : SettingsOverrides, optional
        Defaults are taken from the model's ``simulation`` block.
    progress : callable, optional
        Called now and then with the current time, s; a short run may not call it.
    **options
        Settings by name, instead of ``settings``.

    Returns
    -------
    Trajectory
        Its ``status`` states whether the run was completed; a run that fails or is interrupted
        keeps its samples up to that time.

    Raises
    ------
    UsageError
        A setting is out of range or unknown.
    ModelError
        The fixed initial values contradict the constraints.
    NumericalError
        There is no initial state: none is consistent near the guesses, a value there is not finite,
        or a coordinate has no inertia.
    """
    check_is_model(model, "simulate")
    if options:
        settings = SettingsOverrides(**options).over(settings or SettingsOverrides())
    simulation = prepare(model, settings)
    simulation.check_memory(kept=True)
    with Interruption() as interruption:
        return simulation.trajectory(progress, interruption)


def prepare(model: Model, settings: SettingsOverrides | None = None) -> Simulation:
    """Prepare a run: settings, equations, tapes, consistent initial state.

    Parameters
    ----------
    model, settings
        As for `simulate`, which raises the same errors.

    Returns
    -------
    Simulation
        A prepared run.
    """
    chosen = resolve(settings or SettingsOverrides(), model.settings)
    began = time.perf_counter()
    equations = derive(model)
    derived = time.perf_counter()
    system = lower(equations)
    seconds = {"derive": derived - began, "compile": time.perf_counter() - derived}
    simulation = _monitored(ready(equations, system, chosen, seconds))
    return simulation.with_derivatives(chosen.sensitivity) if chosen.sensitivity else simulation


def ready(
    equations: Equations,
    system: System,
    settings: Settings,
    seconds: dict[str, float],
    prepared: Prepared | None = None,
) -> Simulation:
    """Find the initial state of a model whose System exists; the last part of `prepare`.

    Parameters
    ----------
    equations, system
        The equations and the System of a model.
    settings : Settings
        Complete settings.
    seconds : dict of str to float
        Elapsed time by phase.
    prepared : Prepared, optional
        See `lagcli.engine.contract.IntegrationRequest`.
    """
    began = time.perf_counter()
    if equations.model.inputs:
        from lagcli.simulations.inputs import check_input_range

        check_input_range(equations.model, settings.t_start, settings.t_end)
    if equations.model.events:
        from lagcli.simulations.contacts import check_clocks

        check_clocks(equations.model, system, settings)
    with one_thread():
        start = find_start(equations, system, settings.t_start, settings.closed)
    seconds = {**seconds, "integrate": time.perf_counter() - began}
    return Simulation(equations.model, settings, equations, system, start, seconds, prepared)


def _monitored(simulation: Simulation) -> Simulation:
    """Return the simulation with a monitor of the conserved quantities."""
    began = time.perf_counter()
    with one_thread():
        monitor = monitor_of(simulation.equations, simulation.system, simulation.start)
    spent = simulation.seconds["compile"] + time.perf_counter() - began
    seconds = {**simulation.seconds, "compile": spent}
    return replace(simulation, monitor=monitor, seconds=seconds)


@dataclass(frozen=True, eq=False)
class Simulation:
    """A prepared run; created by `prepare`.

    Parameters
    ----------
    model : Model
    settings : Settings
        Complete settings.
    equations : Equations
    system : System
    start : ConsistentState
    seconds : dict of str to float
        Elapsed time by phase.
    prepared : Prepared, optional
        See `lagcli.engine.contract.IntegrationRequest`.
    monitor : Monitor, optional
        Monitor of the conserved quantities.
    sensitivity : SensitivityRun, optional
        Created by `with_derivatives`.
    """

    model: Model
    settings: Settings
    equations: Equations
    system: System
    start: ConsistentState
    seconds: dict[str, float]
    prepared: Prepared | None = None
    monitor: Monitor = NO_MONITOR
    sensitivity: SensitivityRun | None = None

    def with_derivatives(self, names: Sequence[str]) -> Simulation:
        """Return the simulation with derivatives with respect to parameters and initial values.

        Raises
        ------
        UsageError
            There is no such parameter or initial value, or the method does not support derivatives.
        ModelError
            The fixed initial values satisfy the constraints only for the given values.
        """
        from lagcli.simulations.directions import direction_names
        from lagcli.simulations.sensitivity import sensitivity_run

        began = time.perf_counter()
        sensitivity = sensitivity_run(self, direction_names(self.model, names, "sensitivity"))
        spent = self.seconds.get("compile", 0.0) + time.perf_counter() - began
        seconds = {**self.seconds, "compile": spent}
        settings = self.settings.replace(sensitivity=sensitivity.names)
        return replace(self, settings=settings, sensitivity=sensitivity, seconds=seconds)

    @property
    def request(self) -> IntegrationRequest:
        """The request to the engine."""
        return IntegrationRequest(
            state=self.start.state,
            rank=self.start.rank,
            settings=self.settings,
            times=sample_times(self.settings),
            atol=absolute_tolerances(self.settings.atol, self.model.coordinate_names),
            kinds=unit_kinds(self.model.coordinates),
            block_rows=self._block_rows,
            elimination=self.start.elimination,
            prepared=self.prepared,
        )

    @property
    def initial(self) -> dict[str, float]:
        """Initial values of the coordinates and velocities (x')."""
        names = self.model.coordinate_names
        state = [*self.start.state.q.tolist(), *self.start.state.v.tolist()]
        return dict(zip([*names, *(f"{q}'" for q in names)], state, strict=True))

    @cached_property
    def freedom(self) -> DegreesOfFreedom:
        """The degrees of freedom at the initial state."""
        return freedom_at(self.equations, self.system, self.start, self.settings.closed)

    def check_memory(self, kept: bool = False) -> None:
        """Raise NumericalError if the run would need more memory than available.

        Parameters
        ----------
        kept : bool
            Whether all samples are kept in memory; otherwise they are written during the run.
        """
        count = self.settings.sample_count
        rows = min(count, self._block_rows)
        stored = numbers_per_sample(self.system) * self._copies
        numbers = 3 * count + _COPIES * rows * stored
        if kept:
            numbers += 2 * count * stored
        check_fits(
            8 * numbers,
            f"a run of {count} samples",
            "ask for fewer samples" + (", or write them to a file: lagcli simulate -o" * kept),
        )

    @property
    def _copies(self) -> int:
        """Return the largest size of a sample relative to that of the motion."""
        return 1 if self.sensitivity is None else 1 + len(self.sensitivity.names)

    @property
    def _block_rows(self) -> int:
        return max(1, _block_rows(self.system) // self._copies)

    def trajectory(
        self,
        progress: Callable[[float], None] | None = None,
        interruption: Interruption | None = None,
    ) -> Trajectory:
        """Integrate, and return the run with all samples; for the parameters see `run`."""
        from lagcli.trajectory.trajectory import complete, joined

        blocks: list[Samples] = []
        record = self.run(blocks.append, progress, interruption)
        return complete(joined(blocks), record)

    def run(
        self,
        sink: Callable[[Samples], None],
        progress: Callable[[float], None] | None = None,
        interruption: Interruption | None = None,
    ) -> Record:
        """Integrate, and emit the samples during the run.

        Parameters
        ----------
        sink : callable
            Takes the samples in blocks, in order: at least one, which may be empty if it is the
            only one. An exception that it raises ends the run and propagates to the caller.
        progress : callable, optional
            As for `simulate`.
        interruption : Interruption, optional
            Called several times per 0.1 s; returns whether to end the run.

        Returns
        -------
        Record
            Metadata as in `Trajectory`, including the run's status.
        """
        began = time.perf_counter()
        columns = DerivedColumns(self.system, self.start.state.p, self.monitor)
        trust = Trust(self.system, self.start.state.p)
        finite = FiniteColumns()
        elsewhere = 0.0  # time outside of the engine, s

        def take(block: Block, derivatives: Derivatives | None = None) -> None:
            nonlocal elsewhere
            entered = time.perf_counter()
            samples = columns(block)
            if derivatives is not None:
                samples = self._with(samples, derivatives)
            trust.add(samples)
            finite.add(samples)
            sink(samples)
            elsewhere += time.perf_counter() - entered

        def check_cancelled(t: float) -> None:
            if interruption is not None and interruption.requested():
                raise Interrupted
            if progress is not None:
                progress(t)

        def change_parameters(p: tuple[float, ...]) -> None:
            columns.p = trust.p = p

        request = self.request._replace(on_parameters=change_parameters)
        from lagcli.engine.integrate.engine import integrate  # before threads are limited

        with one_thread():
            if self.sensitivity is None:
                run = integrate(self.system, request, take, check_cancelled)
            else:
                run = self.sensitivity.integrate(request, take, check_cancelled)
        integrating = time.perf_counter() - began - elsewhere
        if not columns.samples:
            empty = None if self.sensitivity is None else self.sensitivity.no_derivatives
            layout = self.system.sample_layout
            take(Block.of_rows(np.empty((0, layout.size)), layout), empty)
        _complete(run, columns, trust)
        run.message = message_of(self.equations, run)
        unused = () if self.model.switches else _OF_CONTACTS
        options = {k: x for k, x in self.settings.as_dict().items() if k not in unused}
        if run.methods:
            options["method"] = ", ".join(run.methods)  # the methods that `auto` selected
        if run.choice:
            options["choice"] = run.choice
        reached = [] if run.tolerances is None else run.tolerances[:-1].tolist()
        tolerances = dict(zip(self.initial, reached, strict=bool(reached)))
        log: EventLog | None = None
        tables: dict[str, InputTable] = {}
        if self.system.switching is not None:
            from lagcli.simulations.event_logs import event_log

            names = () if self.sensitivity is None else self.sensitivity.names
            log = event_log(self.system, run, columns, names)
        if self.model.inputs:
            from lagcli.simulations.inputs import input_tables

            tables = input_tables(self.model)
        return Record(
            events=log,
            tolerances=tolerances,
            warnings=(
                *self.model.units.warnings,
                *warnings_at_start(self.system, self.start, lambda: self.freedom),
                *trust.warnings(self.settings, run.steps, columns),
                *finite.warnings(),
                *run.notes,
            ),
            scale_position=columns.scale_position,
            scale_velocity=columns.scale_velocity,
            units={**result_units(self.model), **self.monitor.units},
            status=run.status,
            message=run.message,
            model=self.model.text,
            parameters=self.model.declared_values,
            options=options,
            counts=run.counts,
            seconds={**self.seconds, "integrate": self.seconds["integrate"] + integrating},
            initial_correction=dict(self.start.moved),
            freedom=self.freedom.to_mapping(),
            conserved_formulas=dict(self.monitor.formulas),
            display=result_display(self.model),
            lagcli_version=__version__,
            inputs=tables,
        )

    def _with(self, samples: Samples, derivatives: Derivatives) -> Samples:
        assert self.sensitivity is not None
        return replace(
            samples,
            sensitivity=self.sensitivity.names,
            dq=derivatives.q,
            dv=derivatives.v,
            dmultipliers=derivatives.multipliers,
        )


def warnings_of(
    system: System,
    p: tuple[float, ...],
    settings: Settings,
    samples: Array,
    run: Outcome,
    changes: ParameterChanges = (),
) -> tuple[str, ...]:
    """Return the warnings of a completed run from its samples.

    Parameters
    ----------
    system : System
    p : tuple of float
        Values of its parameters.
    settings : Settings
        Complete ones.
    samples : (nt, width) array
        Sample rows, as in `SampleLayout`.
    run : Outcome
    changes : sequence of (int, tuple of float), optional
        Samples from which events set other parameter values.
    """
    layout, held = system.sample_layout, _block_rows(system)
    columns, trust, finite = DerivedColumns(system, p), Trust(system, p), FiniteColumns()
    for part, values in parts_of_constant_parameters(len(samples), p, changes):
        columns.p = trust.p = values
        for start in range(part.start, part.stop, held):
            rows = samples[start : min(start + held, part.stop)]
            block = columns(Block.of_rows(rows, layout))
            trust.add(block)
            finite.add(block)
    _complete(run, columns, trust)
    return (*trust.warnings(settings, run.steps, columns), *finite.warnings())


def _complete(run: Outcome, columns: DerivedColumns, trust: Trust) -> None:
    """Pass on what is known of a run only at its end."""
    columns.steps = run.steps
    if run.events:
        from lagcli.simulations.event_logs import states_of_jumps

        for states in states_of_jumps(run.events):
            columns.add_states(*states)
            trust.add_states(*states)


def _block_rows(system: System) -> int:
    """Return the largest number of samples of a block, limited by memory and time."""
    held = max(system.dynamics.registers, system.report.registers)
    in_time = max(_BLOCK_NUMBERS // numbers_per_sample(system), _LEAST_ROWS)
    return max(1, min(in_time, _BLOCK_REGISTERS // held))
