"""The equations of motion as lagcli derived them, for programs that are given nothing else.

Ported models have no geometry from which each program derives its own equations. All get the same
explicit right-hand side: the operations of lagcli's tape with the elimination written out, and the
values of the parameters folded in. Redundant constraints are left out, as one would by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lagcli.engine.evaluator import Evaluator
from lagcli.engine.integrate.prepared import find_elimination
from lagcli.engine.layout import UnrolledLayout
from lagcli.engine.linear.elimination import unroll
from lagcli.engine.tape.operations import ARITY, Op
from lagcli.engine.tape.tape import Tape
from lagcli.model.model import Model
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations import simulation

Array = NDArray[np.float64]


class Unsuited(Exception):
    """The equations cannot be written as operations of smooth functions; the message says why."""


@dataclass(frozen=True)
class TapeEquations:
    """a(t, q, v) of a model.

    Parameters
    ----------
    tape : Tape
        (t, q, v, parameters) → a.
    start : (2 nq,) array
        q and v.
    parameters : tuple of float
    """

    tape: Tape
    start: Array
    parameters: tuple[float, ...]

    def accelerations(
        self, t: Any, state: Sequence[Any], operation: Callable[[Op, list[Any]], Any]
    ) -> list[Any]:
        """Return a as objects of another program.

        Parameters
        ----------
        t, state : objects
            Time, q and v.
        operation : callable
            Returns the result of an operation on objects and numbers; those on numbers alone are
            computed here.
        """
        tape = self.tape
        place = [t, *state, *self.parameters]
        place += [0.0] * (tape.inputs - len(place))
        place += [*tape.constants, *[None] * len(tape.code)]
        for number, to, *operands in tape.code:
            op = Op(number)
            values = [place[x] for x in operands[: ARITY[op]]]
            known = all(isinstance(x, float) for x in values)
            place[to] = float(op.scalar(*values)) if known else operation(op, values)
        return [place[x] for x in tape.outputs]


def tape_equations(model: Model, settings: SettingsOverrides) -> TapeEquations:
    """Return the equations of a model.

    Raises
    ------
    Unsuited
    """
    prepared = simulation.prepare(model, settings)
    if prepared.system.switching is not None:
        raise Unsuited("contacts and events")
    if prepared.start.rank < len(prepared.system.constraints):
        kept = independent_rows(prepared)
        constraints = tuple(model.constraints[i] for i in kept)
        prepared = simulation.prepare(replace(model, constraints=constraints), settings)
    system, state = prepared.system, prepared.start.state
    evaluator = Evaluator(system, state.p)
    elimination = find_elimination(evaluator, [state])
    if elimination is None:
        raise Unsuited("no order of elimination")
    solution = UnrolledLayout(system.counts).solution
    first = solution.start
    tape = unroll(system, elimination).selected(range(first, first + len(system.coordinates)))
    return TapeEquations(tape, state.y[: 2 * len(system.coordinates)].copy(), tuple(state.p))


def independent_rows(prepared: simulation.Simulation) -> list[int]:
    """Return constraints whose rows of B are independent at the start, as many as B has rank."""
    state = prepared.start.state
    rows = Evaluator(prepared.system, state.p).dynamics(state.t, state.q, state.v).jacobian
    rows = rows / np.linalg.norm(rows, axis=1)[:, None]
    kept: list[int] = []
    rest = rows.copy()
    for _ in range(prepared.start.rank):  # Gram and Schmidt, the longest remainder first
        chosen = int(np.argmax(np.linalg.norm(rest, axis=1)))
        kept.append(chosen)
        direction = rest[chosen] / np.linalg.norm(rest[chosen])
        rest = rest - np.outer(rest @ direction, direction)
    return sorted(kept)
