"""What the core needs to simulate a model elsewhere: the model as data, and values beside it.

`core/fmi/instance.h` states what both contain. FMUs have them as files, pages in their text.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lagcli.engine.constraints.rates import with_rates
from lagcli.engine.contract import Stop
from lagcli.engine.core.program import Program, assemble
from lagcli.engine.core.run import METHODS as CORE_METHODS
from lagcli.engine.integrate.model_data import integers_data, model_data, program_data, word_data
from lagcli.engine.integrate.switching_run import SwitchingIntegration
from lagcli.engine.layout import RatesLayout
from lagcli.engine.sensitivity.switched_run import METHOD, arranged, directional_programs
from lagcli.engine.switching.kinks import frozen_of
from lagcli.engine.system import System
from lagcli.engine.tape.differentiation import directional
from lagcli.engine.tape.tape import Arithmetic, Tape
from lagcli.errors import NumericalError, UsageError
from lagcli.model.model import WEIGHT, Model
from lagcli.model.values import dependent_values, independent_parameters
from lagcli.simulations.directions import start_tape
from lagcli.simulations.simulation import Simulation
from lagcli.simulations.start import spins_of

_DERIVATIVES = int.from_bytes(b"llderiv2", "little")
_MAGIC = int.from_bytes(b"llvalue2", "little")


class Resources(NamedTuple):
    """A model for the core.

    Parameters
    ----------
    model : bytes
        The model as data.
    values : bytes
        Its method, what can be set, and the derived values.
    """

    model: bytes
    values: bytes


def settable_parameters(model: Model) -> list[str]:
    """Return the parameters that can be set: the ticks of clocks are numbers in the data."""
    names = independent_parameters(model)
    dependent = dependent_values(model, names)
    clocks = [event.clock for event in model.events if event.clock is not None]
    timed = {x.name for clock in clocks for x in (clock.period + clock.offset).free_symbols}
    timed |= {x.name for name in timed & dependent.keys() for x in dependent[name].free_symbols}
    return [name for name in names if name not in timed]


def _check_engagements(model: Model) -> None:
    """Refuse events that may let the velocity of a coordinate without inertia jump."""
    for event in model.events:
        for name in event.action.engage:
            if name + WEIGHT in model.parameters:
                raise UsageError(
                    f"the event `{event.name}` engages `{name}` on a coordinate without inertia,"
                    " whose velocity may jump; only simulate and sweep support this: give the"
                    " coordinate a mass"
                )


def method_of(simulation: Simulation) -> str:
    """Return the method of the model's settings; of `auto`, the last one that a run takes.

    Raises
    ------
    NumericalError
        The run takes no step.
    """
    chosen = simulation.settings.method
    if chosen != "auto":
        return chosen
    record = simulation.run(lambda samples: None)
    method = str(record.options["method"]).split(", ")[-1]
    if method == "auto":
        raise NumericalError(record.message)
    return method


def resources(
    simulation: Simulation, method: str, derived: Tape, inputs: Sequence[str] = ()
) -> Resources:
    """Return what the core needs.

    Parameters
    ----------
    simulation : Simulation
    method : str
        The method of all runs.
    derived : Tape
        (t, q, v, a, λ, p) → the derived values; see `DerivedTape`.
    inputs : sequence of str
        Parameters that may change during a run.

    Raises
    ------
    NumericalError
        The start is singular.
    """
    model, system = simulation.model, simulation.system
    _check_engagements(model)
    settable = settable_parameters(model)
    places = {name: i for i, name in enumerate(system.parameters)}
    fixed = [
        int(x.fixed)
        for table in (model.initial_positions, model.initial_velocities)
        for x in (table[name] for name in model.coordinate_names)
    ]
    parts = [
        word_data(CORE_METHODS.index(method)),
        word_data(len(model.parameters)),
        integers_data([places[name] for name in settable]),
        integers_data([places[name] for name in inputs]),
        integers_data(fixed),
        integers_data([x for spin in spins_of(model) for x in (*spin.places, *spin.fixed)]),
        *_constraints_at_start(system),
        program_data(assemble(start_tape(model, settable))),
        program_data(assemble(derived)),
    ]
    body = b"".join(parts)
    values = word_data(_MAGIC) + word_data(2 + len(body) // 8) + body
    try:
        return Resources(model_data(system, simulation.request, [method]), values)
    except Stop as stop:
        raise NumericalError(str(stop)) from None


def _constraints_at_start(system: System) -> list[bytes]:
    """Return the constraints that the start satisfies, where those of the core's equations differ.

    These are without rows that switch, and with branches fixed.
    """
    if not system.has_kinks and (system.switching is None or not system.switching.rows):
        return [word_data(0)]
    held = system.held_at_start
    number = {row: i for i, row in enumerate(held)}
    holonomic = [k for k, row in enumerate(system.holonomic) if row in number]
    entries = [k for k, (row, _) in enumerate(system.jacobian_pattern) if row in number]
    pattern = [system.jacobian_pattern[k] for k in entries]
    tape = with_rates(system)
    places = RatesLayout(system.counts).split(range(len(tape.outputs)))
    chosen = {"position": holonomic, "position_scale": holonomic, "jacobian": entries}
    outputs = [part[k] for name, part in places.items() for k in chosen.get(name, held)]
    return [
        *map(word_data, (1, len(held), len(holonomic), len(entries), system.held)),
        integers_data([number[system.holonomic[k]] for k in holonomic]),
        integers_data([number[row] for row, _ in pattern]),
        integers_data([column for _, column in pattern]),
        program_data(assemble(tape.selected(outputs))),
    ]


def derivatives(simulation: Simulation, derived: Tape, rows: Sequence[int] | None) -> bytes | None:
    """Return what the core needs for directional derivatives; None if there are none.

    Parameters
    ----------
    simulation : Simulation
    derived : Tape
        (t, q, v, a, λ, p) → the derived values, as for `resources`.
    rows : sequence of int, optional
        Constraints whose rows of B are independent and span all, of a model that does not switch.
    """
    model, system = simulation.model, simulation.system
    settable = settable_parameters(model)
    forces = 1 + 3 * len(system.coordinates) + len(system.constraints)
    switches = system.switching is not None or system.has_kinks
    directions = _directions_of_modes(simulation) if switches else None
    if directions is None:
        if rows is None or switches:
            return None
        directions = _directions(system, rows)
    start = start_tape(model, settable).selected(range(len(model.parameters)))
    body = b"".join(
        [
            word_data(directions.parameters),
            integers_data(directions.rows),
            program_data(assemble(directional(start)._replace(parameters=0))),
            *map(program_data, directions.programs),
            program_data(assemble(arranged(directional(derived), forces))),
        ]
    )
    return word_data(_DERIVATIVES) + word_data(2 + len(body) // 8) + body


class _Directions(NamedTuple):
    """The changes of the equations along a direction.

    Parameters
    ----------
    parameters : int
        Number of parameters that change, the first ones of the core's.
    rows : sequence of int
        Independent constraints of the core's equations.
    programs : list of Program
        M, f, B and γ; where a model switches, what follows in `core/fmi/instance.h`.
    """

    parameters: int
    rows: Sequence[int]
    programs: list[Program]


def _directions(system: System, rows: Sequence[int]) -> _Directions:
    layout = system.dynamics_layout
    parts = (layout.mass_matrix, layout.forcing, layout.jacobian, layout.rhs)
    equations = system.dynamics.selected(i for x in parts for i in range(x.start, x.stop))
    along = assemble(arranged(directional(equations), 1 + 2 * len(system.coordinates)))
    return _Directions(system.dynamics.parameters - system.functions.size, rows, [along])


def _directions_of_modes(simulation: Simulation) -> _Directions | None:
    """Return the changes in the modes of a model that switches; None with redundant constraints."""
    request = simulation.request
    request = request._replace(settings=request.settings.replace(method=METHOD))
    run = SwitchingIntegration(simulation.system, request, lambda block: None, None)
    split, frozen = run.split_system, run.frozen
    count = len(split.fixed.constraints)
    if run.request.rank < count:
        return None
    parameters = split.system.dynamics.parameters - split.system.functions.size
    along = directional_programs(split, frozen, np.zeros((0, parameters)))
    limited = any(row.limit is not None for row in split.switching.rows)
    programs = [
        (along.functions, bool(split.rows)),
        (along.limits, limited),
        (along.forces, bool(split.switching.force_coordinates)),
        (along.kink_rates, frozen is not None),
    ]
    needed = [program for program, exists in programs if exists]
    return _Directions(parameters, range(count), [along.dynamics, *needed])


class DerivedTape:
    """Builds the tape of derived values: (t, q, v, a, λ, p) → constraint forces, energies and more.

    Branches of forces that jump are parameters of the core.

    Parameters
    ----------
    system : System

    Attributes
    ----------
    builder : Arithmetic
        Operations are added to it.
    """

    def __init__(self, system: System):
        frozen = frozen_of(system)
        self.system = system if frozen is None else frozen.system
        report = self.system.report
        self.builder = Arithmetic(report.inputs, report.parameters, functions=report.functions)

    @property
    def unknowns(self) -> int:
        """The number of inputs before the parameters."""
        return 1 + 3 * len(self.system.coordinates) + len(self.system.constraints)

    @cached_property
    def force_terms(self) -> dict[tuple[int, int], int]:
        """The registers of λ_β b_βi, by constraint and coordinate."""
        system, builder, nq = self.system, self.builder, len(self.system.coordinates)
        inputs = [*range(1 + 2 * nq), *range(self.unknowns, builder.inputs)]
        places = range(len(system.dynamics.outputs))[system.dynamics_layout.jacobian]
        entries = builder.splice(system.dynamics, inputs, places)
        return {
            (i, j): builder.times(entry, 1 + 3 * nq + i)
            for (i, j), entry in zip(system.jacobian_pattern, entries, strict=True)
        }

    @cached_property
    def forces(self) -> list[int]:
        """The registers of the generalized constraint forces."""
        system, builder = self.system, self.builder
        forces = [builder.zero] * len(system.coordinates)
        for (_, j), term in self.force_terms.items():
            forces[j] = builder.plus(forces[j], term)
        switching = system.switching
        if switching is not None and switching.forces is not None:
            own = switching.force_coordinates
            reactive = builder.splice(switching.forces, range(builder.inputs), range(len(own)))
            for j, force in zip(own, reactive, strict=True):
                forces[j] = builder.plus(forces[j], force)
        return forces

    @cached_property
    def reported(self) -> list[int]:
        """The registers of the columns `REPORTED`, and of the outputs."""
        return self.builder.splice(self.system.report, range(self.builder.inputs))
