"""Matrices of a System as NumPy arrays, at many states."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.evaluator import Dynamics, Entries, matrices_of
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import ArrayTape
from lagcli.engine.tape.tape import Tape

#: Number of operations from which a tape is evaluated at many states by the core.
_LONG = 1500


class Batch:
    """Evaluates a System at many states at once; states lie along the last axis.

    Parameters
    ----------
    system : System
    p : tuple of float
        Values of its parameters.
    t : (n,) array
    q, v : (n, nq) arrays
    """

    def __init__(self, system: System, p: tuple[float, ...], t: Array, q: Array, v: Array):
        self.system, self.p, self.count = system, p, len(t)
        self._state = [t, *q.T, *v.T]
        self._matrices = matrices_of(system)

    def dynamics(self) -> Dynamics:
        """Return M (nq, nq, n), f (nq, n), B (nc, nq, n), γ (nc, n) and the power (n,)."""
        out = self._run("dynamics", [*self._state, *self.p])
        return self._matrices.dynamics(out, bool(np.isfinite(out).all()))

    def entries(self) -> Entries:
        """Return M, f, B and the constraints as their nonzero entries."""
        inputs = [*self._state, *self.p]
        dynamics = self._matrices.of_dynamics.split(self._run("dynamics", inputs))
        own = self._matrices.of_constraint.split(self._run("constraint", inputs))
        return Entries(**{**own, **dynamics})

    def report(self, a: Array, multipliers: Array) -> Array:
        """Return the report tape's outputs, (outputs, n); a is (n, nq) and λ (n, nc)."""
        return self._run("report", [*self._state, *a.T, *multipliers.T, *self.p])

    def _run(self, tape: str, inputs: list[Array | float]) -> Array:
        return _on_arrays(self.system, tape)(inputs, self.count)


@lru_cache(maxsize=12)
def _on_arrays(system: System, name: str) -> ArrayTape | _LongTape:
    """Return a tape of a System for many states, which the blocks of a run share."""
    tape: Tape = getattr(system, name)
    if len(tape.code) >= _LONG and not tape.functions.functions:
        return _LongTape(tape)
    return ArrayTape(tape)


class _LongTape:
    """A long tape evaluated at many states by the core, as `ArrayTape` does by NumPy."""

    def __init__(self, tape: Tape):
        from lagcli.engine.core.batch import BatchTable
        from lagcli.engine.core.program import assemble

        self._columns = tape.inputs - tape.parameters
        program = assemble(tape, long=None)
        self._table = BatchTable(program, tape.inputs, tape.parameters)

    def __call__(self, inputs: Sequence[Array | float], count: int) -> Array:
        """Return the outputs, (outputs, count)."""
        states = np.array(inputs[: self._columns]).T
        parameters = np.array(inputs[self._columns :], dtype=float)
        out: Array = self._table(states[None], parameters[None])[0]
        return out
