"""What code of a model contains: its tapes, names, units, values and state, in no language yet."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.constraints.initial import ConsistentState
from lagcli.engine.constraints.rates import with_rates
from lagcli.engine.contract import Stop
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.layout import RatesLayout
from lagcli.engine.linear.dense import row_scale
from lagcli.engine.lowering.lower import lower
from lagcli.engine.system import Pattern, State, System
from lagcli.engine.tape.inputs import PiecewiseFunction
from lagcli.engine.tape.tape import Arithmetic, Tape
from lagcli.equations.derivation.column_expressions import REPORTED
from lagcli.equations.derivation.lagrange import derive
from lagcli.errors import NumericalError, UsageError
from lagcli.export.elimination import EliminatedTape, eliminated_tape, order_of
from lagcli.model.model import Model
from lagcli.model.values import dependent_values, independent_parameters
from lagcli.settings.settings import Settings, SettingsOverrides, resolve
from lagcli.simulations.contacts import refuse_switching
from lagcli.simulations.simulation import Simulation, ready
from lagcli.trajectory.samples import Record, Samples
from lagcli.version import __version__

#: Largest number of accelerations and multipliers: code solves for them densely.
MOST_UNKNOWNS = 400
#: Part of a row of B, over its length, that must be independent of the rows before it.
_INDEPENDENT = 1e-6
#: Number of states of the run that an order of elimination should suit.
_STATES = 16

#: What every file says of its use.
LICENCE = "This file may be used, changed and passed on without any condition."
SIGN = (
    "Bᵀλ is the constraint forces on the right side. b is the gradient of phi of a holonomic"
    " constraint, or of psi with respect to the velocities; of an equation lhs = rhs, phi or psi"
    " is lhs - rhs."
)


class SlopeTape(NamedTuple):
    """G = f − M a + Bᵀλ above Γ = γ − B a, differentiated by t, q, v and p at fixed a and λ.

    Parameters
    ----------
    pattern : tuple of (row, column)
        Places of the nonzero entries in a matrix of nq + nc rows and 1 + 2 nq + np columns.
    tape : Tape
        (t, q, v, a, λ, p) → the entries.
    """

    pattern: Pattern
    tape: Tape


@dataclass(frozen=True, eq=False)
class Content:
    """The parts of a model that code contains.

    Parameters
    ----------
    simulation : Simulation
        The prepared run of the model with its own settings.
    """

    simulation: Simulation

    @property
    def model(self) -> Model:
        """The model."""
        return self.simulation.model

    @property
    def system(self) -> System:
        """The System of the model."""
        return self.simulation.system

    @property
    def start(self) -> ConsistentState:
        """The initial state."""
        return self.simulation.start

    @property
    def settings(self) -> Settings:
        """The settings of the model."""
        return self.simulation.settings

    @cached_property
    def tolerances(self) -> Array:
        """Absolute tolerances of q and v, (2 nq,), of a run, which follow the sizes of the motion.

        The model is simulated.
        """
        record, _ = self._run
        initial = self.simulation.initial
        known = record.tolerances or dict.fromkeys(initial, self.settings.rtol)
        return np.array([known[name] for name in initial])

    @cached_property
    def _run(self) -> tuple[Record, list[State]]:
        """The record of the model's run, and a few of its states, the initial one first."""
        start, found = self.start.state, list[State]()

        def take(samples: Samples) -> None:
            rows = zip(samples.time, samples.q, samples.v, strict=True)
            found.extend(State(float(t), q, v, start.p) for t, q, v in rows)

        record = self.simulation.run(take)
        return record, [start, *found[:: max(1, len(found) // _STATES)]]

    @cached_property
    def solved(self) -> EliminatedTape | None:
        """a and λ by an unrolled elimination.

        None where no order suits, or its operations are too many. λ of redundant constraints is 0.
        """
        evaluator = Evaluator(self.system, self.start.state.p)
        order = order_of(evaluator, self._run[1], self.start.elimination, self.rows)
        return None if order is None else eliminated_tape(self.system, order)

    @cached_property
    def dynamics(self) -> Tape:
        """(t, q, v, p) → (M entries, f, B entries, γ)."""
        tape = self.system.dynamics
        return tape.selected(range(len(tape.outputs) - 1))

    @cached_property
    def constraints(self) -> Tape:
        """(t, q, v, p) → (φ, ψ)."""
        layout = RatesLayout(self.system.counts)
        tape = with_rates(self.system)
        places = range(len(tape.outputs))
        return tape.selected([*places[layout.position], *places[layout.velocity]])

    @cached_property
    def terms(self) -> Tape:
        """(t, q, v, p) → sums of the magnitudes of the terms of φ and of ψ."""
        layout, tape = self.system.constraint_layout, self.system.constraint
        places = range(len(tape.outputs))
        return tape.selected([*places[layout.position_scale], *places[layout.velocity_scale]])

    @cached_property
    def report(self) -> Tape:
        """(t, q, v, a, λ, p) → the columns of `columns`."""
        return self.system.report

    @cached_property
    def slopes(self) -> SlopeTape:
        """The derivatives of the equations."""
        system, nq = self.system, len(self.system.coordinates)
        assert system.variation is not None
        assert system.parameter_variation is not None
        by_state, by_p = system.variation(), system.parameter_variation(system.parameters)
        blocks = (
            (by_state.force_position, 0, 1),
            (by_state.force_velocity, 0, 1 + nq),
            (by_state.rhs_position, nq, 1),
            (by_state.rhs_velocity, nq, 1 + nq),
        )
        places = [(i + down, j + across) for own, down, across in blocks for i, j in own]
        powers = len(by_state.power_position) + len(by_state.power_velocity)
        outputs = [*range(len(places))]
        outputs += [len(places) + powers + i for i in range(system.counts.unknowns)]
        places += [(i, 0) for i in range(system.counts.unknowns)]
        first = 1 + 2 * nq
        of_p = [(i, j + first) for i, j in by_p.force] + [(i + nq, j + first) for i, j in by_p.rhs]
        tape = by_state.tape
        builder = Arithmetic(tape.inputs, tape.parameters, functions=tape.functions)
        entries = builder.splice(tape, range(tape.inputs), outputs)
        entries += builder.splice(by_p.tape, range(tape.inputs), range(len(of_p)))
        found = [
            (place, x) for place, x in zip(places + of_p, entries, strict=True) if x != builder.zero
        ]
        return SlopeTape(tuple(x for x, _ in found), builder.finish([x for _, x in found]))

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of the energies, the powers and the outputs of the model."""
        return *REPORTED, *self.system.outputs

    @property
    def functions(self) -> tuple[PiecewiseFunction, ...]:
        """The tables."""
        return self.system.functions.functions

    @cached_property
    def rows(self) -> tuple[int, ...]:
        """Constraints whose rows of B are independent and span all."""
        kept = independent_constraints(self.simulation)
        if kept is None:
            raise UsageError(
                f"{self.model.name} cannot be written as code: which of its redundant constraints"
                " are independent is not clear at the initial state"
            )
        return kept

    @property
    def position_rows(self) -> tuple[int, ...]:
        """The holonomic ones of `rows`."""
        return tuple(i for i in self.rows if i in self.system.holonomic)

    @property
    def position_places(self) -> tuple[int, ...]:
        """The places of `position_rows` in φ."""
        return tuple(self.system.holonomic.index(i) for i in self.position_rows)

    @property
    def units(self) -> tuple[int, ...]:
        """Of each coordinate, the first that is known to have its unit."""
        first = {j: group[0] for group in self.system.same_unit for j in group}
        return tuple(first.get(j, j) for j in range(len(self.system.coordinates)))

    @property
    def redundant(self) -> tuple[str, ...]:
        """The constraints that follow from the others."""
        return tuple(x for i, x in enumerate(self.system.constraints) if i not in self.rows)

    def described(self, entry: str = "{0}[{1}]", first: int = 0) -> list[str]:
        """Return the lines that introduce the code.

        Parameters
        ----------
        entry : str
            Format of an entry of an array; empty if quantities have variables of their own.
        first : int
            Index of the first entry of an array.
        """
        model = self.model
        lines = [
            f"{line_of(model.title)}: Lagrange's equations of the first kind.",
            "",
            f"Written by lagcli {__version__} from the model {model.name}, SHA-256",
            f"{model.sha256}.",
            LICENCE,
            "",
            "  M a = f + Bᵀλ,   B a = gamma,   phi = 0,   psi = B v + b_0 = 0",
            "",
            *wrapped(SIGN),
        ]
        if self.redundant:
            text = (
                f"The constraints are redundant: {', '.join(self.redundant)} follow from the"
                " others. lambda is the solution of least norm."
            )
            lines += ["", *wrapped(text)]
        if computed := _computed(model):
            text = (
                "The model computes these parameters from others; here they keep their values when"
                f" the others change: {', '.join(computed)}."
            )
            lines += ["", *wrapped(text)]
        if not entry:
            return lines
        return [*lines, "", "Quantities, in SI units:", "", *self._table(entry, first)]

    def _table(self, entry: str, first: int) -> list[str]:
        """Return the names, units and descriptions of all quantities, by array."""
        units, model = self.model.units, self.model
        rows = [("q", c.name, units.of(c.name), c.description) for c in model.coordinates]
        rows += [("p", p.name, units.of(p.name), p.description) for p in model.parameters.values()]
        rows += [
            ("lambda", c.name, units.of_multiplier(c.name), c.description)
            for c in model.constraints
        ]
        rows += [("out", name, units.of_output(name), None) for name in self.system.outputs]
        counts: dict[str, int] = {"out": len(REPORTED)}
        lines = []
        width = max([len(name) for _, name, _, _ in rows], default=0)
        for array, name, unit, text in rows:
            place = counts.setdefault(array, 0)
            counts[array] += 1
            what = f"  {line_of(text)}" if text else ""
            own = entry.format(array, place + first)
            lines.append(f"  {own:<11} {name:<{width}}  [{unit or '?'}]{what}")
        return [line.rstrip() for line in lines]


def content_of(model: Model) -> Content:
    """Derive what code of a model contains.

    Raises
    ------
    UsageError
        The model switches, or it has too many unknowns.
    ModelError, NumericalError
        There is no consistent initial state.
    """
    equations = derive(model)
    refuse_switching(equations, "code and functions of the dynamics")
    system = lower(equations)
    unknowns = system.counts.unknowns
    if unknowns > MOST_UNKNOWNS:
        raise UsageError(
            f"{model.name} has {unknowns} accelerations and multipliers; code solves for them"
            f" densely, and is written for at most {MOST_UNKNOWNS}"
        )
    settings = resolve(SettingsOverrides(), model.settings)
    return Content(ready(equations, system, settings, {}))


def independent_constraints(simulation: Simulation) -> tuple[int, ...] | None:
    """Return constraints whose rows of B are independent and span all, holonomic ones first.

    None if that is not clear at the initial state.

    Raises
    ------
    NumericalError
        The initial state is a singular configuration: more rows are independent elsewhere.
    """
    system, start = simulation.system, simulation.start
    if start.rank == len(system.constraints):
        return tuple(range(start.rank))
    _check_start(simulation)
    state, holonomic = start.state, list(system.holonomic)
    d = Evaluator(system, state.p).dynamics(state.t, state.q, state.v)
    others = [i for i in range(len(d.rhs)) if i not in holonomic]
    kept = independent_rows(d.jacobian, [*holonomic, *others])
    return kept if len(kept) == start.rank else None


def _check_start(simulation: Simulation) -> None:
    """Raise NumericalError if the initial state is a singular configuration."""
    from lagcli.engine.constraints.index1 import Index1
    from lagcli.engine.constraints.projection import Projection
    from lagcli.engine.constraints.singular import RankWatch

    state, rank = simulation.start.state, simulation.start.rank
    motion = Index1(Evaluator(simulation.system, state.p), rank)
    motion.measure(state.t, state.q, state.v)
    try:
        watch = RankWatch(motion)
        watch.check_start(state.t, state.q, state.v, Projection(motion.evaluator, rank))
    except Stop as stop:
        raise NumericalError(str(stop)) from None


def independent_rows(jacobian: Array, order: Sequence[int]) -> tuple[int, ...]:
    """Return rows of a matrix that are independent of those before them, by Gram and Schmidt."""
    scaled = jacobian / row_scale(jacobian)[:, None]
    basis: list[Array] = []
    kept = []
    for i in order:
        rest = scaled[i].copy()
        for _ in range(2):
            for direction in basis:
                rest -= (direction @ rest) * direction
        size = float(np.linalg.norm(rest))
        if size > _INDEPENDENT:
            basis.append(rest / size)
            kept.append(i)
    return tuple(sorted(kept))


def _computed(model: Model) -> list[str]:
    """Return the parameters that the model computes from others which can be changed."""
    varied = independent_parameters(model)
    found = dependent_values(model, varied)
    return [name for name in model.parameters if name in found and name not in varied]


def line_of(text: str) -> str:
    """Return a text in one line: a comment of most languages ends with its line."""
    return " ".join(text.split())


def wrapped(text: str) -> list[str]:
    """Return a text in lines."""
    return textwrap.wrap(text, 92, break_long_words=False, break_on_hyphens=False)
