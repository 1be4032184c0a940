"""Starts next to singular configurations: constraints that are dependent a small distance away."""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.constraints.initial import ConsistentState
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear.dense import decompose
from lagcli.engine.scales import largest, usable
from lagcli.engine.state import State
from lagcli.engine.system import System

#: Next to a singular configuration, the weakest singular value of B, which is proportional to the
#: distance, is below this part of its median at states that are this far away, relative to the
#: sizes of the coordinates.
_NEAR, _ASIDE = 1e-4, 0.1
_STATES = 20
#: A larger singular value of B, whose rows have length one, needs no comparison.
_REGULAR = 1e-2
#: Constraints with a smaller part in the weakest combination are not named.
_PART = 0.05


def coordinate_reach(evaluator: Evaluator, state: State) -> Array:
    """Return the sizes of the coordinates, (nq,), comparable to the largest coordinate."""
    sizes = evaluator.sizes(state.t, state.q, state.v)
    most = largest(state.q, sizes) or 1.0
    return np.maximum(np.abs(state.q), np.minimum(most * sizes, 1.0))


def almost_dependent(system: System, state: State, rank: int) -> tuple[str, ...]:
    """Return the constraints that are almost dependent at the initial state, but not around it.

    The states around it are not consistent: where constraints touch, all consistent states may be
    next to the singular configuration. The weakest singular value of constraints that are almost
    dependent everywhere does not depend on the state.

    Parameters
    ----------
    system : System
    state : State
        A consistent state.
    rank : int
        The rank of B there, of the constraints that hold at the start.

    Returns
    -------
    tuple of str
        Empty away from singular configurations.
    """
    held = list(system.held_at_start)
    if not rank:
        return ()
    evaluator, t, v = Evaluator(system, state.p), state.t, state.v
    sizes = evaluator.sizes(t, state.q, v)
    c = evaluator.constraints(t, state.q, v)
    lengths = usable(evaluator.row_lengths(t, state.q, v, c, sizes)[held])
    here = decompose(c.jacobian[held], rank, lengths, sizes)
    weakest = here.values[rank - 1]
    if weakest > _REGULAR:
        return ()

    def around(q: Array) -> float:
        jacobian = evaluator.constraints(t, q, v).jacobian[held]
        if not np.isfinite(jacobian).all():
            return 0.0
        return float(decompose(jacobian, rank, lengths, sizes).values[rank - 1])

    random, reach = np.random.default_rng(8), _ASIDE * coordinate_reach(evaluator, state)
    others = [around(state.q + reach * random.normal(size=len(reach))) for _ in range(_STATES)]
    if not weakest < _NEAR * np.median(others):
        return ()
    parts = np.abs(here.left[:, rank - 1])
    return tuple(system.constraints[k] for k, part in zip(held, parts, strict=True) if part > _PART)


def next_to_singular(system: System, start: ConsistentState) -> list[str]:
    """Return a warning if the start is next to a singular configuration.

    Parameters
    ----------
    system : System
    start : ConsistentState
        A large system with an order of elimination is regular.
    """
    names = () if start.elimination else almost_dependent(system, start.state, start.rank)
    if not names:
        return []
    listed = ", ".join(f"`{name}`" for name in names)
    plural, verb = ("s", "are dependent") if len(names) > 1 else ("", "has no gradient")
    return [
        "the start is next to a singular configuration, in which the"
        f" constraint{plural} {listed} {verb}: accelerations and multipliers change much over a"
        " small distance; give guesses that lead to a start away from it"
    ]
