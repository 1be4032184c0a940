"""Derived columns of a run: forces, energies, powers, residuals, conserved quantities, outputs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import symengine as se

from lagcli.arrays import Array, Flags
from lagcli.columns import ColumnName
from lagcli.engine.constraints.initial import ConsistentState
from lagcli.engine.contract import Block
from lagcli.engine.evaluator import Entries
from lagcli.engine.integrate.many_states import Batch
from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.scales import compliance_of, least_scales_of_entries, usable
from lagcli.engine.sparse_rows import in_turns, rows_and_columns
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import run_arrays
from lagcli.engine.tape.tape import Tape
from lagcli.equations.derivation.column_expressions import REPORTED
from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.symmetry.linear import monitored_symmetries
from lagcli.model.model import TIME
from lagcli.trajectory.samples import Samples, Terms

#: Part of a change in a step: the least scale of what is held. It is far below any motion, which
#: changes by its size in a few steps, but its rounding errors are not.
_MOVED = 1e-6


class Monitor(NamedTuple):
    """Evaluates conserved quantities.

    Parameters
    ----------
    formulas : mapping of str to str
        The quantities in terms of momenta and Jacobi's integral, by name.
    tape : Tape, optional
        (t, q, v, parameters) → the quantities.
    units : mapping of str to str
        Units of their columns, if known.
    """

    formulas: Mapping[str, str] = MappingProxyType({})
    tape: Tape | None = None
    units: Mapping[str, str] = MappingProxyType({})

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the quantities."""
        return tuple(self.formulas)

    def __call__(self, block: Block, p: tuple[float, ...]) -> Array:
        """Return the values at the samples of a block, (nt, ni)."""
        count = len(block.time)
        if self.tape is None:
            return np.empty((count, 0))
        values = run_arrays(self.tape, [block.time, *block.q.T, *block.v.T, *p], count)
        return np.ascontiguousarray(values.T)


#: A monitor without quantities.
NO_MONITOR = Monitor()


def monitor_of(equations: Equations, system: System, start: ConsistentState) -> Monitor:
    """Return a monitor of the conserved quantities of a model other than its energy.

    The energy balance already shows the drift of the energy. Finding the quantities takes a few per
    cent of the time before the first step; in a large model only coordinates that do not occur are
    considered. Momenta that vanish on the constraints are left out, unless constraints switch.
    """
    eq = equations
    symmetries = monitored_symmetries(eq)
    if not symmetries:
        return NO_MONITOR
    from lagcli.equations.symmetry.conserved import named_quantities

    quantities = named_quantities(eq, symmetries)
    if quantities and not eq.model.switches:
        from lagcli.engine.constraints.random_states import random_walk
        from lagcli.simulations.momenta import distinct

        quantities = distinct(eq, system, start, partial(random_walk, system, start), quantities)
    if not quantities:
        return NO_MONITOR
    from lagcli.equations.symmetry.units import conserved_unit

    parameters = [se.Symbol(name) for name in eq.model.parameters]
    tape = compile_tape(
        [q.expression for q in quantities],
        [TIME, *eq.q, *eq.v],
        parameters,
        input_functions(eq.model),
    )
    units = {
        str(ColumnName("conserved", conserved=q.name)): unit
        for q in quantities
        if (unit := conserved_unit(eq.model, q)) is not None
    }
    return Monitor({q.name: q.in_momenta for q in quantities}, tape, units)


class DerivedColumns:
    """Computes the derived columns of the blocks of one run, in order.

    Each number is a function only of its sample (and of the first one, for the energy balance): it
    does not depend on the division into blocks, to the last bit. Therefore sums run over the
    nonzero entries of M and B in order.

    Parameters
    ----------
    system : System
    p : tuple of float
        Values of its parameters.
    monitor : Monitor, optional
        Evaluates the conserved quantities.

    Attributes
    ----------
    samples : int
        Number of completed samples.
    steps : int
        Number of steps of the run, once it is known.
    p : tuple of float
        Values of the parameters from the next sample on, which events may change.
    """

    def __init__(self, system: System, p: tuple[float, ...], monitor: Monitor = NO_MONITOR):
        self.system, self.p, self.monitor = system, p, monitor
        self.samples = self.steps = 0
        shape = (len(system.constraints), len(system.coordinates))
        order = sorted(system.jacobian_pattern)
        self._terms = Terms.of(order, shape)
        places = {pair: place for place, pair in enumerate(order)}
        self._places = [places[pair] for pair in system.jacobian_pattern]
        rows = () if system.switching is None else system.switching.rows
        self._limited = [row.row for row in rows if row.limit is not None]
        # the rows and columns of the entries of M and B, and the order in which they are summed
        self._of_mass = rows_and_columns(system.mass_pattern)
        self._of_jacobian = rows_and_columns(system.jacobian_pattern)
        self._mass_turns = in_turns(self._of_mass[0])
        self._jacobian_turns = in_turns(self._of_jacobian[0])
        self._force_turns = in_turns(self._of_jacobian[1])
        self._energy_before = 0.0  # of the system and of the work, at the first sample
        self._position_scale = np.zeros(len(system.holonomic))
        self._velocity_scale = np.zeros(len(system.constraints))
        self._reach = np.zeros(len(system.constraints))
        self._acceleration = np.zeros(len(system.constraints))  # that a force takes away
        self._times = (math.nan, math.nan)  # of the first and the last sample

    @property
    def scale_position(self) -> Array:
        """Largest scale of each constraint so far, (nc,); NaN for one without position level.

        At least a small part of what velocities and forces change in a step: of bodies at rest at
        q = 0, all terms are rounding errors of that.
        """
        scale, held = np.full(len(self.system.constraints), np.nan), list(self.system.holonomic)
        moved = self._step * (self._velocity_scale + self._step * self._acceleration)
        scale[held] = usable(np.fmax(self._position_scale, _MOVED * moved[held]))
        return scale

    @property
    def scale_velocity(self) -> Array:
        """Largest scale of each velocity constraint so far, (nc,).

        At least that of velocities which change the coordinates by their sizes in the time of the
        samples, and a small part of what forces change in a step: of bodies at rest all other terms
        are rounding errors.
        """
        scale = np.fmax(self._velocity_scale, _MOVED * self._step * self._acceleration)
        first, last = self._times
        if last > first:
            reach = self._reach.copy()
            held = list(self.system.holonomic)
            reach[held] = np.maximum(reach[held], self._position_scale)
            scale = np.fmax(scale, reach / (last - first))
        return usable(scale)

    @property
    def _step(self) -> float:
        """Return the mean step, s; 0 if it is not known."""
        first, last = self._times
        return (last - first) / self.steps if self.steps and last > first else 0.0

    def __call__(self, block: Block) -> Samples:
        """Return the next samples with all columns."""
        system, count = self.system, len(block.time)
        nq, nc = len(system.coordinates), len(system.constraints)
        batch = Batch(system, self.p, block.time, block.q, block.v)
        e = batch.entries()
        report = batch.report(block.a, block.multipliers)
        v, a, multipliers = (
            np.ascontiguousarray(x.T) for x in (block.v, block.a, block.multipliers)
        )

        row, column = self._of_jacobian
        force = e.jacobian * multipliers[row]
        by = np.empty((count, len(row)))
        by[:, self._places] = force.T
        forces, velocity = np.zeros((nq, count)), np.zeros((nc, count))
        for turn in self._jacobian_turns:
            velocity[row[turn]] += e.jacobian[turn] * v[column[turn]]
        for turn in self._force_turns:
            forces[column[turn]] += force[turn]
        power = np.zeros(count)
        for i in range(nc):
            power += multipliers[i] * velocity[i]
        friction = np.zeros(count)
        for i in self._limited:
            friction += multipliers[i] * (velocity[i] + e.drift[i])
        equation = np.zeros((nq, count))
        row, column = self._of_mass
        for turn in self._mass_turns:
            equation[row[turn]] += e.mass_matrix[turn] * a[column[turn]]
        position = np.full((nc, count), np.nan)
        position[list(system.holonomic)] = e.position
        velocity_residual = velocity + e.drift
        if system.switching is not None and system.switching.rows:
            free = ~held_rows(system, self.p, block).T
            np.copyto(position, np.nan, where=free)
            np.copyto(velocity_residual, np.nan, where=free)
        if system.switching is not None and system.switching.forces is not None:
            forces += reactive_forces(system, self.p, block)

        residual = np.abs(equation - e.forcing - forces).max(axis=0, initial=0.0)
        if system.has_kinks:
            from lagcli.simulations.surfaces import SurfaceValues, with_surfaces

            values = SurfaceValues(residual, report)
            residual, report = with_surfaces(system, self.p, block, equation - forces, values)
        reported = dict(zip(REPORTED, report, strict=False))
        total, outputs = reported["energy_total"], report[len(REPORTED) :]

        if count and not self.samples:
            self._energy_before = total[0] - block.work[0]
            self._times = (float(block.time[0]), self._times[1])
        if count:
            self._times = (self._times[0], float(block.time[-1]))
        self.samples += count
        compliance = self._enlarge(e, block.q, block.v)
        row, column = self._of_jacobian
        taken = np.zeros((nc, count))  # accelerations that forces of constraints take away
        for turn in self._jacobian_turns:
            taken[row[turn]] += np.abs(force[turn] * e.jacobian[turn]) * compliance[column[turn]]
        self._acceleration = _larger(self._acceleration, taken)
        return Samples(
            coordinates=system.coordinates,
            constraints=system.constraints,
            terms=self._terms,
            time=block.time,
            q=block.q,
            v=block.v,
            a=block.a,
            multipliers=block.multipliers,
            constraint_force_by=by,
            power_constraint=power - friction,
            power_friction=friction,
            energy_balance=total - self._energy_before - block.work,
            residual_position=np.ascontiguousarray(position.T),
            residual_velocity=np.ascontiguousarray(velocity_residual.T),
            residual_equation=residual,
            conserved_names=self.monitor.names,
            conserved=self.monitor(block, self.p),
            outputs=dict(zip(system.outputs, outputs, strict=True)),
            **reported,
        )

    def add_states(self, t: Array, q: Array, v: Array) -> None:
        """Take states into the scales that are no samples, as those before impacts."""
        self._enlarge(Batch(self.system, self.p, t, q, v).entries(), q, v)

    def _enlarge(self, e: Entries, q: Array, v: Array) -> Array:
        """Enlarge the scales to those of states, (n, nq); return 1/M_jj, or 0, (nq, n)."""
        system = self.system
        row, column = self._of_mass
        on_diagonal = row == column
        mass_diagonal = np.zeros((len(system.coordinates), len(q)))
        mass_diagonal[row[on_diagonal]] = e.mass_matrix[on_diagonal]
        inertia = np.ascontiguousarray(system.inertia(mass_diagonal.T).T)
        pattern, nc = system.jacobian_pattern, len(system.constraints)
        scales = [
            least_scales_of_entries(inertia, pattern, e.jacobian, nc, np.ascontiguousarray(x.T))
            for x in (q, v)
        ]
        held = scales[0][list(system.holonomic)]
        self._position_scale = _larger(self._position_scale, np.maximum(e.position_scale, held))
        self._velocity_scale = _larger(
            self._velocity_scale, np.maximum(e.velocity_scale, scales[1])
        )
        self._reach = _larger(self._reach, scales[0])
        return compliance_of(inertia)


def _larger(scale: Array, scales: Array) -> Array:
    """Return the updated largest scale of each constraint."""
    return np.maximum(scale, scales.max(axis=1, initial=0.0))


#: Relative difference of a force from the kinetic limit below which the row slips.
_AT_LIMIT = 1e-9


def held_rows(system: System, p: tuple[float, ...], block: Block) -> Flags:
    """Return which constraints are active at each sample, (nt, nc).

    A row without force is open, and one with its kinetic limit slips: both have no residual. An
    active row without force counts as open.

    Parameters
    ----------
    system : System
    p : tuple of float
        Values of its parameters.
    block : Block
    """
    held = np.ones(block.multipliers.shape, dtype=bool)
    if system.switching is None:
        return held
    rows, size = system.switching.rows, np.abs(block.multipliers)
    for row in rows:
        held[:, row.row] = size[:, row.row] != 0
    limited = [row for row in rows if row.limit is not None]
    if limited:
        limits = run_arrays(system.switching.limits, _inputs(block, p), len(block.time))
        for row in limited:
            assert row.limit is not None
            kinetic = limits[len(limited) + row.limit]
            away = np.abs(size[:, row.row] - kinetic) > _AT_LIMIT * np.abs(kinetic)
            held[:, row.row] &= away
    return held


def reactive_forces(system: System, p: tuple[float, ...], block: Block) -> Array:
    """Return the generalized forces that depend on λ, (nq, nt)."""
    forces = np.zeros((len(system.coordinates), len(block.time)))
    if system.switching is not None and system.switching.forces is not None:
        tape, places = system.switching.forces, system.switching.force_coordinates
        forces[list(places)] = run_arrays(tape, _inputs(block, p), len(block.time))[: len(places)]
    return forces


def _inputs(block: Block, p: tuple[float, ...]) -> list[Array | float]:
    return [block.time, *block.q.T, *block.v.T, *block.a.T, *block.multipliers.T, *p]
