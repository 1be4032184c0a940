"""Changes of a state in several directions, and directional derivatives of tapes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.evaluator import Constraints, Dynamics, TapeMatrices
from lagcli.engine.switching.kinks import FrozenSystem
from lagcli.engine.switching.reference.modal import ModalMotion
from lagcli.engine.system import System
from lagcli.engine.tape.differentiation import directional
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.tape import Tape


class Change(NamedTuple):
    """Changes of time, state and parameters in n directions.

    Parameters
    ----------
    t : (n,) array
    q, v : (nq, n) arrays
    p : (np, n) array
        Changes of the System's parameters, including branches, whose changes are 0.
    """

    t: Array
    q: Array
    v: Array
    p: Array

    @property
    def directions(self) -> int:
        """The number of directions."""
        return len(self.t)

    def beside(self, other: Change) -> Change:
        """Return the directions of this and of another change together."""
        return Change(*(np.concatenate(x, axis=-1) for x in zip(self, other, strict=True)))

    def moved(self, time: Array, v: Array, a: Array) -> Change:
        """Return the change if the motion also continues for a time in each direction.

        Parameters
        ----------
        time : (n,) array
            s.
        v, a : (nq,) arrays
        """
        return Change(self.t + time, self.q + np.outer(v, time), self.v + np.outer(a, time), self.p)

    def inputs(self, extra: Sequence[Array] = ()) -> Array:
        """Return the changes of a tape's inputs (t, q, v, extra, parameters), one row each."""
        return np.concatenate([self.t[None], self.q, self.v, *extra, self.p])


class DirectionalSystem:
    """The directional derivatives of a System's tapes; each is compiled on first use.

    Parameters
    ----------
    system : System
        With ``switching``.
    frozen : FrozenSystem, optional
        Equations of the System.
    """

    def __init__(self, system: System, frozen: FrozenSystem | None):
        assert system.switching is not None
        s = system.switching
        self.system, self.switching = system, s
        self.matrices = TapeMatrices(system)
        self._tapes: dict[str, Tape | None] = {
            "dynamics": system.dynamics,
            "constraint": system.constraint,
            "limits": s.limits,
            "impact": s.impact,
            "forces": s.forces,
            "actions": s.actions,
            "conditions": system.events,
            "force_conditions": s.force_conditions,
            "kinks": None if frozen is None else frozen.functions,
        }
        self._formed: dict[str, ScalarTape] = {}
        self._second: ScalarTape | None = None
        self._pieces: list[float] | None = None

    def hold(self, t: float) -> None:
        """Fix the pieces of the known functions of time to those from a time on."""
        self._pieces = self.system.functions.pieces_at(t)
        for tape in self._formed.values():
            tape.hold(self._pieces)
        if self._second is not None:
            self._second.hold(self._pieces)

    def along(self, name: str, inputs: Sequence[float], changes: Array) -> Array:
        """Return derivatives of a tape's outputs along directions.

        Parameters
        ----------
        name : str
            A tape of ``System`` or ``Switching``: "dynamics", "constraint", "limits", "impact",
            "forces", "actions", "conditions", "force_conditions" or "kinks".
        inputs : sequence of float
        changes : (inputs, n) array

        Returns
        -------
        (outputs, n) array
        """
        tape = self._tapes[name]
        if tape is None:
            return np.zeros((0, changes.shape[1]))
        if name not in self._formed:
            self._formed[name] = ScalarTape(directional(tape))
            self._formed[name].hold(self._pieces)
        formed = self._formed[name]
        found = [formed((*inputs, *x)) for x in changes.T.tolist()]
        return np.array(found, dtype=float).reshape(len(found), len(tape.outputs)).T

    def rates_of_kinks(
        self, inputs: Sequence[float], flow: Array, changes: Array, of_flow: Array
    ) -> tuple[Array, Array]:
        """Return the rates of the functions of kinks along a motion, and their derivatives.

        Parameters
        ----------
        inputs : sequence of float
        flow : (inputs,) array
            The rates of the inputs along the motion.
        changes, of_flow : (inputs, n) arrays
            Derivatives of the inputs, and of their rates.

        Returns
        -------
        (nk,) and (nk, n) arrays
        """
        if self._second is None:
            assert self._tapes["kinks"] is not None
            self._second = ScalarTape(directional(directional(self._tapes["kinks"])))
            self._second.hold(self._pieces)
        second, rates = self._second, self.along("kinks", inputs, flow[:, None])[:, 0]
        both = np.concatenate([changes, of_flow])
        found = [second((*inputs, *flow.tolist(), *x)) for x in both.T.tolist()]
        return rates, np.array(found, dtype=float).reshape(len(found), len(rates)).T


class PerturbedState(NamedTuple):
    """A state of a motion in a mode, and its changes in n directions.

    Parameters
    ----------
    system : DirectionalSystem
    motion : ModalMotion
        In the mode.
    t : float
        s.
    q, v : (nq,) arrays
    change : Change
    """

    system: DirectionalSystem
    motion: ModalMotion
    t: float
    q: Array
    v: Array
    change: Change

    @property
    def inputs(self) -> tuple[float, ...]:
        """The inputs of tapes, (t, q, v, parameters)."""
        return (self.t, *self.q.tolist(), *self.v.tolist(), *self.motion.full.p)

    def along(self, name: str) -> Array:
        """Return derivatives of the outputs of a tape with these inputs, (outputs, n)."""
        return self.system.along(name, self.inputs, self.change.inputs())

    def dynamics(self) -> Dynamics:
        """Return derivatives of M, f, B, γ and the power; the last axis is that of directions."""
        return self.system.matrices.dynamics(self.along("dynamics"), True)

    def constraints(self) -> Constraints:
        """Return derivatives of φ, B and b_0; the last axis is that of directions."""
        return self.system.matrices.constraints(self.along("constraint"))
