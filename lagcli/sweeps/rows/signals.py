"""What measures and kept trajectories are made of: expressions along the samples of many runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
import symengine as se
from numpy.typing import NDArray
from symengine import Basic

from lagcli.engine.tape.compiler import compile_tape
from lagcli.engine.tape.interpreter import run_arrays
from lagcli.engine.tape.tape import Tape
from lagcli.equations.derivation.lagrange import Equations, with_forces
from lagcli.errors import UsageError
from lagcli.model.expression.functions import FUNCTIONS
from lagcli.model.model import TIME, multiplier

Array = NDArray[np.float64]

_WORK = se.Symbol("#work")
_BEFORE = se.Symbol("#before")  # energy less work at the first sample
#: Samples that are evaluated at once: their registers stay in the cache.
_TOGETHER = 1 << 12


class Signals:
    """Expressions in t, q, v, a, λ and the columns of result files, over many runs at once.

    Parameters
    ----------
    equations : Equations
    expressions : sequence of expressions
        As in `lagcli.model.sections.measures`.
    compiled : bool
        Whether the compiled core evaluates them.

    Raises
    ------
    UsageError
        The residual of a position constraint is asked for, and it has none.
    """

    def __init__(self, equations: Equations, expressions: Sequence[Basic], compiled: bool):
        eq = equations
        numbered = {str(i): x for i, x in enumerate(expressions)}
        written = with_forces(eq.model, eq.constraints, numbered)
        columns = _Columns(eq)
        found = [
            x.xreplace({s: columns.of(s.name) for s in x.free_symbols if columns.knows(s.name)})
            for x in written.values()
        ]
        parameters = [se.Symbol(name) for name in eq.model.parameters]
        lambdas = [multiplier(c.constraint.name) for c in eq.constraints]
        state = [TIME, *eq.q, *eq.v, *eq.a, *lambdas, _WORK]
        tape = compile_tape(found, state, [*parameters, _BEFORE])
        self._evaluate: Callable[[Array, Array], Array] = partial(_run_blocks, tape)
        if compiled:
            from lagcli.engine.integrate.batch import SampleTape

            self._evaluate = SampleTape(tape)
        self._balance = any(_BEFORE in x.free_symbols for x in found)
        self._energy = compile_tape([eq.energy - _WORK], state, parameters)

    def __call__(self, samples: Array, parameters: Array) -> Array:
        """Return the signals, (runs, signals, nt).

        Parameters
        ----------
        samples : (runs, nt, width) array
            By sample t, q, v, a, λ, W.
        parameters : (runs, np) array
        """
        runs, count = samples.shape[:2]
        before = np.zeros(runs)
        if self._balance and count:
            first = [*samples[:, 0].T, *parameters.T]
            before = run_arrays(self._energy, first, runs)[0]
        return self._evaluate(samples, np.column_stack([parameters, before]))


def _run_blocks(tape: Tape, samples: Array, constants: Array) -> Array:
    """Run a tape over samples, as `lagcli.engine.integrate.batch.SampleTape` does."""
    runs, count = samples.shape[:2]
    found = np.empty((runs, len(tape.outputs), count))
    step = max(1, _TOGETHER // max(1, count))
    for start in range(0, runs, step):
        part = slice(start, start + step)
        mine = samples[part]
        inputs = np.ascontiguousarray(mine.reshape(-1, mine.shape[2]).T)
        steady = np.repeat(constants[part], count, axis=0).T
        out = run_arrays(tape, [*inputs, *steady], len(mine) * count)
        found[part] = out.reshape(-1, len(mine), count).swapaxes(0, 1)
    return found


class _Columns:
    """The columns of result files as expressions, built when asked for."""

    def __init__(self, equations: Equations):
        self.equations = equations
        self.places = {c.constraint.name: c for c in equations.constraints}

    def knows(self, name: str) -> bool:
        """Return whether a symbol is the name of a column."""
        if name in self.equations.model.parameters:
            return False
        return name.startswith(("energy_", "power_", "residual_")) and (
            "." in name or hasattr(self, name)
        )

    def of(self, name: str) -> Basic:
        """Return the expression of a column."""
        head, _, constraint = name.partition(".")
        if not constraint:
            found: Basic = getattr(self, name)()
            return found
        row = self.places[constraint]
        if head == "residual_velocity":
            return row.velocity
        if row.position is None:
            raise UsageError(
                f"`{name}`: the constraint `{constraint}` is nonholonomic and has no position;"
                f" take residual_velocity.{constraint}"
            )
        return row.position

    def energy_kinetic(self) -> Basic:
        return self.equations.kinetic

    def energy_potential(self) -> Basic:
        return self.equations.potential

    def energy_total(self) -> Basic:
        return self.equations.energy

    def energy_balance(self) -> Basic:
        return self.equations.energy - _WORK - _BEFORE

    def power_applied(self) -> Basic:
        eq = self.equations
        return se.Add(*[q * v for q, v in zip(eq.applied_forces, eq.v, strict=True)])

    def power_constraint(self) -> Basic:
        eq = self.equations
        return se.Add(
            *[
                multiplier(c.constraint.name) * b * eq.v[j]
                for c in eq.constraints
                for j, b in c.row.items()
            ]
        )

    def power_time(self) -> Basic:
        return self.equations.time_power

    def residual_position(self) -> Basic:
        return _largest([c.position for c in self.equations.constraints if c.position is not None])

    def residual_velocity(self) -> Basic:
        return _largest([c.velocity for c in self.equations.constraints])

    def residual_equation(self) -> Basic:
        eq = self.equations
        rows = [
            [m * eq.a[j] for j, m in row.items()] + [-f]
            for row, f in zip(eq.mass_matrix, eq.forcing, strict=True)
        ]
        for c in eq.constraints:
            for j, b in c.row.items():
                rows[j].append(-multiplier(c.constraint.name) * b)
        return _largest([se.Add(*row) for row in rows])


def _largest(values: Sequence[Basic]) -> Basic:
    """Return the largest magnitude."""
    if not values:
        return se.Integer(0)
    return FUNCTIONS["max"].apply(*[FUNCTIONS["abs"].apply(x) for x in values])


def kept_signals(equations: Equations) -> Mapping[str, Basic]:
    """Return what a kept trajectory has beside its state, by column."""
    forces = {f"Qc.{q}": se.Symbol(f"Qc.{q}") for q in equations.model.coordinate_names}
    names = ("energy_kinetic", "energy_potential", "energy_total", "energy_balance")
    energies = {name: se.Symbol(name) for name in names}
    return {**forces, **energies, **{f"outputs.{n}": x for n, x in equations.model.outputs.items()}}
